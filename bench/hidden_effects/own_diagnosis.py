"""The project's diagnosis of measured sessions, told as it is kept in a results file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bench_wrist import OWN, TRUTH, code_version, wrist

from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.measured_session import MeasuredSession


def version_of_own() -> str:
    """Return the digest of the project's own diagnosis and of the truth it is asked about."""
    return code_version((*TRUTH, *OWN), ("cases.py", "observe.py", "own_diagnosis.py"))


def diagnosed(sessions: Sequence[MeasuredSession]) -> dict[str, Any]:
    """Return verdict, names and their probabilities, and what else a diagnosis tells."""
    found = diagnose_sessions(ErrorModel("benchmark", wrist(), "closed_form"), sessions)
    result = found.diagnosis
    return {
        "verdict": result.verdict,
        "named": [list(finding.names) for finding in result.findings],
        "probability": result.probability,
        "probabilities": [finding.probability for finding in result.findings],
        "suspects": [[list(f.names), f.probability, f.log_gain] for f in result.suspects],
        "classes": [[c.name, c.probability, c.rest, c.left] for c in found.classes],
        "unexplained": result.unexplained,
        "depends_on": dict(result.depends_on),
        "held_out": [dict(result.before), dict(result.after)],
        "noise": dict(result.noise),
        "discrepancy": dict(result.discrepancy),
        "fits": len(found.search.states),
    }
