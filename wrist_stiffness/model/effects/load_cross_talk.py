"""A load sensor whose axes read shares of one another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.situation import Situation

AXES = ("fx", "fy", "fz", "mx", "my", "mz")
SAME, FORCE_FROM_MOMENT, MOMENT_FROM_FORCE = "percent", "N_per_Nm", "Nmm_per_N"
PRIOR = {SAME: (100.0, 1.0), FORCE_FROM_MOMENT: (100.0, 1.0), MOMENT_FROM_FORCE: (100.0, 0.1)}
"""Bound and typical magnitude: a hundredth of full scale, moments being 10 mm times forces."""


def unit(axis: str, source: str) -> str:
    """Return the unit of what one axis reads of another."""
    if axis[0] == source[0]:
        return SAME
    return FORCE_FROM_MOMENT if axis[0] == "f" else MOMENT_FROM_FORCE


KEYS = {
    f"{axis}_from_{source}_{unit(axis, source)}": (AXES.index(axis), AXES.index(source))
    for axis in AXES
    for source in AXES
    if (axis, source) != ("fz", "fz")
}
"""Row and column of each parameter.  The gain of fz is left to `load_scale`, to which those of the
other five are relative."""


class LoadCrossTalk(Law):
    """Every axis says the true wrench's component plus shares of what the axes say, fixed in F."""

    id = "load_cross_talk"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the axes of the load sensor read shares of one another, or differ in their gain"
    check = "load one axis of the sensor at a time and read all six"
    excited_by = "forces and moments of every direction, one without the others"
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the shares."""
        return tuple(symmetric(key, *PRIOR[key.split("_", 3)[3]]) for key in KEYS)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return true minus said."""
        shares = np.zeros((6, 6))
        for key, entry in KEYS.items():
            shares[entry] = values[key]
        return Contribution(wrench=-at.load @ shares.T), None
