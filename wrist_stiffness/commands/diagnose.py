"""Which physical effect is missing, from recordings to an answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.commands.provenance import Provenance, Run
from wrist_stiffness.commands.read_sessions import (
    Recordings,
    read_sessions,
    remarks_of,
    sha256_by_name,
    was_fitted_to,
)
from wrist_stiffness.comparing.compare import suspicion_in, wrong_load
from wrist_stiffness.comparing.explained import Explained, explain
from wrist_stiffness.comparing.wiring import WORTH_ASKING, load_too_large, told_mistake
from wrist_stiffness.identification.free_effects import unfitted
from wrist_stiffness.identification.likelihood import likelihood_of
from wrist_stiffness.identification.wrist_diagnosis import WristDiagnosis, diagnose_sessions
from wrist_stiffness.inference import Diagnosis
from wrist_stiffness.inference.reading import NAMING
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.refitted import ANSWERS_LOAD

FAR_FROM_DRAWN = 3.0
"""Standard deviations of its prior at which a part is softer or stiffer than any is built."""


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis and what it was made from."""

    answer: WristDiagnosis
    recordings: tuple[str, ...]  # names of the sessions
    mistake: str  # of signs, units or names, where one explains most of the error; else empty
    remarks: tuple[str, ...]  # what could not be used of the recordings
    provenance: Provenance
    model: str = "MODEL"
    paths: tuple[str, ...] = ("RECORDING",)  # recordings as they were named

    @property
    def result(self) -> Diagnosis:
        """What the statistics say."""
        return self.answer.diagnosis

    def depends(self) -> Explained:
        """Return what the calibrated model leaves without any effect, and on what it depends."""
        nominal = self.answer.nominal
        problem = nominal.problem
        left = problem.table.with_values(nominal.residual)
        return explain(
            left,
            problem.sessions,
            nominal.columns,
            nominal.z,
            left.measured / likelihood_of(nominal).variance,
            problem.weights,
        )

    def proposed(self) -> list[str]:
        """Return whether tolerances are strained, and the laws for what no effect explains."""
        found, strain = self.answer.proposals, self.answer.strain
        told = [strain.sentence] if strain and strain.sentence else []
        named = [each.name for each in self.result.findings]
        return told + (found.lines(self.model, self.paths, named) if found else [])

    def as_values(self, ranking: bool = False) -> dict[str, Any]:
        """Return what programs read, with units in the names.

        `ranking`: whether every candidate is told, and what each fitted rival changes in every
        unit.
        """
        found = {
            **self.result.as_json(ranking),
            "set_up_mistake": self.mistake,
            "strain": asdict(self.answer.strain) if self.answer.strain else None,
            "proposals": self.answer.proposals.as_values() if self.answer.proposals else None,
            "notes": [*self.remarks],
            "provenance": self.provenance.as_values(),
        }
        if ranking:
            fitted = [each.name for each in self.result.standings if each.fitted]
            found["change_by_unit_m_rad"] = {
                name: self.answer.change_by(name).tolist() for name in fitted
            }
        return found


def diagnose_recordings(
    model: str | Path,
    recordings: Recordings,
    run: Run,
    progress: Callable[[str], Progress] = lambda label: silent,
    tell: Callable[[str], None] = lambda text: None,
    naming: float = NAMING,
    seconds: float = np.inf,
) -> Diagnosed:
    """Find the effects that a model misses in recordings of one wrist.

    `recordings`: each a session; the last one judges what the others show.  `progress`: from a
    label to a function that is told steps done and in all.  `naming`: probability from which an
    effect is named.  `seconds`: time after which no further fit is begun.  Raises `WristError` if
    the model or a recording cannot be used.
    """
    loaded = load_model(model)
    sessions = read_sessions(recordings, [loaded], progress("reading"))
    known = unfitted(loaded) if was_fitted_to(loaded, sessions) else loaded
    answer = diagnose_sessions(known, list(sessions.values()), naming, seconds, tell)
    mistake = mistake_beside(known, answer, list(sessions.values()), tell)
    hashes = sha256_by_name(sessions)
    return Diagnosed(
        answer,
        tuple(hashes),
        mistake,
        remarks_of(sessions.values()),
        Provenance(run.command, run.date, {Path(model).stem: file_sha256(model)}, hashes),
        str(model),
        tuple(map(str, recordings.paths)),
    )


def mistake_beside(
    known: ErrorModel,
    answer: WristDiagnosis,
    sessions: Sequence[MeasuredSession],
    tell: Callable[[str], None] = lambda text: None,
) -> str:
    """Return the mistake of signs, units or names that an answer makes likely; empty for none."""
    mistake, noise = load_too_large(known, sessions), answer.diagnosis.noise_of_judge
    if not mistake and any(
        size > WORTH_ASKING * noise[key] for key, size in answer.diagnosis.after.items()
    ):
        tell("asking for wrong signs, units and names")
        mistake = told_mistake(suspicion_in(known, sessions))
    if not mistake and _doubts_load(answer):
        # Axes that are off their drawing hide a wrong load, and so do parts that it made as stiff
        # as they can be: so it is asked with the axes as fitted and the stiffness of before.
        tell("asking for a wrong load")
        fitted = known.with_effects(*answer.fitted.effects(0))
        mistake = wrong_load(known, fitted, sessions)
    return mistake


def _doubts_load(answer: WristDiagnosis) -> bool:
    """Tell whether the wrist answers loads so unusually that these may be wrong."""
    named = {law for finding in answer.diagnosis.findings for law, _, _ in finding.members}
    far = {
        each.name.partition("@")[0] for each in answer.absorbed if each.deviations > FAR_FROM_DRAWN
    }
    return not ANSWERS_LOAD.isdisjoint(named | far)
