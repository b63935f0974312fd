"""What effects that never change add together, in the bodies that it is fixed to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import BODIES, Configuration
from wrist_stiffness.mechanism.single_pose import GROUPS
from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.places import BODY, LIMB, MOTOR_JOINT

SEATS = tuple((LIMB[names[0]], BODIES.index(BODY[names[0]])) for names in GROUPS)
"""Limb and body of each row of screws."""


@dataclass(frozen=True, eq=False)
class Constants:
    """Sum of constant contributions; None for nothing.

    Parameters
    ----------
    screws : (5, 6) float, optional
        At O in the home frames of `SEATS`, which are the groups of `SinglePoseStatics` [m, rad].
    wrench : (6,) float, optional
        On the platform in F [N, N m].
    gap : (m,) float, optional
        Opening of the flange sectors [m].
    sensor_left : (6,) float, optional
        X of the pose sensor in F [m, rad].
    sensor_right : (6,) float, optional
        Y of the pose sensor in U [m, rad].
    warnings : tuple of str
        Of effects past first order.
    """

    screws: Array | None = None
    wrench: Array | None = None
    gap: Array | None = None
    sensor_left: Array | None = None
    sensor_right: Array | None = None
    warnings: tuple[str, ...] = ()

    def with_home(self, place: str, added: Contribution, warnings: Sequence[str]) -> Constants:
        """Return the sum with what a place adds at home, a contribution of one sample."""
        screws = self.screws
        screw = added.limb_1 if added.limb_2 is None else added.limb_2
        if screw is not None:
            joint = MOTOR_JOINT.get(place, place)
            here = np.array([joint in names for names in GROUPS])[:, None] * screw[0]
            screws = here if screws is None else screws + here
        return Constants(
            screws,
            _sum(self.wrench, added.wrench),
            _sum(self.gap, added.gap),
            _sum(self.sensor_left, added.sensor_left),
            _sum(self.sensor_right, added.sensor_right),
            (*self.warnings, *warnings),
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
            for (limb, body), screw in zip(SEATS, self.screws, strict=True):
                turned = _turned(configuration.bodies[..., body, :, :], screw)
                limbs[limb] = limbs[limb] + turned if limb in limbs else turned
        return Contribution(
            **limbs,
            wrench=_each(self.wrench, n),
            gap=_each(self.gap, n),
        )


def _sum(known: Array | None, added: Array | None) -> Array | None:
    if added is None:
        return known
    return added[0] if known is None else known + added[0]


def _each(value: Array | None, n: int) -> Array | None:
    return None if value is None else np.broadcast_to(value, (n, len(value)))


def _turned(rotation: Array, six: Array) -> Array:
    """Turn a 6-vector (6,) by rotations (..., 3, 3), (..., 6)."""
    halves = six.reshape(2, 3) @ np.swapaxes(rotation, -1, -2)
    return halves.reshape(*rotation.shape[:-2], 6)
