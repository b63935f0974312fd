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

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.observations import Labels
from wrist_stiffness.mechanism.components import Array

CHANCE = 0.01
"""Probability with which noise may let any condition in."""

REPEATS = 999
MOST = 8
"""No more than so many conditions are told."""

ALIKE = 0.15
"""A condition of which those before it leave less than this share of the square tells little new,
and that uncertainly."""


ROUNDING = 1e-12
"""A column of which the base leaves less of the square lies inside the base."""


DEPENDENT = 1e-10
"""Share of the largest eigenvalue below which columns of a base depend on each other."""


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
        Square, in variances of the noise, that the condition takes away from the residual as it
        enters.
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
        Of every condition as last asked, beside those that had entered; NaN where it does not vary.
    """

    entered: tuple[Dependence, ...]
    p_values: Array


def dependences(
    residual: Array,
    variance: Array,
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
    variance : (n, m) float
        Of the noise.
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
    n, m = residual.shape
    if any(len(columns) != n for columns in conditions) or len(blocks) != n:
        raise InputError(f"conditions or blocks do not belong to {n} units")
    owner = np.repeat(np.arange(len(conditions)), [c.shape[1] for c in conditions])
    every, scale = _scaled(np.hstack([np.empty((n, 0)), *conditions]))
    signs = np.ones((REPEATS + 1, int(blocks.max()) + 1))
    signs[1:] = rng.choice([-1.0, 1.0], (REPEATS, signs.shape[1]))
    free = np.sum(beyond(base, every) ** 2, axis=0)
    free[free < ROUNDING * np.sum(every**2, axis=0)] = 0.0
    chosen: list[int] = []
    p_entry: list[float] = []
    falls: list[float] = []
    chances = np.full(len(conditions), np.nan)
    taken = base
    energy = noise_energy(residual, variance, taken)
    while len(chosen) < min(MOST, len(conditions)):
        new = (free > 0.0) & (np.sum(beyond(taken, every) ** 2, axis=0) > ALIKE * free)
        asked = np.array([new[owner == which].all() for which in range(len(conditions))])
        fit = _Weighted(residual, variance, taken, every, blocks)
        p_values, gains = np.full(len(conditions), np.nan), fit.gains(owner, signs)
        p_values[asked], beyond_chance = _corrected(gains[:, asked])
        chances[asked] = p_values[asked]
        sure = p_values[asked] <= CHANCE
        if not sure.any():
            break
        best = int(np.flatnonzero(asked)[np.argmax(np.where(sure, beyond_chance, -np.inf))])
        chosen.append(best)
        p_entry.append(float(p_values[best]))
        taken = np.hstack([taken, every[:, owner == best]])
        before, energy = energy, noise_energy(residual, variance, taken)
        falls.append(before - energy)
    columns = np.concatenate([np.flatnonzero(owner == which) for which in (*chosen, -1)])
    fit = _Weighted(residual, variance, base, every[:, columns], blocks, taken)
    slopes, covariance = fit.slopes()
    slopes = slopes / scale[columns][:, None]
    spread = np.repeat(scale[columns], m)
    covariance = covariance / np.outer(spread, spread)
    entered = []
    for place, which in enumerate(chosen):
        own = np.flatnonzero(owner[columns] == which)
        flat = (own[:, None] * m + np.arange(m)).ravel()
        own_covariance = covariance[np.ix_(flat, flat)]
        entered.append(Dependence(which, slopes[own], own_covariance, p_entry[place], falls[place]))
    return Dependences(tuple(entered), chances)


def noise_energy(residual: Array, variance: Array, base: Array) -> float:
    """Square of what a base leaves of the measured components, in variances of the noise."""
    known = np.isfinite(residual)
    left = np.where(known, beyond(base, np.nan_to_num(residual)), 0.0)
    return float(np.sum(left**2 / variance))


def _scaled(columns: Array) -> tuple[Array, Array]:
    """Columns of unit deviation, and their deviations; a constant column stays."""
    scale = np.sqrt(np.mean((columns - columns.mean(axis=0)) ** 2, axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    return columns / scale, scale


def _corrected(gains: Array) -> tuple[Array, Array]:
    """Return p-values corrected for the number of conditions, and the gains beyond chance, (k,).

    Parameters
    ----------
    gains : (repeats + 1, k) float
        Squares explained; the first row with the signs as they are.
    """
    if gains.shape[1] == 0:
        return np.empty(0), np.empty(0)
    # In units of what chance explains, so that wide and narrow conditions compete fairly.
    chance = gains[1:].mean(axis=0)
    relative = gains / np.where(chance > 0.0, chance, np.inf)
    largest = relative[1:].max(axis=1)
    beaten = np.count_nonzero(largest[:, None] >= relative[0] * (1.0 - 1e-12), axis=0)
    return (1.0 + beaten) / (1.0 + len(largest)), gains[0] - chance


class _Weighted:
    """Weighted least squares of every component on columns beyond a base.

    Parameters
    ----------
    residual, variance, base, blocks
        As for `dependences`.
    every : (n, k) float
        Columns that are asked.
    known : (n, p) float, optional
        What the residual is known to depend on; by default the base.  What it leaves beyond the
        noise counts as noise.
    """

    def __init__(
        self,
        residual: Array,
        variance: Array,
        base: Array,
        every: Array,
        blocks: Labels,
        known: Array | None = None,
    ) -> None:
        self._blocks = blocks
        self._n_blocks = int(blocks.max()) + 1
        self._columns, self._values = [], []
        measured = np.isfinite(residual)
        values = np.where(measured, residual, 0.0)
        left = np.where(measured, beyond(base if known is None else known, values), 0.0)
        excess = np.sum(left**2 - variance * measured, axis=0) / np.maximum(measured.sum(axis=0), 1)
        root = np.where(measured, 1.0 / np.sqrt(variance + np.maximum(excess, 0.0)), 0.0)
        for component in range(residual.shape[1]):
            own = root[:, component, None]
            stacked = own * np.hstack([every, values[:, component, None]])
            stacked = beyond(own * base, stacked)
            self._columns.append(stacked[:, :-1])
            self._values.append(stacked[:, -1])

    def gains(self, owner: Labels, signs: Array) -> Array:
        """Return what each condition explains, (repeats + 1, k)."""
        total = np.zeros((len(signs), int(owner.max(initial=-1)) + 1))
        for columns, values in zip(self._columns, self._values, strict=True):
            moved = signs @ self._per_block(columns * values[:, None])
            for which in range(total.shape[1]):
                own = np.flatnonzero(owner == which)
                inverse = _inverse(columns[:, own].T @ columns[:, own])
                total[:, which] += np.sum(moved[:, own] * (moved[:, own] @ inverse), axis=1)
        return total

    def slopes(self) -> tuple[Array, Array]:
        """Return slopes (k, m) of all columns together and their covariance (k m, k m).

        The covariance is that of clustered errors: whatever happens inside a block may be coupled.
        """
        k, m = self._columns[0].shape[1], len(self._values)
        slopes, moves = np.zeros((k, m)), np.zeros((self._n_blocks, k, m))
        for component, (own, values) in enumerate(zip(self._columns, self._values, strict=True)):
            inverse = _inverse(own.T @ own)
            slopes[:, component] = inverse @ (own.T @ values)
            left = values - own @ slopes[:, component]
            moves[:, :, component] = self._per_block(own * left[:, None]) @ inverse
        flat = moves.reshape(self._n_blocks, -1)
        # As many blocks are used up as there are columns.
        factor = self._n_blocks / max(1, self._n_blocks - k - 1)
        return slopes, factor * flat.T @ flat

    def _per_block(self, rows: Array) -> Array:
        """Sum rows (n, k) over the blocks, (b, k)."""
        out = np.zeros((self._n_blocks, rows.shape[1]))
        np.add.at(out, self._blocks, rows)
        return out


def _inverse(gram: Array) -> Array:
    if gram.shape[0] == 0:
        return gram
    return np.asarray(np.linalg.pinv(gram, rcond=1e-10, hermitian=True), dtype=np.float64)


def beyond(base: Array, columns: Array) -> Array:
    """Columns (n, k) without their part along a base (n, p), whatever the scales of the base."""
    norm = np.linalg.norm(base, axis=0)
    base = base[:, norm > 0.0] / norm[norm > 0.0]
    if base.shape[1] == 0:
        return columns
    # By the Gram matrix: a tenth of the time of a decomposition of the tall base.
    size, vectors = np.linalg.eigh(base.T @ base)
    kept = size > DEPENDENT * size[-1]
    basis = base @ (vectors[:, kept] / np.sqrt(size[kept]))
    left = columns - basis @ (basis.T @ columns)
    # Once more, against rounding.
    return np.asarray(left - basis @ (basis.T @ left))
