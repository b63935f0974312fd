"""Loads that are mostly beyond what a table takes: in which unit they would be sound.

Such samples are left out before anything is compared, and what stays are the moments without a
load.  So the units are tried on all that was measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.comparing.sentences import percent
from wrist_stiffness.comparing.set_up import without_set_up
from wrist_stiffness.comparing.wiring import (
    LARGE_LOADS,
    LOOK_FIRST,
    NO_LOAD,
    Mistake,
    independent,
)
from wrist_stiffness.identification.calibration import said_calibrated
from wrist_stiffness.inference.answer import NAMING
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.measured_session import MOST_BEYOND, MeasuredSession, overloaded
from wrist_stiffness.sessions.unit_session import all_units

APART = 4.0
"""No wrist is so many times as soft as its model, and units are farther apart."""


def load_too_large(model: ErrorModel, sessions: Sequence[MeasuredSession]) -> str:
    """Return a sentence on a load that is mostly beyond a model's range; empty where it is not.

    It names the unit under which the load is in the range and explains what was measured.  Where
    there is none, it says only where to look.

    `sessions`: of one wrist, in the order of time.  Raises `InputError` if none of their
    measurements lies in the model's domain.
    """

    def beyond(mistake: Mistake | None = None) -> NDArray[np.bool_]:
        """Tell which measurements have a larger force or moment than the table takes, (n, 2)."""
        blocks = (each.take(np.asarray(each.measured.any(axis=1))).block for each in sessions)
        right = blocks if mistake is None else map(mistake.block, blocks)
        none = np.empty((0, 2), dtype=bool)
        return np.concatenate([none, *(overloaded(model.table, block) for block in right)])

    def left(mistake: Mistake) -> Observations:
        """Return what the model and the set-up leave of the units without a mistake."""
        right = tuple(mistake.measured_right(each) for each in sessions)
        return without_set_up(model, all_units(model, right), said_calibrated(sessions))[1]

    def likelihood(table: Observations) -> float:
        """Return its logarithm: see `wiring.suspected`."""
        count = independent(table)
        return -sum(count[key] * float(np.log(size)) for key, size in _rms(table).items())

    over = beyond()
    force, moment = (over.sum(axis=0) > MOST_BEYOND * len(over)).tolist()
    if not (force or moment):
        return ""
    units = [each for each in LARGE_LOADS[force, moment] if beyond(each).mean() < 1.0 - NAMING]
    found = {mistake: left(mistake) for mistake in (NO_LOAD, *units)}
    logs = {mistake: likelihood(table) for mistake, table in found.items()}
    best = max(logs, key=logs.__getitem__)
    sure = 1.0 / sum(np.exp(each - logs[best]) for each in logs.values())
    said = (
        f"{LOOK_FIRST}: {over.any(axis=1).sum()} of {len(over)} measured poses are under a load "
        "beyond the table's range"
    )
    # A load that is there, and too large for the table, fits the better the less is taken off it.
    more = best.with_load(APART)
    real = not beyond(more).any(axis=1).all() and likelihood(left(more)) > logs[best]
    if best is NO_LOAD or real or sure < NAMING:
        return f"{said}; check its unit (N, N m), its tare and the sensor's frame"
    error = _rms(found[best])
    sizes = " and ".join(f"{error[q.key]:.3g} {q.unit} of {q.name}" for q in found[best].reported)
    return f"{said}; with {best.without} the error is {sizes} ({percent(sure)} sure); {best.check}"


def _rms(table: Observations) -> dict[str, float]:
    return table.rms(np.nan_to_num(table.values) ** 2)
