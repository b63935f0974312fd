"""The project's own diagnosis as a solver: measured sessions, the error model and its laws."""

from __future__ import annotations

import numpy as np
from bench_wrist import Array, wrist
from dictionary import Dictionary
from observe import Day, Riddle
from solvers import Answer

from wrist_stiffness.campaign.diagnosing import diagnose_sessions
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.error_model import ErrorModel


def own_diagnosis(riddle: Riddle, words: Dictionary | None = None) -> Answer:
    """Diagnose the first day as it was recorded; its findings predict both days.

    The sessions hold what a recording holds.  No word of the simulation is looked at.
    """
    model = ErrorModel("benchmark", wrist(), "closed_form")
    rng = np.random.default_rng(riddle.case.seed)
    found = diagnose_sessions(model, [riddle.days[0].recorded], rng)
    result = found.diagnosis
    extended = model.with_effects(*found.effects)
    one, two = (predicted(extended, day) for day in riddle.days)
    return Answer(
        result.verdict,
        tuple(finding.names for finding in result.findings),
        (one, two),
        tuple(f"{each.effect}@{each.component}" for each in result.not_excited),
    )


def predicted(model: ErrorModel, day: Day) -> Array:
    """Return what a model explains of a day's residual against the table, (u, 6)."""
    block = day.recorded.block
    rotation, shift = exp_twist(model.batch(block).measured)
    nominal = model.table.mechanism.forward(block.theta).platform
    return day.explained(rotation @ nominal, shift)
