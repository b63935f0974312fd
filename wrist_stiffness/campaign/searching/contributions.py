"""How much each part of a fitted wrist adds to its error: findings, suspects and tolerances.

A finding is proven one by one.  A wrist that has a little of everything has many effects of which
none can be, and still somebody must know where to look first: so everything that the fit has in it
is ranked by what it adds beyond what a new set-up would take up.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.mechanism.components import Array

MOST_POSSIBLE = 5
"""So many of what is possible are worth a look."""


@dataclass(frozen=True)
class Contribution:
    """What one effect adds to the error.

    Parameters
    ----------
    effect, component : str
        Which.
    kind : str
        `finding` is proven; `suspect` explains more than its freedom costs but is not proven;
        `tolerance` lies within what wrists differ by; `possible` is the likeliest share of an
        effect in what nothing else explains.
    sizes : dict of str to (float, float)
        Root mean square over the units of what it adds, beyond what registrations, zeros and tare
        would take up, and its standard uncertainty, by the key of the quantity.
    signal : float
        Its length in standard deviations of the noise; by this they are ordered.
    """

    effect: str
    component: str
    kind: str
    sizes: dict[str, tuple[float, float]]
    signal: float

    @property
    def name(self) -> str:
        """`effect@component`."""
        return f"{self.effect}@{self.component}"


def contributions(fitted: BaseFit, named: Collection[str]) -> tuple[Contribution, ...]:
    """Rank what a fitted wrist consists of, largest first.

    Parameters
    ----------
    fitted : BaseFit
        The base along with everything that was found or is suspected.
    named : collection of str
        Names of the findings.

    Returns
    -------
    tuple of Contribution
        Of every effect that is the wrist's own, not the set-up's.
    """
    whole = Decomposed(fitted)
    found = []
    for name in dict.fromkeys(whole.names):
        kind = "tolerance"
        if name in fitted.extras:
            kind = "finding" if name in named else "suspect"
        if places := whole.places(name):
            spread = whole.beyond(fitted.columns[:, :, places]) @ root_of(whole.covariance(places))
            found.append(contribution(fitted, name, kind, whole.beyond(whole.change(name)), spread))
    return ranked(found)


def ranked(found: Iterable[Contribution]) -> tuple[Contribution, ...]:
    """Return contributions, the largest first."""
    return tuple(sorted(found, key=lambda each: -each.signal))


def worth_hearing(
    parts: Sequence[Contribution], something_left: bool, left: Mapping[str, float]
) -> list[Contribution]:
    """Return what people should hear of: findings and suspects, and what else is likeliest.

    Nothing where findings say it all.  A guess that is larger than all that is left could only be
    true beside another that cancels it.

    Parameters
    ----------
    parts : sequence of Contribution
        Largest first.
    something_left : bool
        Whether something is left that no finding explains.
    left : dict of str to float
        Error that is left, by the key of the quantity.
    """
    kinds = ("finding", "suspect", "possible") if something_left else ("finding", "suspect")
    heard = [each for each in parts if each.kind in kinds]
    likeliest = [
        each
        for each in heard
        if each.kind == "possible" and all(size <= left[q] for q, (size, _) in each.sizes.items())
    ][:MOST_POSSIBLE]
    heard = [each for each in heard if each.kind != "possible" or each in likeliest]
    return [] if all(each.kind == "finding" for each in heard) else heard


def contribution(
    fitted: BaseFit, name: str, kind: str, change: Array, spread: Array
) -> Contribution:
    """Return what an effect adds.

    Parameters
    ----------
    fitted : BaseFit
        Knows the noise.
    name, kind : str
        Which effect, and how sure.
    change : (u, 6) float
        What it adds most likely, beyond the set-up [m, rad].
    spread : (u, 6, k) float
        The same by a standard deviation along each of k independent directions.
    """
    effect, component = name.split("@")
    sizes = {}
    for quantity in QUANTITIES:
        own = list(quantity.components)
        size = np.sqrt(np.mean(np.sum(change[:, own] ** 2, axis=1)))
        error = np.sqrt(np.mean(np.sum(spread[:, own] ** 2, axis=(1, 2))))
        sizes[quantity.key] = float(size) * quantity.per_si, float(error) * quantity.per_si
    signal = float(np.linalg.norm(fitted.whiten(change)))
    return Contribution(effect, component, kind, sizes, signal)


class Decomposed:
    """A fitted wrist, taken apart.

    Parameters
    ----------
    fitted : BaseFit
        With all effects.
    """

    def __init__(self, fitted: BaseFit) -> None:
        self._fitted = fitted
        unknowns = fitted.problem.unknowns
        self.names = [fitted.problem.free[u.free].effect.name for u in unknowns]
        self._set_up = np.array([unknown.session is not None for unknown in unknowns])
        columns = fitted.columns[:, :, self._set_up]
        white = fitted.whiten(columns)
        size = np.maximum(np.linalg.norm(white, axis=0), 1e-300)
        self._columns = columns / size
        self._inverse = np.linalg.pinv(white / size, rcond=1e-9)

    def places(self, name: str) -> list[int]:
        """Return the unknowns of an effect of the wrist."""
        return [n for n, own in enumerate(self.names) if own == name and not self._set_up[n]]

    def change(self, name: str) -> Array:
        """Return what an effect adds to the prediction, (u, 6): left out for one fitted along."""
        fitted, places = self._fitted, self.places(name)
        if name not in fitted.extras:
            return -fitted.columns[:, :, places] @ fitted.z[places]
        blocks = []
        for number in range(len(fitted.problem.sessions)):
            model = fitted.model(number)
            others = tuple(each for each in model.effects if each.name != name)
            whole, less = model.along([model.effects, others])
            blocks.append(whole - less)
        return np.nan_to_num(fitted.problem.rows(blocks))

    def beyond(self, change: Array) -> Array:
        """Return a change (u, 6) or (u, 6, k) less what a new set-up would take up of it."""
        taken = self._inverse @ self._fitted.whiten(change)
        return change - self._columns @ taken

    def covariance(self, places: list[int]) -> Array:
        """Return the covariance of unknowns in steps, (k, k)."""
        return self._covariance[np.ix_(places, places)]

    @cached_property
    def _covariance(self) -> Array:
        return self._fitted.covariance()


def root_of(covariance: Array) -> Array:
    """Return a root of a covariance that may be singular, (k, k): its columns are independent."""
    variances, directions = np.linalg.eigh(covariance)
    return np.asarray(directions * np.sqrt(np.maximum(variances, 0.0)))
