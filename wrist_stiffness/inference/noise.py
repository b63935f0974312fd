"""The scatter of a table: from what was repeated, or from what everything together leaves."""

import numpy as np

from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.projection import ABSORBED, leading_directions, orthonormal

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
