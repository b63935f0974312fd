"""Units that no model explains: lost beams and dropouts, found before anything is fitted."""

import numpy as np

from wrist_stiffness.inference.noise import rich_basis
from wrist_stiffness.inference.observations import Array, Mask, Observations
from wrist_stiffness.inference.projection import SQUARED_ROUNDING

FEWEST_UNITS = 12
"""From fewer units noise cannot be told from error, nor a lost beam from a good one (assumed)."""

OUTLIER_LIMIT = 7.0
"""Robust standard deviations from a rich model beyond which a unit is lost (the benchmarks came out
better)."""

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a Gaussian over its median absolute deviation."""

ROUNDS, SETTLED = 15, 1e-3
"""Rounds at most, and the change of every unit's weight below which they end."""

LEAST = 1e-3
"""Directions weaker than this share of the strongest could follow a single lost beam."""

MOST_DIRECTIONS = 0.25
"""Of the measured values: more directions would follow the noise of all of them."""

ROUNDING = 1e-9
"""Values that differ by less than this share of the largest are the same one."""

RIDGE = 1e-9
"""Keeps a direction solvable that only lost units show."""


def robust_scale(values: Array, least: Array | float = 0.0) -> Array:
    """Robust standard deviation of each component, (m,); one where there is none.

    `values` (n, m): NaN = not measured; `least` (m,): it is at least that.
    """
    return _typical_size(values - _medians(values), least)


def _medians(values: Array) -> Array:
    """Return the median of each component, (m,); 0 where nothing was measured."""
    good = [column[np.isfinite(column)] for column in values.T]
    return np.array([np.median(each) if each.size else 0.0 for each in good])


def _typical_size(left: Array, least: Array | float) -> Array:
    """Return the robust standard deviation about zero of each component, (m,), as above."""
    scale = np.maximum(MAD_TO_SIGMA * _medians(np.abs(left)), least)
    return np.where(scale > 0.0, scale, 1.0)


def rounding(values: Array) -> Array:
    """Return the standard deviation (m,) that coarse digits bring; 0 where all are alike.

    Where most values are rounded to the same number, their deviations tell nothing of the scatter.
    """
    found = np.zeros(values.shape[1])
    for component, column in enumerate(values.T):
        each = np.unique(column[np.isfinite(column)])
        steps = np.diff(each)
        steps = steps[steps > ROUNDING * np.abs(each).max(initial=0.0)]
        if steps.size:
            found[component] = steps.min() / np.sqrt(12.0)
    return found


def lost_units(observations: Observations, base: Array, structure: Array, limit: float) -> Mask:
    """Return which units lie far from a model with everything in it, (n,).

    Iteratively reweighted least squares with Tukey's biweight on the distance of the whole unit,
    so that one lost beam of a hundred does not pull the fit.  Each number is compared with what the
    fit leaves of noise there (Cook and Weisberg 1982): a fit comes near to the few rows that it
    follows and stays away from those that it was not given.  The median of few numbers is too small
    by chance: so in the end the root mean square of the units that are kept counts where it is
    larger.

    `observations`: table; `base` (n, m, p): columns that may do far more than the scatter, all of
    them are in the model; `structure` (n, m, q): columns of what else could be behind the values;
    `limit`: robust standard deviations beyond which a unit is lost.
    """
    n, m = observations.values.shape
    measured = observations.measured
    values = np.where(measured, observations.values, 0.0)
    least = rounding(observations.values)
    size = robust_scale(observations.values, least)
    base, structure = (
        np.where(measured[:, :, None], each / size[:, None], 0.0).reshape(n * m, -1)
        for each in (base, structure)
    )
    basis = rich_basis(base, structure, int(measured.sum()), MOST_DIRECTIONS, LEAST)
    target = (values / size).reshape(-1)
    weight = np.ones(n)
    for _ in range(ROUNDS):
        weighted = np.repeat(weight, m)[:, None] * basis
        gram = weighted.T @ basis + RIDGE * np.eye(basis.shape[1])
        solved = np.asarray(np.linalg.solve(gram, weighted.T), dtype=np.float64)
        share = _left_of_noise(basis, solved).reshape(n, m)
        told = measured & (share > SQUARED_ROUNDING)
        left = (target - basis @ (solved @ target)).reshape(n, m)
        left = np.where(told, left / np.where(told, share, 1.0), np.nan)
        scaled = left / _typical_size(left, least / size)
        distance = np.sqrt(_mean_square(scaled, axis=1))
        before, weight = weight, np.clip(1 - (distance / limit) ** 2, 0, None) ** 2
        if np.abs(weight - before).max() < SETTLED:
            break
    larger = np.maximum(_mean_square(scaled[distance <= limit], axis=0), 1.0)
    return np.asarray(_mean_square(scaled / np.sqrt(larger), axis=1) > limit**2)


def _left_of_noise(basis: Array, solved: Array) -> Array:
    """Return the standard deviation that a fit leaves of unit noise in each number, (N,).

    `basis` (N, r), `solved` (r, N): the fit is their product times the numbers.
    """
    own = np.sum(basis * solved.T, axis=1)
    of_all = np.sum((basis @ (solved @ solved.T)) * basis, axis=1)
    return np.sqrt(np.maximum(1.0 - 2.0 * own + of_all, 0.0))


def _mean_square(values: Array, axis: int) -> Array:
    """Return the mean square of those that are numbers; 0 without any."""
    count = np.isfinite(values).sum(axis=axis)
    return np.asarray(np.nansum(values**2, axis=axis) / np.maximum(count, 1))
