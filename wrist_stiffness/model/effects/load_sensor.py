"""Load sensors that read another wrench."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.law import Contribution, Law, Situation, SIValues
from wrist_stiffness.model.parameters import (
    Parameter,
    axis_keys,
    symmetric,
    symmetric_vector,
    vector,
)

FORCE, MOMENT = "f{}_N", "m{}_Nmm"


class LoadBias(Law):
    """The sensor says the true wrench plus a constant in F."""

    id = "load_bias"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load sensor does not read zero without load"
    check = "tare the sensor; read it with the platform free"
    excited_by = "loads of several directions, and none"
    constant = True
    tared = True
    inexactness = 0.0
    own = (*symmetric_vector(FORCE, 5.0, 0.1), *symmetric_vector(MOMENT, 100.0, 2.0))

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return true minus said."""
        bias = vector(values, FORCE, MOMENT)
        return Contribution(wrench=np.tile(-bias, (len(at.block), 1)))


class LoadScale(Law):
    """The sensor says (1 + scale) times the true wrench."""

    id = "load_scale"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load sensor reads too much (or too little) by a constant factor"
    check = (
        "hang a reference weight on the platform; see whether the sensor says newtons, not kg or kN"
    )
    excited_by = "loads of several sizes beside a known weight"
    inexactness = 0.0
    own = (Parameter("scale_percent", -50.0, 3000.0, 3.0, linear=False),)

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return true minus said."""
        return Contribution(wrench=self.load_share(values) * at.load)

    def load_share(self, values: Mapping[str, float]) -> float:
        """Return the same as a share of what is said."""
        return 1.0 / (1.0 + values["scale_percent"]) - 1.0


AXES = ("fx", "fy", "fz", "mx", "my", "mz")
SAME, FORCE_FROM_MOMENT, MOMENT_FROM_FORCE = "percent", "N_per_Nm", "Nmm_per_N"
TALK_PRIOR = {SAME: (100.0, 1.0), FORCE_FROM_MOMENT: (100.0, 1.0), MOMENT_FROM_FORCE: (100.0, 0.1)}
"""Bound and typical magnitude: a hundredth of full scale, moments being 10 mm times forces."""


def unit(axis: str, source: str) -> str:
    """Return the unit of what one axis reads of another."""
    if axis[0] == source[0]:
        return SAME
    return FORCE_FROM_MOMENT if axis[0] == "f" else MOMENT_FROM_FORCE


TALK = {
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
    own = tuple(symmetric(key, *TALK_PRIOR[key.split("_", 3)[3]]) for key in TALK)

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return true minus said."""
        shares = np.zeros((6, 6))
        for key, entry in TALK.items():
            shares[entry] = values[key]
        return Contribution(wrench=-at.load @ shares.T)


TURN_BASE, TURN_PLATFORM = "base_{}_mdeg", "platform_{}_mdeg"
MOST_TURN_MDEG, USUAL_TURN_MDEG = 180e3, 500.0


class LoadMisalignment(Law):
    """The true wrench is the said one turned about O: by one turn fixed in F, after one in U.

    Each is a rotation vector: a sensor may be mounted a quarter turn off.
    """

    id = "load_misalignment"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load sensor's axes are turned against the wrist's"
    check = "hang a weight and compare the direction that the sensor says at several tilts"
    excited_by = "loads of several directions at several poses"
    inexactness = 0.0
    own = tuple(
        Parameter(key, -MOST_TURN_MDEG, MOST_TURN_MDEG, USUAL_TURN_MDEG, linear=False)
        for pattern in (TURN_BASE, TURN_PLATFORM)
        for key in axis_keys(pattern)
    )

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return true minus said."""
        base = Rotation.from_rotvec(vector(values, TURN_BASE))
        platform = Rotation.from_rotvec(at.body("platform") @ vector(values, TURN_PLATFORM))
        halves = [(base * platform).apply(at.load[:, own]) for own in (slice(3), slice(3, 6))]
        return Contribution(wrench=np.concatenate(halves, axis=1) - at.load)


LEVER_BASE, LEVER_PLATFORM = "base_{}_mm", "platform_{}_mm"


class LoadPoint(Law):
    """The force acts off O by a lever arm fixed in F and one fixed in U, beyond the told moment."""

    id = "load_point"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load acts beside the point for which it is given"
    check = "measure where the load touches; move it by a known distance and compare"
    excited_by = "forces of several directions at several poses"
    inexactness = 0.0
    own = (
        *symmetric_vector(LEVER_BASE, 1000.0, 2.0),
        *symmetric_vector(LEVER_PLATFORM, 1000.0, 2.0),
    )

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the missing moment."""
        lever = vector(values, LEVER_BASE) + at.body("platform") @ vector(values, LEVER_PLATFORM)
        wrench = np.zeros_like(at.load)
        wrench[:, 3:] = cross(lever, at.load[:, :3])
        return Contribution(wrench=wrench)
