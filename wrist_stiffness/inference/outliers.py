"""Units that no model explains: lost beams and dropouts, found before anything is fitted."""

import numpy as np

from wrist_stiffness.inference.observations import Array, Mask, Observations
from wrist_stiffness.inference.projection import leading_directions

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
    scale = np.zeros(values.shape[1])
    for component, column in enumerate(values.T):
        good = column[np.isfinite(column)]
        if good.size:
            scale[component] = MAD_TO_SIGMA * np.median(np.abs(good - np.median(good)))
    scale = np.maximum(scale, least)
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


def lost_units(observations: Observations, columns: Array, limit: float) -> Mask:
    """Return which units lie far from a model with everything in it, (n,).

    Iteratively reweighted least squares with Tukey's biweight on the distance of the whole unit,
    so that one lost beam of a hundred does not pull the fit.

    `observations`: table; `columns` (n, m, p): base and candidates; `limit`: robust standard
    deviations beyond which a unit is lost.
    """
    n, m = observations.values.shape
    measured = observations.measured
    values = np.where(measured, observations.values, 0.0)
    least = rounding(observations.values)
    size = robust_scale(observations.values, least)
    rows = np.where(measured[:, :, None], columns / size[:, None], 0.0).reshape(n * m, -1)
    basis = leading_directions(rows, int(MOST_DIRECTIONS * measured.sum()), LEAST)
    target = (values / size).reshape(-1)
    weight = np.ones(n)
    distance = np.zeros(n)
    for _ in range(ROUNDS):
        weighted = np.repeat(weight, m)[:, None] * basis
        gram = weighted.T @ basis + RIDGE * np.eye(basis.shape[1])
        fit = basis @ np.linalg.solve(gram, weighted.T @ target)
        residual = np.where(measured, (target - fit).reshape(n, m), np.nan)
        scaled = np.where(measured, residual / robust_scale(residual, least / size), 0.0)
        distance = np.sqrt(np.sum(scaled**2, axis=1) / np.maximum(measured.sum(axis=1), 1))
        before, weight = weight, np.clip(1 - (distance / limit) ** 2, 0, None) ** 2
        if np.abs(weight - before).max() < SETTLED:
            break
    return distance > limit
