"""What effects that never change add together, in the bodies that it is fixed to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.compiled import GROUPS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.model.contribution import Contribution, together
from wrist_stiffness.model.places import BODY, LIMB, MOTOR_JOINT

SEATS = tuple((LIMB[names[0]], BODIES.index(BODY[names[0]])) for names in GROUPS)
"""Limb and body of each row of screws."""

_BODIES = np.array([body for _, body in SEATS])
_LIMBS = {limb: [n for n, seat in enumerate(SEATS) if seat[0] == limb] for limb, _ in SEATS}


@dataclass(frozen=True, eq=False)
class Constants:
    """Sum of constant contributions; None for nothing."""

    # (5, 6), at O in the home frames of `SEATS`, which are the groups of `CompiledWrist` [m, rad]
    screws: Array | None = None
    wrench: Array | None = None  # (6,), on the platform in F [N, N m]
    gap: Array | None = None  # (m,), opening of the flange sectors [m]
    sensor_left: Array | None = None  # (6,), X of the pose sensor in F [m, rad]
    sensor_right: Array | None = None  # (6,), Y of the pose sensor in U [m, rad]
    warnings: tuple[str, ...] = ()  # of effects past first order

    @classmethod
    def of_home(cls, place: str, added: Contribution, warnings: tuple[str, ...]) -> Constants:
        """Return what a place adds at home, a contribution of one sample."""
        screw = added.limb_1 if added.limb_2 is None else added.limb_2
        screws = None
        if screw is not None:
            joint = MOTOR_JOINT.get(place, place)
            screws = np.array([joint in names for names in GROUPS])[:, None] * screw[0]
        wrench, gap, left, right = (
            None if value is None else value[0]
            for value in (added.wrench, added.gap, added.sensor_left, added.sensor_right)
        )
        return cls(screws, wrench, gap, left, right, warnings)

    def __add__(self, other: Constants) -> Constants:
        """Return both together."""
        return Constants(
            together(self.screws, other.screws),
            together(self.wrench, other.wrench),
            together(self.gap, other.gap),
            together(self.sensor_left, other.sensor_left),
            together(self.sensor_right, other.sensor_right),
            self.warnings + other.warnings,
        )

    def sensor(self, configuration: Configuration) -> tuple[Array | None, Array | None]:
        """Return X (6,) and, turned with the platform, Y (n, 6) or (6,) of the pose sensor."""
        right = self.sensor_right
        return self.sensor_left, None if right is None else _turned(configuration.platform, right)

    def at(self, configuration: Configuration) -> Contribution:
        """Return what is added at n configurations, what the sensor says of it apart."""
        n = len(configuration.theta)
        limbs: dict[str, Array] = {}
        if self.screws is not None:
            turned = _turned(configuration.bodies.take(_BODIES, axis=-3), self.screws)
            limbs = {limb: turned[..., rows, :].sum(axis=-2) for limb, rows in _LIMBS.items()}
        return Contribution(
            **limbs,
            wrench=_each(self.wrench, n),
            gap=_each(self.gap, n),
        )


def _each(value: Array | None, n: int) -> Array | None:
    return None if value is None else np.broadcast_to(value, (n, len(value)))


def _turned(rotation: Array, six: Array) -> Array:
    """Turn 6-vectors (6,) or (k, 6) by rotations (..., 3, 3) or (..., k, 3, 3), (..., 6)."""
    halves = six.reshape(*six.shape[:-1], 2, 3) @ np.swapaxes(rotation, -1, -2)
    return halves.reshape(*rotation.shape[:-2], 6)
