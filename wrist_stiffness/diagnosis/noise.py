"""How much of the residual is scatter: its size, its coupling between components, its colour.

The size comes from replicates where there are enough, else from what the observer states, else
from what a model with every candidate in it leaves.  The colour comes from that rich model too,
by restricted likelihood, so that slow effects in the catalogue are not taken for wander.
"""

import numpy as np

from wrist_stiffness.diagnosis.colour import find_colour
from wrist_stiffness.diagnosis.observations import Array, Observations
from wrist_stiffness.diagnosis.projection import leading_directions, orthonormal
from wrist_stiffness.diagnosis.whitening import NoiseModel, component_factors

FEWEST_REPLICATE_DOF = 12
"""Below this the scatter of the replicates is itself too uncertain to be a floor."""

MOST_BEYOND_STATED = 2.0
"""Variance of a unit over what its observer states that may still be wander."""

RICH_SHARE = 0.3
"""The rich model may use up at most this share of the numbers."""


def replicate_variance(
    values: Array, columns: Array, observations: Observations
) -> tuple[Array, float]:
    """Pooled variance inside the groups of replicates.

    What a candidate does between two replicates (drift, warming) is taken out; what it does
    between conditions cannot reach the differences inside a group.

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
    freedom = np.maximum(count - 1, 0).sum(axis=0)

    rows = inside.reshape(-1, stacked.shape[2])
    original = np.linalg.norm(stacked.reshape(rows.shape), axis=0)
    basis = orthonormal(rows[:, :-1], original[:-1])[:, : int(RICH_SHARE * freedom.sum())]
    left = rows[:, -1] - basis @ (basis.T @ rows[:, -1])
    freedom = freedom - basis.shape[1] / m
    seen = observations.measured.any(axis=0)
    variance = np.sum(left.reshape(-1, m) ** 2, axis=0) / np.maximum(freedom, 1)
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


def rich_basis(columns: Array, n_measured: int) -> Array:
    """Orthonormal basis of everything that could be structure, leading directions first."""
    return leading_directions(columns, int(RICH_SHARE * n_measured))


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
    n, m = observations.values.shape
    measured = observations.measured
    values = np.where(measured, observations.values, 0.0)
    count = np.maximum(measured.sum(axis=0), 1)
    variance = np.sum(values**2, axis=0) / count
    reference = np.diag(np.where(variance > 0, variance, 1.0))
    stated = reference if observations.covariance is None else observations.covariance
    factor = component_factors(np.broadcast_to(stated, (n, m, m)), measured)

    everything = factor @ np.where(
        measured[:, :, None], np.concatenate([base, structure, values[:, :, None]], axis=2), 0.0
    )
    basis = rich_basis(everything[:, :, :-1].reshape(n * m, -1), int(measured.sum()))
    target = everything[:, :, -1].reshape(-1)
    left = np.where(measured, (target - basis @ (basis.T @ target)).reshape(n, m), np.nan)

    loss = 1 - basis.shape[1] / measured.sum()
    coupled = residual_covariance(left, loss)
    size = np.sqrt(np.diag(coupled))
    reduced = np.concatenate([basis, target[:, None]], axis=1).reshape(n, m, -1)
    share, time_constant = find_colour(reduced / size[:, None], observations)
    repeated, freedom = replicate_variance(
        everything[:, :, -1], everything[:, :, :-1], observations
    )
    if freedom >= FEWEST_REPLICATE_DOF:
        # 1/s^2 of a scatter s^2 with few degrees of freedom is too large on average.
        visible = share_inside_groups(observations, share, time_constant)
        scatter = np.diag(repeated * freedom / (freedom - 2) / visible)
        return NoiseModel(reference, scatter, share, time_constant, freedom * m, "replicates")
    dof = float(measured.sum() * loss)
    if observations.covariance is not None:
        # What was stated is the white part; a wander comes on top of it.  No more than that: what
        # nothing in the catalogue explains may also be an effect outside of it.
        beyond = np.clip(np.diag(coupled), 1.0, MOST_BEYOND_STATED)
        scatter = np.diag(np.maximum(beyond, 1 / (1 - share)))
        return NoiseModel(reference, scatter, share, time_constant, dof, "given")
    return NoiseModel(reference, coupled, share, time_constant, dof, "residual")


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
