"""Scatter of the units that no mean over a dwell makes smaller, found from what a fit leaves.

A mean over a hundred measurements knows a hundredth of their white variance and all of an
instrument's slow wander.  An instrument that states no scatter does not tell how much that is; and
what a model cannot say, because flanges or motion are simpler in it than on the wrist, scatters
the same way.  Without this term a few dwells would be believed far beyond what they are worth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wrist_stiffness.inference.observations import Mask, Observations
from wrist_stiffness.inference.whitening import component_factors
from wrist_stiffness.mechanism.components import Array

HALVES = (slice(0, 3), slice(3, 6))

SHARES = np.concatenate([[0.0], np.geomspace(0.05, 1.5, 12)])
"""Sizes that are tried, over the root mean square of what is left."""


def with_wander(table: Observations, wander: Array) -> Observations:
    """Return the units with a standard deviation beside what is stated.

    Parameters
    ----------
    table : Observations
        u units.
    wander : (2, 6) float
        Of moments in motion, and of rests [m, rad].
    """
    if table.covariance is None or not wander.any():
        return table
    own = wander[_at_rest(table).astype(int)]
    return replace(table, covariance=table.covariance + own[:, :, None] ** 2 * np.eye(6))


def _at_rest(table: Observations) -> Mask:
    return table.covariate("held_s") > 0.0


def found_wander(seen: Observations, columns: Array, weight: Array, z: Array) -> Array:
    """Find the most probable wander by restricted likelihood.

    Parameters
    ----------
    seen : Observations
        u units with what a fit leaves of them as values, NaN where it did not see them.
    columns : (u, 6, p) float
        Change of that by a step of each unknown.
    weight, z : (p,) float
        Weights of the priors, and where the fit stands.

    Returns
    -------
    (2, 6) float
        Of moments in motion, whose loads are known less well, and poses measured once; and of
        means over rests.  Alike for the three shifts and for the three turns [m, rad]; zero where
        no scatter is stated.
    """
    wander = np.zeros((2, 6))
    if seen.covariance is None:
        return wander
    rest = _at_rest(seen)
    for kind, rows in enumerate((~rest, rest)):
        for half in HALVES:
            values = seen.values[rows, half]
            if not np.isfinite(values).any():
                continue
            tried = []
            for size in SHARES * np.sqrt(np.nanmean(values**2)):
                wander[kind, half] = size
                tried.append((_misfit(with_wander(seen, wander), columns, weight, z), size))
            wander[kind, half] = min(tried)[1]
    return wander


def _misfit(seen: Observations, columns: Array, weight: Array, z: Array) -> float:
    """Return minus twice the logarithm of the restricted likelihood."""
    n, m = seen.values.shape
    measured = seen.measured
    stated = np.eye(m) if seen.covariance is None else seen.covariance
    factor = component_factors(np.broadcast_to(stated, (n, m, m)), measured)
    rows = np.concatenate([columns, seen.values[:, :, None]], axis=2)
    white = (factor @ np.where(measured[:, :, None], rows, 0.0)).reshape(n * m, -1)
    design, target = white[:, :-1], -white[:, -1]
    information = design.T @ design + np.diag(weight**2)
    slope = design.T @ target - weight**2 * z
    squares = target @ target - slope @ np.linalg.solve(information, slope)
    known = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum()
    return float(squares + np.linalg.slogdet(information)[1] - 2.0 * known)
