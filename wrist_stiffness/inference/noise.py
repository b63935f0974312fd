"""The scatter of a table: from what was repeated, or from what everything together leaves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtr

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.projection import (
    ABSORBED,
    SQUARED_ROUNDING,
    leading_directions,
    orthonormal,
)

KNOWN, UNKNOWN = 0.2, 3.0
"""Standard deviation of the logarithm of the noise's variance where a table, an instrument or
repeats tell it, and where nothing does (assumed)."""

FEWEST_REPEATS = 6
"""Degrees of freedom from which repeated conditions tell the noise."""

POOLED = 10.0
"""Degrees of freedom that the mean over the components of a quantity counts for in each of them."""

BY_CHANCE = 1e-3
"""Probability of a scatter that small beside a known one, below which that one is not there
(assumed)."""

LEAST_OWN = 0.01
"""Share of a unit's scatter that is its own at least, whatever it shares with others (assumed)."""

RICH_SHARE = 0.3
"""The rich model may use up at most this share of the numbers."""


def at_most(known: bool) -> str:
    """Return what stands before the size of a noise: play and friction pass for an unknown one."""
    return "" if known else " at most"


def replicate_variance(
    values: Array, columns: Array, observations: Observations
) -> tuple[Array, float]:
    """Pooled variance inside the groups of replicates.

    What a candidate does between two replicates (drift, warming) is taken out; what it does
    between conditions cannot reach the differences inside a group.  Nothing is weighted: a
    large value common to a group would not cancel under weights that differ.

    `values` (n, m): observations, zero where not measured; `columns` (n, m, q): base and
    candidates, zero where not measured; `observations`: with `replicate` labels; groups never span
    sessions.
    Returns (m,) variance of one unit; one for a component that was never measured, and fewest
    degrees of freedom over the components; zero without replicates.
    """
    m = observations.n_components
    if observations.replicate is None or not (observations.replicate >= 0).any():
        return np.ones(m), 0.0
    labels = np.stack([observations.replicate, observations.sessions], axis=1)
    repeated = labels[:, 0] >= 0
    _, group = np.unique(labels[repeated], axis=0, return_inverse=True)
    measured = observations.measured[repeated]
    count = np.zeros((group.max() + 1, m))
    np.add.at(count, group, measured)
    stacked = np.concatenate([columns, values[:, :, None]], axis=2)[repeated]
    total = np.zeros((group.max() + 1, *stacked.shape[1:]))
    np.add.at(total, group, stacked)
    centre = total / np.maximum(count, 1)[:, :, None]
    inside = np.where(measured[:, :, None], stacked - centre[group], 0.0)
    # Metres and radians: what a column can take out is judged in scatters of each component.
    size = np.sqrt(np.mean(inside[:, :, -1] ** 2, axis=0))
    size = np.where(size > 0, size, 1.0)
    inside, stacked = inside / size[:, None], stacked / size[:, None]
    freedom = np.maximum(count - 1, 0).sum(axis=0)

    rows = inside.reshape(-1, stacked.shape[2])
    whole = np.linalg.norm(stacked.reshape(rows.shape)[:, :-1], axis=0)
    # Each counts by what of it differs inside: a load never repeats exactly, and hundreds of
    # columns of its noise would use up the freedom that those of backlash need.
    directions, strength, _ = np.linalg.svd(
        rows[:, :-1] / np.where(whole > 0.0, whole, 1.0), full_matrices=False
    )
    basis = directions[:, strength > ABSORBED][:, : int(RICH_SHARE * freedom.sum())]
    left = rows[:, -1] - basis @ (basis.T @ rows[:, -1])
    seen = observations.measured.any(axis=0)
    freedom = freedom - basis.shape[1] / seen.sum()
    variance = size**2 * np.sum(left.reshape(-1, m) ** 2, axis=0) / np.maximum(freedom, 1)
    return np.where(seen, variance, 1.0), float(freedom[seen].min())


def in_each_component(features: Sequence[Array | None], observations: Observations) -> Array:
    """Return what features (n, k), where there are any, may do to each component, (n, m, q)."""
    found = [np.zeros((observations.n_units, 0)), *(each for each in features if each is not None)]
    unit = np.eye(observations.n_components)[:, None, :]
    spread = np.concatenate(found, axis=1)[:, None, :, None] * unit
    return np.asarray(spread.reshape(*observations.values.shape, -1))


def unstated(
    observations: Observations, base: Array, structure: Array
) -> tuple[Observations, Array, float]:
    """Return the scatter of the units where nothing states it.

    What units of a stand share is not in their differences, and known; unless different stands
    scatter less than it could be by chance.

    `observations`, `base`, `structure`: as for `scatter_of`.
    Returns the units, with what they share if they do, the variance of the rest of one unit (m,),
    and the width of its logarithm.  Raises `InputError` as `scatter_of`.
    """
    variance, repeats = scatter_of(observations, base, structure)
    if observations.shared is not None and observations.stand is not None:
        known = np.mean(np.sum(observations.shared**2, axis=2), axis=0)
        stand = observations.stand
        first = np.isin(np.arange(len(stand)), np.unique(stand, return_index=True)[1])
        apart = (stand < 0) | first
        square, freedom = _left(observations.take(apart), base[apart], structure[apart, :, :0])
        on = known > 0.0
        if chdtr(freedom[on].sum(), np.sum(square[on] / known[on])) < BY_CHANCE:
            observations = replace(observations, shared=None)
        else:
            at_stands = replace(observations, replicate=stand)
            own, repeats = scatter_of(at_stands, base, structure)
            variance = own if repeats else np.maximum(variance - known, LEAST_OWN * variance)
    if not repeats:
        return observations, variance, UNKNOWN
    seen = observations.measured.any(axis=0).sum()
    return observations, variance, max(float(np.sqrt(2.0 / (repeats * seen))), KNOWN)


def scatter_of(observations: Observations, base: Array, structure: Array) -> tuple[Array, float]:
    """Variance of one unit, by repeated conditions or else by what everything together leaves.

    `observations`: values, to be explained; `base` (n, m, p), `structure` (n, m, q): columns of
    what is refitted, and of what else could be behind the values.
    Returns (m,) variance of each component, drawn to the mean of its quantity, and degrees of
    freedom of the repeats in each component, 0 where there are too few.  Raises `InputError` where
    the base alone leaves nothing of so few numbers: what rounding leaves is no scatter.
    """
    measured = observations.measured
    values = np.where(measured, observations.values, 0.0)
    columns = np.where(measured[:, :, None], np.concatenate([base, structure], axis=2), 0.0)
    repeated, freedom = replicate_variance(values, columns, observations)
    if freedom >= FEWEST_REPEATS:
        return _shrunk(repeated, freedom, observations), freedom
    numbers, p = int(measured.sum()), base.shape[2]
    if p >= numbers and orthonormal(columns[:, :, :p][measured]).shape[1] == numbers:
        raise InputError(
            f"{numbers} measured numbers are no more than what is fitted to them: nothing tells "
            "their noise; measure at more poses, or repeat some readings"
        )
    square, left = _left(observations, base, structure)
    return _shrunk(square / left, float(left.mean()), observations), 0.0


def _left(observations: Observations, base: Array, structure: Array) -> tuple[Array, Array]:
    """Sum of squares that everything together leaves of each component, and its freedom, (m,)."""
    measured = observations.measured
    values = np.where(measured, observations.values, 0.0)
    columns = np.where(measured[:, :, None], np.concatenate([base, structure], axis=2), 0.0)
    count = np.maximum(measured.sum(axis=0), 1)
    size = np.sqrt(np.sum(values**2, axis=0) / count)
    size = np.where(size > 0.0, size, 1.0)
    flat, p = (columns / size[:, None]).reshape(measured.size, -1), base.shape[2]
    basis = rich_basis(flat[:, :p], flat[:, p:], int(measured.sum()))
    target = (values / size).ravel()
    left = (target - basis @ (basis.T @ target)).reshape(measured.shape) * size
    # What could explain a component uses up freedom of that one alone.
    used = np.sum(basis**2, axis=1).reshape(measured.shape)
    freedom = np.maximum(np.sum((1.0 - used) * measured, axis=0), count / measured.sum())
    square = np.sum(left**2 * measured, axis=0)
    return np.where(square > 0.0, square, freedom * (1e-9 * size) ** 2), freedom


def _shrunk(variance: Array, freedom: float, observations: Observations) -> Array:
    found = variance.copy()
    for quantity in observations.reported:
        at = [c for c in quantity.components if observations.measured[:, c].any()]
        mean = float(np.mean(variance[at]))
        found[at] = (freedom * variance[at] + POOLED * mean) / (freedom + POOLED)
    return found


def rich_basis(
    base: Array,
    structure: Array,
    n_measured: int,
    share: float = RICH_SHARE,
    least: float = SQUARED_ROUNDING,
) -> Array:
    """Orthonormal basis of everything that could be structure, leading directions first.

    All of the base is in it: registrations and tolerances are far above the scatter, so that what
    a rough basis leaves of them would pass for it.

    `base` (N, p): weighted nuisance columns; `structure` (N, q): weighted columns of all
    candidates; `n_measured`: measured numbers; `share`: of them, that directions use up at most;
    `least`: as for `leading_directions`.
    """
    first = orthonormal(base)
    beyond = structure - first @ (first.T @ structure)
    seen = np.linalg.norm(beyond, axis=0) > ABSORBED * np.linalg.norm(structure, axis=0)
    most = max(int(share * n_measured) - first.shape[1], 0)
    return np.hstack([first, leading_directions(beyond[:, seen], most, least)])
