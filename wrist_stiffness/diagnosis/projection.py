"""Linear algebra of one question: what columns explain beyond the base.

Everything is whitened, so sums of squares are chi-square.  A Gaussian prior on a parameter is a
row of its own (augmented least squares); projections then honour priors without special cases.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wrist_stiffness.diagnosis.observations import Array

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


@dataclass(frozen=True, eq=False)
class Base:
    """Everything that is refitted before a question is asked.

    Parameters
    ----------
    basis : (N, r) array
        Orthonormal basis of the refitted columns, data rows first, prior rows below.
    residual : (N,) array
        What the base leaves of the observations.
    n_rows : int
        Measured numbers plus proper priors.
    n_priors : int
        How many of the rows are priors: the last ones.
    known : dict
        What was worked out about hypotheses against it: the same questions come back.
    """

    basis: Array
    residual: Array
    n_rows: int
    n_priors: int
    known: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def energy(self) -> float:
        """Sum of squares that is left."""
        return float(self.residual @ self.residual)

    @property
    def freedom(self) -> int:
        """Degrees of freedom that are left."""
        return self.n_rows - self.basis.shape[1]

    def beyond(self, columns: Array) -> Array:
        """Part of the columns that the base cannot imitate, (N, k)."""
        return columns - self.basis @ (self.basis.T @ columns)

    def directions(self, columns: Array) -> Array:
        """Orthonormal basis of what the columns add to the base, (N, r)."""
        return orthonormal(self.beyond(columns), np.linalg.norm(columns, axis=0))

    def extended(self, columns: Array) -> "Base":
        """Return this base with more columns in it."""
        more = self.directions(columns)
        return Base(
            np.hstack([self.basis, more]),
            self.residual - more @ (more.T @ self.residual),
            self.n_rows,
            self.n_priors,
        )


def make_base(white: Array, prior_std: Array, n_measured: int) -> Base:
    """Put data and priors together and refit.

    Parameters
    ----------
    white : (n, p + 1) array
        Whitened nuisance columns, the observations last.
    prior_std : (p,) array
        Infinite for free parameters.
    n_measured : int
        How many of the observations were measured.
    """
    rows = augmented(white, prior_std)
    basis, values, priors = orthonormal(rows[:, :-1]), rows[:, -1], len(rows) - len(white)
    return Base(basis, values - basis @ (basis.T @ values), n_measured + priors, priors)


def augmented(white: Array, prior_std: Array) -> Array:
    """Return rows of data above a row for each proper prior, (N, p + 1).

    Parameters
    ----------
    white : (n, p + 1) array
        Whitened columns, the observations last.
    prior_std : (p,) array
        Infinite for free parameters.
    """
    priors = np.diag(1 / prior_std)[np.isfinite(prior_std)]
    return np.vstack([white, np.pad(priors, ((0, 0), (0, 1)))])


def least_squares(columns: Array, target: Array, reference: Array) -> tuple[Array, Array]:
    """Least squares and covariance; a column inside the base has value 0 and no end of scatter.

    Parameters
    ----------
    columns : (N, k) array
        Columns beyond the base.
    target : (N,) array
        What they should explain.
    reference : (k,) array
        Norms of the columns before the base was taken out.
    """
    norm = np.linalg.norm(columns, axis=0)
    seen = (norm > ABSORBED * reference) & (norm > 0)
    inverse = np.linalg.pinv(columns[:, seen] / norm[seen], rcond=1e-10)
    values, covariance = np.zeros(len(norm)), np.diag(np.where(seen, 0.0, np.inf))
    values[seen] = inverse @ target / norm[seen]
    covariance[np.ix_(seen, seen)] = inverse @ inverse.T / np.outer(norm[seen], norm[seen])
    return values, covariance
