"""Where a search stands: a fitted base, what was fitted along with it, the catalogue about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wrist_stiffness.campaign.searching.base_fit import LOOSE, BaseFit
from wrist_stiffness.campaign.searching.candidates import Point, WristCandidate
from wrist_stiffness.campaign.searching.screening import Screen
from wrist_stiffness.model.effect import Effect

Candidates = tuple[WristCandidate, ...]

WORTH = 30.0
"""Fall of the sum of squares, in units of the noise and beyond the price of the freedom, that is
worth moving the point for."""

EXACT = 0.1
"""Share of its size within which a law is taken to be exact here: a gain that what is left of a
large effect within this share could make draws no further effect in."""

INEXACT = 1.5
"""Variance of what is left, in units of the noise, from which a law is not taken as exact."""

ROUGH = 10.0
"""Variance of what is left, in units of the noise, from which a fit is also begun from the drawing:
a base that gave way to a large effect does not find back."""


ASTRAY = 4.0
"""Variance of what is left, in units of the noise, from which what is missing is sought from afar:
inexact laws of what was found leave less."""


@dataclass(frozen=True, eq=False)
class Place:
    """A base and the catalogue about it, for the statistics.

    Parameters
    ----------
    base : BaseFit
        Fitted.
    candidates : tuple of WristCandidate
        The catalogue.
    fits : dict of str to BaseFit
        Where candidates stand for whole fits: these, by name.
    known : bool
        Whether what is fitted along with the base is known, and asked is what there is beside it.
    """

    base: BaseFit
    candidates: Candidates
    fits: Mapping[str, BaseFit] = field(default_factory=dict)
    known: bool = False


@dataclass(frozen=True, eq=False)
class Reached:
    """Where the search has arrived.

    Parameters
    ----------
    base : BaseFit
        Fitted along with the effects found.
    prices : dict of str to float
        What the freedom of each of them costs, by its name.
    first : float
        Sum of squares that the base alone left.
    steps : tuple of BaseFit
        Fits on the way, before each effect that was added.
    """

    base: BaseFit
    prices: Mapping[str, float]
    first: float
    steps: tuple[BaseFit, ...] = ()

    @property
    def least(self) -> float:
        """What a further effect must explain beyond its price: more than inexact laws leave."""
        return max(WORTH, EXACT**2 * (self.first - self.base.cost))

    @property
    def total(self) -> float:
        """Sum of squares and what all effects must be worth; every step of the search lowers it."""
        return self.base.cost + sum(WORTH + price for price in self.prices.values())

    @property
    def rough(self) -> bool:
        """Whether so much is left that a fit is begun from the drawing as well."""
        return self.base.cost > ROUGH * float(self.base.problem.table.measured.sum())

    @property
    def astray(self) -> bool:
        """Whether so much is left that what is missing is sought from afar."""
        return self.base.cost > ASTRAY * float(self.base.problem.table.measured.sum())

    @property
    def loose(self) -> bool:
        """Whether a pin has play in it."""
        return any(each.law.id in LOOSE for each in self.effects.values())

    @property
    def gave_way(self) -> bool:
        """Whether the base went far to explain what it leaves all the same."""
        return self.base.strained and self.base.variance > INEXACT and not self.rough

    @property
    def effects(self) -> dict[str, Effect]:
        """Effects found, at their values; on top of what the base has of them."""
        return self.base.beyond()

    def screen(self, without: str | None = None) -> Screen:
        """Return what it leaves, without one of the effects if asked so."""
        return Screen(self.base, point_of(self.base), without)


def point_of(base: BaseFit, with_extras: bool = False) -> Point:
    """Return the fitted base, as a rule without the effects fitted along."""
    sessions = base.problem.sessions
    used = tuple(each.measured for each in sessions)
    return Point(tuple(base.model(n, with_extras) for n in range(len(sessions))), used)
