"""What one effect adds at every sample, and the word for a signal that it lacks."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array


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
        """Refuse arrays of other shapes than n samples and m sectors ask for, or not finite.

        Raises `InputError`: the message names the field.
        """
        shapes = {"through": (samples, 8, 6), "gap": (samples, sectors)}
        for name in (f.name for f in fields(self) if f.name != "rubbing"):
            value, shape = getattr(self, name), shapes.get(name, (samples, 6))
            if value is not None and np.shape(value) != shape:
                raise InputError(f"{name} has shape {np.shape(value)}, not {shape}")
            if value is not None and not np.isfinite(value).all():
                raise InputError(f"{name} is not finite")


def together(a: Array | None, b: Array | None) -> Array | None:
    """Return the sum of two arrays of which either may be None for nothing."""
    if a is None or b is None:
        return b if a is None else a
    return a + b


NOTHING = Contribution()

LEFT_OUT = " is missing, left out"
"""How the warning ends that an effect lacks a signal; the effect's name and the signal go before.
"""


class MissingSignalError(Exception):
    """A law asks for a signal that the samples lack; the evaluation turns it to a warning."""

    def __init__(self, signal: str) -> None:
        super().__init__(signal)
        self.signal = signal
