"""Orthonormal bases of columns, blind to their scales."""

import numpy as np

from wrist_stiffness.inference.observations import Array

NEGLIGIBLE = 1e-9
"""Singular values below this share of the largest are rounding, not information."""

ABSORBED = 1e-5
"""A column of which the base leaves less than this share of the norm lies inside the base."""


SQUARED_ROUNDING = 1e-6
"""Singular values below this share of the largest cannot be seen in a Gram matrix."""


def orthonormal(columns: Array, original_norm: Array | None = None) -> Array:
    """Orthonormal basis of the columns, (N, r), blind to their scales.

    Parameters
    ----------
    columns : (N, k) array
        Columns, possibly dependent.
    original_norm : (k,) array, optional
        Norms before a projection; a column that lost nearly all of it is left out.
    """
    norm = np.linalg.norm(columns, axis=0)
    reference = norm if original_norm is None else original_norm
    keep = (norm > ABSORBED * reference) & (norm > 0)
    if not keep.any():
        return np.empty((columns.shape[0], 0))
    left, size, _ = np.linalg.svd(columns[:, keep] / norm[keep], full_matrices=False)
    return left[:, size > NEGLIGIBLE * size[0] * max(columns.shape)]


def leading_directions(columns: Array, most: int, least: float = SQUARED_ROUNDING) -> Array:
    """Orthonormal basis of the strongest directions of many columns, (N, r), blind to their scales.

    By the Gram matrix of the shorter side: its cost grows with the longer one only once, and
    directions far below the strongest are lost in rounding, which is no loss where only the strong
    ones are wanted.

    Parameters
    ----------
    columns : (N, k) array
        Columns, possibly dependent.
    most : int
        Largest number of directions.
    least : float, optional
        Directions whose singular value is below this share of the largest are left out.
    """
    norm = np.linalg.norm(columns, axis=0)
    if not (norm > 0).any() or most == 0:
        return np.empty((len(columns), 0))
    scaled = columns[:, norm > 0] / norm[norm > 0]
    wide = scaled.shape[1] > len(scaled)
    size, vectors = np.linalg.eigh(scaled @ scaled.T if wide else scaled.T @ scaled)
    strong = np.flatnonzero(size > max(least, SQUARED_ROUNDING) ** 2 * size[-1])[::-1][:most]
    if wide:
        return np.asarray(vectors[:, strong])
    directions: Array = np.linalg.qr(scaled @ (vectors[:, strong] / np.sqrt(size[strong])))[0]
    return directions
