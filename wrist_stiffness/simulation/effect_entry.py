"""One hidden effect of the catalogue: where it may be, how large, and how its law is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import unit
from wrist_stiffness.simulation.laws.law import Law
from wrist_stiffness.simulation.seat import Seat

LEVER = 0.03
"""Arm at which a turn counts like a shift where both are drawn together [m]."""


@dataclass(frozen=True)
class Draw:
    """What a law is made from."""

    table: Table
    component: str
    form: str
    magnitude: float
    rng: np.random.Generator

    @property
    def seat(self) -> Seat:
        """Bushing of the component, which is a joint."""
        return Seat.of(self.table.geometry, self.component)

    @property
    def platform_spot(self) -> Array:
        """A place near the platform's plate, in U (3,) [m]."""
        return self.table.geometry.platform.centre + self.rng.uniform(-0.015, 0.015, 3)

    def direction(self) -> Array:
        """Return a random unit vector (3,)."""
        return unit(self.rng.normal(size=3))

    def twist(self) -> Array:
        """Return a random small twist (6,) of the drawn magnitude: a shift and a turn as large."""
        return self.magnitude * np.concatenate([self.direction(), self.direction() / LEVER])


@dataclass(frozen=True)
class Entry:
    """One effect; it decorates the function that draws its law, which gives it its name."""

    components: tuple[str, ...]  # places
    unit: str  # of the magnitude
    plausible: float  # magnitude that an ordinary wrist may have
    largest: float  # magnitude beyond which no wrist still works
    limit: float  # largest magnitude that can be simulated
    forms: tuple[str, ...] = ("plain",)  # functional forms of the law
    make: Callable[[Draw], Law] = lambda draw: Law()  # law of a draw

    def __call__(self, make: Callable[[Draw], Law]) -> Entry:
        """Return the effect with its law."""
        return replace(self, make=make)
