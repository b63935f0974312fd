"""How much of the residual is scatter: its size, its coupling between components, its colour.

The size comes from replicates where there are enough, else from what the observer states, else
from what a model with every candidate in it leaves.  The colour comes from that rich model too,
by restricted likelihood, so that slow effects in the catalogue are not taken for wander.
"""

from dataclasses import replace

import numpy as np

from wrist_stiffness.inference.colour import find_colour
from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.projection import ABSORBED, leading_directions, orthonormal
from wrist_stiffness.inference.shared import Apart, own_covariance
from wrist_stiffness.inference.whitening import (
    NoiseModel,
    component_factors,
    stated_covariance,
)

FEWEST_REPLICATE_DOF = 12
"""Below this the scatter of the replicates is itself too uncertain to be a floor."""

MOST_BEYOND_STATED = 2.0
"""Variance of a single measurement over what its observer states that may still be wander."""

RICH_SHARE = 0.3
"""The rich model may use up at most this share of the numbers."""


def replicate_variance(
    values: Array, columns: Array, observations: Observations
) -> tuple[Array, float]:
    """Pooled variance inside the groups of replicates.

    What a candidate does between two replicates (drift, warming) is taken out; what it does
    between conditions cannot reach the differences inside a group.  Nothing is weighted: a
    large value common to a group would not cancel under weights that differ.

    Parameters
    ----------
    values : (n, m) array
        Observations, zero where not measured.
    columns : (n, m, q) array
        Base and candidates, zero where not measured.
    observations : Observations
        With `replicate` labels; groups never span sessions.

    Returns
    -------
    (m,) array
        Variance of one unit; one for a component that was never measured.
    float
        Fewest degrees of freedom over the components; zero without replicates.
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


def share_inside_groups(
    observations: Observations, colour_share: float, colour_time: float
) -> float:
    """Part of the variance that shows inside groups of replicates, in (0, 1].

    Replicates that follow each other soon share most of a slow wander.
    """
    if observations.replicate is None:
        return 1.0
    expected, freedom = 0.0, 0
    for session in np.unique(observations.sessions):
        inside = (observations.sessions == session) & (observations.replicate >= 0)
        for label in np.unique(observations.replicate[inside]):
            times = observations.times[inside & (observations.replicate == label)]
            gap = np.abs(times[:, None] - times)
            together = colour_share * np.exp(-gap / colour_time)
            together += (1 - colour_share) * np.eye(len(times))
            expected += len(times) - together.sum() / len(times)
            freedom += len(times) - 1
    return expected / freedom if freedom and expected > 0 else 1.0


def rich_basis(base: Array, structure: Array, n_measured: int) -> Array:
    """Orthonormal basis of everything that could be structure, leading directions first.

    All of the base is in it: registrations and tolerances are far above the scatter, so that what
    a rough basis leaves of them would pass for it.

    Parameters
    ----------
    base : (N, p) array
        Weighted nuisance columns.
    structure : (N, q) array
        Weighted columns of all candidates.
    n_measured : int
        Measured numbers.
    """
    first = orthonormal(base)
    beyond = structure - first @ (first.T @ structure)
    seen = np.linalg.norm(beyond, axis=0) > ABSORBED * np.linalg.norm(structure, axis=0)
    most = max(int(RICH_SHARE * n_measured) - first.shape[1], 0)
    return np.hstack([first, leading_directions(beyond[:, seen], most)])


def estimate_noise(observations: Observations, base: Array, structure: Array) -> NoiseModel:
    """Scatter of each unit.

    Parameters
    ----------
    observations : Observations
        Table, cleaned of outliers.
    base : (n, m, p) array
        Nuisance columns.
    structure : (n, m, q) array
        Columns of all candidates.
    """
    measured = observations.measured
    values = np.where(measured, observations.values, 0.0)
    columns = np.where(measured[:, :, None], np.concatenate([base, structure], axis=2), 0.0)
    repeated, freedom = replicate_variance(values, columns, observations)
    if freedom >= FEWEST_REPLICATE_DOF:
        # 1/s^2 of a scatter s^2 with few degrees of freedom is too large on average.
        repeated = repeated * freedom / (freedom - 2)
        known = _stated_of_replicates(observations)
        dof = freedom * int(measured.any(axis=0).sum())
        noise = NoiseModel(np.diag(np.maximum(repeated - known, 0.0)), 0.0, 1.0, dof, "replicates")
        noise = _coloured(noise, base, structure, observations)
        visible = share_inside_groups(observations, noise.colour_share, noise.colour_time)
        if noise.all_wanders:
            return replace(noise, beyond=np.diag(np.maximum(repeated / visible - known, 0.0)))
        return replace(noise, beyond=noise.beyond / visible)
    stated = stated_covariance(observations)
    told = observations.covariance is not None
    if not told:
        count = np.maximum(measured.sum(axis=0), 1)
        variance = np.sum(values**2, axis=0) / count
        stated = stated + np.diag(np.where(variance > 0, variance, 1.0))
    basis, left = _rich(base, structure, observations, stated)
    loss = 1 - basis.shape[2] / measured.sum()
    coupled = residual_covariance(np.where(measured, left, np.nan), loss)
    dof = float(measured.sum() * loss)
    if told:
        excess = _pooled(np.diag(coupled), observations)
        beyond = _wander_beside(excess, own_covariance(observations, stated))
        noise = NoiseModel(beyond, 0.0, 1.0, dof, "given")
    else:
        size = np.sqrt(stated[0])
        noise = NoiseModel(size @ coupled @ size, 0.0, 1.0, dof, "residual")
    return _coloured(noise, base, structure, observations)


def _stated_of_replicates(observations: Observations) -> Array:
    """Mean variance that the table states of the units that are repeated, (m,)."""
    own = np.diagonal(stated_covariance(observations), axis1=1, axis2=2)
    repeated = np.ones(len(own), bool)
    if observations.replicate is not None:
        repeated = observations.replicate >= 0
    return np.asarray(own[repeated].mean(axis=0))


def _wander_beside(excess: Array, stated: Array) -> Array:
    """Covariance that comes on top of a stated one, (m, m).

    What was stated is the white part; a wander comes on top of it.  No more than a single
    measurement scatters: what nothing in the catalogue explains may also be an effect outside.

    Parameters
    ----------
    excess : (m,) array
        Mean square of what the rich model leaves, in units of the stated variance.
    stated : (n, m, m) array
        Covariance of each unit.
    """
    own = np.diagonal(stated, axis1=1, axis2=2)
    beside = np.maximum(excess - 1.0, 0.0) / np.mean(1.0 / own, axis=0)
    return np.diag(np.minimum(beside, (MOST_BEYOND_STATED - 1.0) * own.max(axis=0)))


def _rich(
    base: Array, structure: Array, observations: Observations, covariance: Array
) -> tuple[Array, Array]:
    """Fit everything that could be structure.

    Returns
    -------
    (n, m, r) array
        Orthonormal columns, weighted.
    (n, m) array
        What they leave of the weighted values.
    """
    measured = observations.measured
    own = own_covariance(observations, covariance)
    apart = Apart(observations, component_factors(own, measured))

    def weighted(columns: Array) -> Array:
        return apart(np.where(measured[:, :, None], columns, 0.0)).reshape(measured.size, -1)

    basis = rich_basis(weighted(base), weighted(structure), int(measured.sum()))
    target = weighted(observations.values[:, :, None])[:, 0]
    left = target - basis @ (basis.T @ target)
    return basis.reshape(*measured.shape, -1), left.reshape(measured.shape)


def _coloured(
    noise: NoiseModel, base: Array, structure: Array, observations: Observations
) -> NoiseModel:
    """Find how much of the scatter wanders slowly, and how slowly."""
    stated = stated_covariance(observations)
    covariance = stated + np.diag(np.diag(noise.beyond))
    basis, left = _rich(base, structure, observations, covariance)
    reduced = np.concatenate([basis, left[:, :, None]], axis=2)
    best, most = noise, 0.0
    for all_wanders in (True, False):
        trial = replace(noise, colour_share=1.0, all_wanders=all_wanders)
        share, time, gain = find_colour(reduced, observations, trial.wandering(observations))
        if gain > most:
            best, most = replace(trial, colour_share=share, colour_time=time), gain
    return best


def _pooled(variance: Array, observations: Observations) -> Array:
    """Mean variance over the components of each quantity: what was stated differs, its error less.

    The largest of several uncertain ones would always look like more than was stated.
    """
    count, pooled = observations.measured.sum(axis=0), variance.copy()
    for quantity in observations.reported:
        own = list(quantity.components)
        if count[own].any():
            pooled[own] = np.average(variance[own], weights=count[own])
    return pooled


def residual_covariance(left: Array, loss: float) -> Array:
    """Covariance of the components of a residual, shrunk towards no coupling, (m, m).

    Parameters
    ----------
    left : (n, m) array
        Residual; NaN = not measured.
    loss : float
        Share of the degrees of freedom that the fit left.
    """
    good = np.isfinite(left)
    filled = np.where(good, left, 0.0)
    pairs = good.T.astype(float) @ good.astype(float)
    covariance = filled.T @ filled / (loss * np.maximum(pairs, 1))
    variance = np.diag(covariance)
    own = np.diag(np.where(variance > 0, variance, 1.0))
    shrink = len(own) / (len(own) + pairs.max())
    return (1 - shrink) * covariance + shrink * own
