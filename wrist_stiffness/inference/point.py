"""What an evidence is of: a fit of effects, and all that has no name beside it; whitened."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.inference.giving import Give
from wrist_stiffness.inference.noise import UNKNOWN
from wrist_stiffness.inference.possible import Possible

Array = NDArray[np.float64]

EXPECTED = 0.5
"""Effects of the catalogue that are missing in a model, on average, wherever they are (assumed):
their number is Poisson's, so that so many more are missing beside one that was found."""

OUTSIDE = 0.2
"""Prior probability that a model is wrong in a way that no effect of the catalogue is (assumed),
spread evenly over the groups of the discrepancy."""


@dataclass(frozen=True, eq=False)
class Group:
    """Columns of one kind that have no name, with one amplitude."""

    name: str  # what they depend on
    quantity: str  # name of the quantity that they change
    columns: Array  # (N, k), whitened, for an amplitude of 1
    # amplitude that is expected, of an instrument's drift; 0 for a discrepancy, which may be absent
    expected: float = 0.0
    # standard deviation of the logarithm of the amplitude about the expected one
    width: float = 1.0
    # (u, k / c), the same of each unit, before it changed the c components of the quantity
    features: Array = field(default_factory=lambda: np.zeros((0, 0)))
    # (m,), what that is of each component; 0 for those of other quantities
    size: Array = field(default_factory=lambda: np.zeros(0))

    def change(self, values: Array) -> Array:
        """Return what values (k,) of the columns change, (u, m)."""
        at = np.flatnonzero(self.size)
        out = np.zeros((len(self.features), len(self.size)))
        out[:, at] = self.features @ values.reshape(-1, len(at)) * self.size[at]
        return out


@dataclass(frozen=True, eq=False)
class Background:
    """All groups of a table, put together once for all sets of effects."""

    groups: tuple[Group, ...]  # None where nothing but the noise is without a name
    # standard deviation of the logarithm of the noise's variance about the known one
    noise_width: float
    # groups of the discrepancy that might have been there; 0 for those that are listed
    asked: int = 0
    whole: Background | None = None  # of which it is a part
    numbers: tuple[int, ...] = ()  # places of its groups there
    _parts: dict[tuple[int, ...], Background] = field(default_factory=dict, init=False, repr=False)

    @property
    def noise_known(self) -> bool:
        """Whether anything tells the noise; else all that nothing smooth explains counts as it."""
        return self.noise_width < UNKNOWN

    def part(self, numbers: Iterable[int]) -> Background:
        """Return some of the groups, by their places; what is known of all serves them too."""
        key = tuple(sorted(numbers))
        if key not in self._parts:
            groups = tuple(self.groups[number] for number in key)
            asked = self.asked or int(np.count_nonzero(self.optional))
            self._parts[key] = Background(groups, self.noise_width, asked, self, key)
        return self._parts[key]

    @property
    def always(self) -> frozenset[int]:
        """Places of the groups that are always there: the drift."""
        return frozenset(np.flatnonzero(~self.optional).tolist())

    @cached_property
    def _all(self) -> Array:
        return np.concatenate([each.columns for each in self.groups], axis=1)

    @property
    def columns(self) -> Array:
        """Columns of all groups, (N, q); those of a part are copied each time."""
        return self._all if self.whole is None else self.whole.columns[:, self.places]

    def products(self, columns: Array) -> Array:
        """Return the products of all columns with further ones (N, k), (q, k), or with one (N,)."""
        if not self.groups:
            return np.zeros((0, *columns.shape[1:]))
        if self.whole is None:
            return np.asarray(self._all.T @ columns)
        return self.whole.products(columns)[self.places]

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """Places of the columns of a part in those of the whole, (q,)."""
        if self.whole is None:
            return np.arange(int(self.sizes.sum()))
        return np.flatnonzero(np.isin(self.whole.group, self.numbers))

    @cached_property
    def group(self) -> NDArray[np.intp]:
        """Number of the group of each column, (q,)."""
        return np.repeat(np.arange(len(self.groups)), self.sizes)

    @cached_property
    def sizes(self) -> NDArray[np.intp]:
        """Columns in each group, (g,)."""
        return np.array([each.columns.shape[1] for each in self.groups], dtype=np.intp)

    @cached_property
    def optional(self) -> NDArray[np.bool_]:
        """Which groups belong to the discrepancy of the model, (g,)."""
        return np.array([each.expected == 0.0 for each in self.groups], dtype=bool)

    @cached_property
    def log_odds(self) -> float:
        """Log prior odds of one group of the discrepancy to be there."""
        chance = OUTSIDE / (self.asked or max(int(np.count_nonzero(self.optional)), 1))
        return float(np.log(chance / (1.0 - chance)))

    @cached_property
    def gram(self) -> Array:
        """Products of all columns, (q, q)."""
        if not self.groups:
            return np.zeros((0, 0))
        if self.whole is not None:
            return self.whole.gram[np.ix_(self.places, self.places)]
        return np.asarray(self.columns.T @ self.columns)


@dataclass(frozen=True, eq=False)
class Point:
    """Where a fit of a set of effects ended, and all slopes there; whitened."""

    left: Array  # (N,), what the fit leaves
    columns: Array  # (N, p), change of that by each unknown
    z: Array  # (p,), unknowns, from the means of their priors and in their standard deviations
    # (p,), weights of the Gaussian priors of set-up and tolerances, nearly 0 where there is none
    weight: Array
    effects: Mapping[str, NDArray[np.intp]]  # (k,) each, places of the unknowns of each effect
    # (N, l), what the laws of the effects may leave because no law is exact; first those that give
    inexact: Array
    # (N, l) each, what each effect would add if its size changed with the conditions by its own
    # size
    varied: Mapping[str, Array] = field(default_factory=dict)
    gives: tuple[Give, ...] = ()  # in which ways laws give, a column of `inexact` each
    # whether the slopes hold everywhere: then the unknowns follow the amplitudes
    linear: bool = False
    # numbers that were measured, where the rows only sum them up; 0 where each is a row
    numbers: int = 0
    # (k,) each, places of those that say how large an effect is, where not all do: these have a
    # size in common, of which little is known; the others lie within their typical magnitudes
    sizing: Mapping[str, NDArray[np.intp]] = field(default_factory=dict)
    # what the unknowns of each effect can be; anything where it is not told
    possible: Mapping[str, Possible] = field(default_factory=dict)
    _beside: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def sized(self) -> dict[str, NDArray[np.intp]]:
        """Places of the unknowns that say how large each effect is."""
        return {**self.effects, **self.sizing}

    @property
    def count(self) -> int:
        """How many numbers were measured, N."""
        return self.numbers or len(self.left)

    def moved(self, step: Array) -> Point:
        """Return the point a step (p,) further on, as the slopes tell."""
        found = replace(self, left=self.left + self.columns @ step, z=self.z + step)
        # The columns are the same ones, and so are their products.
        object.__setattr__(found, "_beside", self._beside)
        return found

    def with_effect(
        self,
        name: str,
        left: Array,
        columns: Array,
        z: Array,
        varied: Array,
        inexactness: float,
    ) -> Point:
        """Return the point with one effect more, everything followed to first order.

        `name`: of the effect; `left` (N,): what is left with it, whitened; `columns` (N, k): change
        of that by its unknowns; `z` (k,): these; `varied` (N, l): what it would add if its size
        changed with the conditions by its own size; `inexactness`: share of that by which its law
        may be wrong.
        """
        places = np.arange(len(self.z), len(self.z) + len(z))
        return replace(
            self,
            left=left,
            columns=np.hstack([self.columns, columns]),
            z=np.concatenate([self.z, z]),
            weight=np.concatenate([self.weight, np.ones(len(z))]),
            effects={**self.effects, name: places},
            inexact=np.hstack([self.inexact, inexactness * varied]),
            varied={**self.varied, name: varied},
            linear=True,
        )

    def products(self, ground: Background, columns: Array) -> Array:
        """Return the products of all columns, those of a background last, with further ones.

        `ground`: q columns; `columns` (N, k): the further ones.
        Returns (p + l + q, k) or (p + l + q,).
        """
        own = self.columns.T @ columns, self.inexact.T @ columns
        return np.concatenate([*own, ground.products(columns)])

    def gram(self, ground: Background) -> Array:
        """Return the products of all columns with each other, (p + l + q, p + l + q)."""
        if "own" not in self._beside:
            named = np.concatenate([self.columns, self.inexact], axis=1)
            self._beside["own"] = named.T @ named
        if self._beside.get("ground") is not ground:
            mixed = self.mixed(ground)
            gram = np.block([[self._beside["own"], mixed], [mixed.T, ground.gram]])
            self._beside.update(ground=ground, gram=gram)
        return np.asarray(self._beside["gram"])

    def mixed(self, ground: Background) -> Array:
        """Return the products of the set's columns with those of a background, (p + l, q)."""
        whole = ground.whole or ground
        if self._beside.get("whole") is not whole:
            own = self.columns, self.inexact
            mixed = np.concatenate([whole.products(each).T for each in own])
            self._beside.update(whole=whole, mixed=mixed)
        return np.asarray(self._beside["mixed"][:, ground.places])
