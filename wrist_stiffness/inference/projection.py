"""Few columns for many: orthonormal bases, blind to their scales, and low-rank kernels."""

from collections.abc import Callable

import numpy as np

from wrist_stiffness.inference.observations import Array

NEGLIGIBLE = 1e-9
"""Singular values below this share of the largest are rounding, not information."""

ABSORBED = 1e-5
"""A column of which the base leaves less than this share of the norm lies inside the base."""

SQUARED_ROUNDING = 1e-6
"""Singular values below this share of the largest cannot be seen in a Gram matrix."""

LEFT_OUT = 1e-3
"""Share of a kernel that its columns may leave out."""


def orthonormal(columns: Array) -> Array:
    """Orthonormal basis of the columns, (N, r), blind to their scales.

    `columns` (N, k): columns, possibly dependent.
    """
    norm = np.linalg.norm(columns, axis=0)
    keep = norm > 0
    if not keep.any():
        return np.empty((columns.shape[0], 0))
    left, size, _ = np.linalg.svd(columns[:, keep] / norm[keep], full_matrices=False)
    return left[:, size > NEGLIGIBLE * size[0] * max(columns.shape)]


def leading_directions(columns: Array, most: int, least: float = SQUARED_ROUNDING) -> Array:
    """Orthonormal basis of the strongest directions of many columns, (N, r), blind to their scales.

    By the Gram matrix of the shorter side: its cost grows with the longer one only once, and
    directions far below the strongest are lost in rounding, which is no loss where only the strong
    ones are wanted.

    `columns` (N, k): columns, possibly dependent; `most`: largest number of directions; `least`:
    directions whose singular value is below this share of the largest are left out.
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


def low_rank(
    kernel: Array, rank: int, left_out: Callable[[Array], float] = np.sum
) -> tuple[Array, list[int]]:
    """Return L (u, k) with L L^T nearly a kernel (u, u), k <= rank, by pivoted Cholesky.

    Its units come second, in their order.  It ends where `left_out`, of the variances that are left
    over, falls to that share of all.
    """
    left, columns = np.diag(kernel).astype(float), np.zeros((len(kernel), 0))
    least = LEFT_OUT * left_out(left)
    found: list[int] = []
    while len(found) < rank and left_out(left) > least:
        at = int(np.argmax(left))
        column = (kernel[:, at] - columns @ columns[at]) / np.sqrt(left[at])
        columns = np.column_stack([columns, column])
        left = np.maximum(left - column**2, 0.0)
        found.append(at)
    return columns, found
