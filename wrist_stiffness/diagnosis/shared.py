"""Scatter that neighbouring units have in common: what a motor at rest hides of its count.

A rest, a change of the load and the next rest have the same hidden angles: their differences know
nothing of them, and their mean is no better than one of them.  Taken for independent, the hidden
counts would both drown what a load does and make the mean look too good.
"""

import numpy as np

from wrist_stiffness.diagnosis.observations import Array, Observations


def own_covariance(observations: Observations, covariance: Array) -> Array:
    """Return the covariance of each unit without what it shares, (n, m, m).

    Parameters
    ----------
    observations : Observations
        Units.
    covariance : (m, m) or (n, m, m) array
        Of each unit by itself.
    """
    n, m = observations.values.shape
    whole = np.broadcast_to(covariance, (n, m, m))
    if observations.shared is None or observations.stand is None:
        return whole
    shared = observations.shared * (observations.stand >= 0)[:, None, None]
    return np.asarray(whole - shared @ np.swapaxes(shared, 1, 2))


def apart(observations: Observations, factors: Array, columns: Array) -> Array:
    """Bring columns to unit scatter that the units of a stand no longer share, (n, m, k).

    The covariance of a stand is that of independent units plus few directions; its inverse root
    differs from theirs in these directions alone.

    Parameters
    ----------
    observations : Observations
        Units.
    factors : (n, m, m) array
        Inverse factors of each unit's own covariance.
    columns : (n, m, k) array
        Zero where not measured.
    """
    white = factors @ columns
    if observations.shared is None or observations.stand is None:
        return np.asarray(white)
    loadings = factors @ (observations.shared * observations.measured[:, :, None])
    for stand in np.unique(observations.stand[observations.stand >= 0]):
        rows = np.flatnonzero(observations.stand == stand)
        tall = loadings[rows].reshape(-1, loadings.shape[2])
        left, size, _ = np.linalg.svd(tall, full_matrices=False)
        flat = white[rows].reshape(len(tall), -1)
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + size**2)
        flat = flat - left @ (shrink[:, None] * (left.T @ flat))
        white[rows] = flat.reshape(white[rows].shape)
    return np.asarray(white)
