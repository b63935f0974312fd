"""The project's own diagnosis as a solver: measured sessions, the error model and its laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from bench_wrist import OWN, TRUTH, Array, code_version, wrist
from cases import REGISTRATIONS
from dictionary import Dictionary
from observe import Day, Riddle, noise_seed, settings_of
from solvers import Answer

from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.identification.base_fit import BaseFit, fit_base
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.unit_session import as_units


def version_of_own() -> str:
    """Return the digest of the project's own diagnosis and of the truth it is asked about."""
    return code_version((*TRUTH, *OWN), ("cases.py", "observe.py", "own_diagnosis.py"))


def own_diagnosis(riddle: Riddle, words: Dictionary | None = None) -> Answer:
    """Diagnose the first day as it is read; the refitted wrist with the findings predicts.

    The session holds what reading a recording gives.  No word of the simulation is looked at.
    """
    return diagnosed(riddle, riddle.days[0].read)


def own_diagnosis_mcap(riddle: Riddle, words: Dictionary | None = None) -> Answer:
    """Do the same by way of a recording: written as MCAP, read as any other."""
    case = riddle.case
    settings = replace(settings_of(case, 0), hidden=riddle.hidden)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "day_1.mcap"
        simulate_recording(path, wrist(), settings, case.seconds, noise_seed(case, 0))
        return diagnosed(riddle, read_session(path, wrist()))


def diagnosed(riddle: Riddle, session: MeasuredSession) -> Answer:
    """Return the answer of the project to a first day."""
    return diagnosed_sessions(riddle, [session], riddle.case.seed)


def diagnosed_sessions(
    riddle: Riddle | None, sessions: Sequence[MeasuredSession], seed: int
) -> Answer:
    """Return the answer of the project to some days; without a riddle it explains no other."""
    model = ErrorModel("benchmark", wrist(), "closed_form")
    found = diagnose_sessions(model, sessions)
    result = found.diagnosis
    classes = tuple(finding.names for finding in result.findings)
    details = {
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
    if riddle is None:
        nothing = np.zeros((0, 6))
        return Answer(result.verdict, classes, (nothing, nothing), details=details)
    extended = model.with_effects(*refitted(found.fitted, found.effects), *found.effects)
    one, two = (predicted(extended, day) for day in riddle.days)
    return Answer(
        result.verdict,
        classes,
        (one, two),
        tuple(f"{each.effect}@{each.component}" for each in result.not_excited),
        {each.name: each.probability for each in result.standings},
        details=details,
    )


def refitted(base: BaseFit, named: Sequence[Effect] = ()) -> list[Effect]:
    """Return the wrist as it was refitted, without what is named.

    Where the sensors stood on the first day is not of the wrist.
    """
    names = {each.name for each in named}
    return [
        each
        for each in base.effects(0, with_extras=False)
        if each.law.id not in REGISTRATIONS and each.name not in names
    ]


def calibrated(days: tuple[Day, Day]) -> tuple[Array, Array]:
    """Return what the project's refitted wrist explains of both days, fitted to the first."""
    model = ErrorModel("benchmark", wrist(), "closed_form")
    base = fit_base(model, (as_units(model, days[0].read),))
    extended = model.with_effects(*refitted(base))
    one, two = (predicted(extended, day) for day in days)
    return one, two


def predicted(model: ErrorModel, day: Day) -> Array:
    """Return what a model explains of a day's residual against the table, (u, 6).

    Nothing where it refuses to predict: there the sensor says a load beyond the table.
    """
    block = day.recorded.block
    twist = model.batch(block).measured
    refused = ~np.isfinite(twist).all(axis=1)
    rotation, shift = exp_twist(np.where(refused[:, None], 0.0, twist))
    nominal = model.table.mechanism.forward(block.theta).platform
    rotation, shift = rotation @ nominal, shift.copy()
    rotation[refused], shift[refused] = day.base.rotation[refused], day.base.shift[refused]
    return day.explained(rotation, shift)
