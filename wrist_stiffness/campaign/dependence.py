"""On which conditions a residual depends, how strongly, and whether chance gives as much.

Every condition is a few columns over the units.  The residual's blocks of neighbouring units are
turned in sign at random, so what wanders slowly stays as it is, and the largest statistic over all
conditions is kept: many questions pay for their number (Westfall and Young 1993; wild cluster
bootstrap, Cameron, Gelbach and Miller 2008).  A condition enters after the other, the strongest
first, and the rest is asked again beyond those that are in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.observations import Labels
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array

CHANCE = 0.01
"""Probability with which noise may let any condition in."""

REPEATS = 999
MOST = 8
"""No more than so many conditions are told."""

ALIKE = 0.15
"""A condition of which those before it leave less than this share of the square tells little new,
and that uncertainly."""


@dataclass(frozen=True, eq=False)
class Dependence:
    """What one condition does to the residual, beside the other conditions that entered.

    Parameters
    ----------
    which : int
        Place of the condition in the list that was asked.
    slope : (q, m) float
        Change of the m components per unit of each of the condition's q columns.
    covariance : (q m, q m) float
        Of the slope, by its rows.
    p_value : float
        Chance that the largest of all conditions looks as strong without any dependence.
    fall : float
        Weighted square that the condition takes away from the residual as it enters.
    """

    which: int
    slope: Array
    covariance: Array
    p_value: float
    fall: float


@dataclass(frozen=True)
class Dependences:
    """Answer to the question on what a residual depends.

    Parameters
    ----------
    entered : tuple of Dependence
        Strongest first.
    p_values : (k,) float
        Of every condition as first asked, before any entered; NaN where it does not vary.
    """

    entered: tuple[Dependence, ...]
    p_values: Array


def dependences(
    residual: Array,
    weights: Array,
    base: Array,
    conditions: Sequence[Array],
    blocks: Labels,
    rng: np.random.Generator,
) -> Dependences:
    """Find the conditions on which a residual depends.

    Parameters
    ----------
    residual : (n, m) float
        One row per unit; NaN = not measured.
    weights : (n, m) float
        Inverse variances.
    base : (n, p) float
        Columns that are nobody's finding: a constant in each session, a slow wander.
    conditions : sequence of (n, q) float
        Each condition's columns.
    blocks : (n,) int
        Neighbouring units that belong together, from 0.
    rng : numpy.random.Generator
        Turns the signs.

    Returns
    -------
    Dependences
        Those that entered, and every condition's chance.

    Raises
    ------
    InputError
        If the columns do not belong to the units.
    """
    n = len(residual)
    if any(len(columns) != n for columns in conditions) or len(blocks) != n:
        raise InputError(f"conditions or blocks do not belong to {n} units")
    owner = np.repeat(np.arange(len(conditions)), [c.shape[1] for c in conditions])
    every = np.hstack([np.empty((n, 0)), *conditions])
    scale = np.sqrt(np.mean((every - every.mean(axis=0)) ** 2, axis=0))
    every = every / np.where(scale > 0.0, scale, 1.0)
    signs = np.ones((REPEATS + 1, int(blocks.max()) + 1))
    signs[1:] = rng.choice([-1.0, 1.0], (REPEATS, signs.shape[1]))
    weighted = _Weighted(residual, weights, base, every, blocks)
    chosen: list[int] = []
    p_entry: list[float] = []
    falls: list[float] = []
    first = np.full(len(conditions), np.nan)
    while len(chosen) < min(MOST, len(conditions)):
        inside = _columns_of(chosen, owner)
        gains = weighted.gains(inside, owner, signs)
        p_values = _corrected(gains)
        if not chosen:
            first = p_values
        sure = np.flatnonzero(p_values <= CHANCE)
        if len(sure) == 0:
            break
        beyond_chance = gains[0, sure] - gains[1:, sure].mean(axis=0)
        best = int(sure[np.argmax(beyond_chance)])
        chosen.append(best)
        p_entry.append(float(p_values[best]))
        falls.append(float(gains[0, best]))
    columns = _columns_of(chosen, owner)
    slopes, covariance = weighted.fit(columns)
    slopes = slopes / scale[columns][:, None]
    spread = np.repeat(scale[columns], residual.shape[1])
    covariance = covariance / np.outer(spread, spread)
    entered = []
    for place, which in enumerate(chosen):
        own = np.flatnonzero(owner[columns] == which)
        flat = (own[:, None] * residual.shape[1] + np.arange(residual.shape[1])).ravel()
        entered.append(
            Dependence(
                which, slopes[own], covariance[np.ix_(flat, flat)], p_entry[place], falls[place]
            )
        )
    return Dependences(tuple(entered), first)


def _columns_of(chosen: list[int], owner: Labels) -> list[int]:
    """Places of the columns of these conditions, in their order."""
    return [column for which in chosen for column in np.flatnonzero(owner == which).tolist()]


def _corrected(gains: Array) -> Array:
    """Return p-values corrected for the number of conditions, (k,); NaN for no condition at all.

    Parameters
    ----------
    gains : (repeats + 1, k) float
        Squares explained; the first row with the signs as they are.
    """
    alive = np.isfinite(gains[0])
    p_values = np.full(gains.shape[1], np.nan)
    if alive.any():
        # In units of what chance explains, so that wide and narrow conditions compete fairly.
        chance = gains[1:, alive].mean(axis=0)
        relative = gains[:, alive] / np.where(chance > 0.0, chance, np.inf)
        largest = relative[1:].max(axis=1)
        beaten = np.count_nonzero(largest[:, None] >= relative[0] * (1.0 - 1e-12), axis=0)
        p_values[alive] = (1.0 + beaten) / (1.0 + len(largest))
    return p_values


class _Weighted:
    """Weighted least squares of every component on columns beyond the base.

    Parameters
    ----------
    residual, weights, base, blocks
        As for `dependences`.
    every : (n, k) float
        All columns of all conditions.
    """

    def __init__(
        self, residual: Array, weights: Array, base: Array, every: Array, blocks: Labels
    ) -> None:
        self._blocks = blocks
        self._n_blocks = int(blocks.max()) + 1
        self._columns, self._values, self._size = [], [], []
        for component in range(residual.shape[1]):
            known = np.isfinite(residual[:, component])
            root = np.sqrt(np.where(known, weights[:, component], 0.0))[:, None]
            flat = np.where(known, residual[:, component], 0.0)[:, None]
            stacked = root * np.hstack([every, flat])
            whole = np.linalg.norm(stacked[:, :-1], axis=0)
            stacked = _beyond(_basis(root * base), stacked)
            self._columns.append(stacked[:, :-1])
            self._values.append(stacked[:, -1])
            self._size.append(whole**2)

    def gains(self, inside: list[int], owner: Labels, signs: Array) -> Array:
        """Return what each condition explains beyond the columns inside, (repeats + 1, k).

        NaN where nothing of the condition is left.
        """
        n_conditions = int(owner.max(initial=-1)) + 1
        total, alive = np.zeros((len(signs), n_conditions)), np.ones(n_conditions, dtype=bool)
        seen = np.zeros(n_conditions, dtype=bool)
        for columns, values, size in zip(self._columns, self._values, self._size, strict=True):
            taken = _basis(columns[:, inside])
            beyond, left = _beyond(taken, columns), _beyond(taken, values)
            moved = signs @ self._per_block(beyond * left[:, None])
            for which in range(n_conditions):
                own = np.flatnonzero(owner == which)
                if not size[own].any():
                    continue  # this component was never measured
                gram = beyond[:, own].T @ beyond[:, own]
                alive[which] &= bool((np.diagonal(gram) > ALIKE * size[own]).all())
                seen[which] = True
                total[:, which] += np.sum(moved[:, own] * (moved[:, own] @ _inverse(gram)), axis=1)
        total[:, ~(alive & seen)] = np.nan
        return total

    def fit(self, inside: list[int]) -> tuple[Array, Array]:
        """Return slopes (k, m) of these columns together and their covariance (k m, k m).

        The covariance is that of clustered errors: whatever happens inside a block may be coupled.
        """
        m = len(self._values)
        slopes = np.zeros((len(inside), m))
        moves = np.zeros((self._n_blocks, len(inside), m))
        for component, (columns, values) in enumerate(
            zip(self._columns, self._values, strict=True)
        ):
            own = columns[:, inside]
            inverse = _inverse(own.T @ own)
            slopes[:, component] = inverse @ (own.T @ values)
            left = values - own @ slopes[:, component]
            moves[:, :, component] = self._per_block(own * left[:, None]) @ inverse
        flat = moves.reshape(self._n_blocks, -1)
        # As many blocks are used up as there are columns.
        factor = self._n_blocks / max(1, self._n_blocks - len(inside) - 1)
        return slopes, factor * flat.T @ flat

    def _per_block(self, rows: Array) -> Array:
        """Sum rows (n, k) over the blocks, (b, k)."""
        out = np.zeros((self._n_blocks, rows.shape[1]))
        np.add.at(out, self._blocks, rows)
        return out


def _inverse(gram: Array) -> Array:
    return np.asarray(np.linalg.pinv(gram, rcond=1e-10, hermitian=True), dtype=np.float64)


def _basis(columns: Array) -> Array:
    """Orthonormal basis of columns (n, k), blind to their scales."""
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0.0] / norm[norm > 0.0]
    if columns.shape[1] == 0:
        return np.empty((len(columns), 0))
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * size[0]])


def _beyond(basis: Array, columns: Array) -> Array:
    beyond: Array = columns - basis @ (basis.T @ columns)
    return beyond
