"""What one effect adds at every sample, and what those that never change add together.

The latter in the bodies that it is fixed to.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.compiled import GROUPS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.vectors import both_halves
from wrist_stiffness.model.places import BODY, LIMB, MOTOR_JOINT


@dataclass(frozen=True)
class Contribution:
    """What one effect adds at n samples; everything at O in F, None for nothing."""

    # `limb_1`, `limb_2`: (n, 6), screw in a limb, carried by its G and its rows of the slides [m,
    # rad]
    limb_1: Array | None = None
    limb_2: Array | None = None
    both: Array | None = None  # (n, 6), screw under or behind both limbs [m, rad]
    wrench: Array | None = None  # (n, 6), on the platform [N, N m]
    # (n, 8, 6), further wrench through the elastic components, in the order of `ELASTIC` [N, N m]
    through: Array | None = None
    gap: Array | None = None  # (n, m), opening of the flange sectors [m]
    # `sensor_left`, `sensor_right`: (n, 6), twists X and Y of the pose sensor, T_measured = exp(X)
    # T_err exp(Y) T_nominal [m, rad]
    sensor_left: Array | None = None
    sensor_right: Array | None = None
    # Not by its name: what rubs follows a situation, which is made of contributions.
    rubbing: Any = None  # joints whose friction is in `through`: they may hold a pin in its play

    def __add__(self, other: Contribution) -> Contribution:
        """Return both together; to first order they do not know of each other."""
        mine, its = vars(self), vars(other)
        return Contribution(*(together(mine[name], its[name]) for name in mine))

    def check(self, samples: int, sectors: int) -> None:
        """Refuse arrays of other shapes than n samples and m sectors ask for, or no finite numbers.

        Raises `InputError`: the message names the field.
        """
        shapes = {"through": (samples, 8, 6), "gap": (samples, sectors)}
        for name in (f.name for f in fields(self) if f.name != "rubbing"):
            value, shape = getattr(self, name), shapes.get(name, (samples, 6))
            if value is not None and np.shape(value) != shape:
                raise InputError(f"{name} has shape {np.shape(value)}, not {shape}")
            if value is not None and not np.can_cast(np.asarray(value).dtype, float, "same_kind"):
                raise InputError(f"{name} holds {np.asarray(value).dtype}, not real numbers")
            if value is not None and not np.isfinite(value).all():
                raise InputError(f"{name} is not finite")


def together(a: Array | None, b: Array | None) -> Array | None:
    """Return the sum of two arrays of which either may be None for nothing."""
    if a is None or b is None:
        return b if a is None else a
    return a + b


NOTHING = Contribution()


class MissingSignalError(Exception):
    """A law asks for a signal that the samples lack; the evaluation turns it to a warning."""


def left_out(effect: str, signal: str) -> str:
    """Return the warning that an effect lacks a signal."""
    return f"{effect}: {signal} is missing, left out"


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
        mine, its = vars(self), vars(other)
        added: dict[str, Any] = {name: together(mine[name], its[name]) for name in mine}
        return Constants(**added)

    def sensor(self, configuration: Configuration) -> tuple[Array | None, Array | None]:
        """Return X (6,) and, turned with the platform, Y (n, 6) or (6,) of the pose sensor."""
        right = self.sensor_right
        return self.sensor_left, None if right is None else both_halves(
            configuration.platform, right
        )

    def at(self, configuration: Configuration) -> Contribution:
        """Return what is added at n configurations, what the sensor says of it apart."""
        n = len(configuration.theta)
        limbs: dict[str, Array] = {}
        if self.screws is not None:
            turned = both_halves(configuration.bodies.take(_BODIES, axis=-3), self.screws)
            limbs = {limb: turned[..., rows, :].sum(axis=-2) for limb, rows in _LIMBS.items()}
        return Contribution(
            **limbs,
            wrench=_each(self.wrench, n),
            gap=_each(self.gap, n),
        )


def _each(value: Array | None, n: int) -> Array | None:
    return None if value is None else np.broadcast_to(value, (n, len(value)))
