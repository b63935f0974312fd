"""What values the unknowns of an effect can have, and what that is worth as evidence.

The priors of unknowns spread over values that cannot be: a spring that pushes the load away, a
clearance below zero.  What is possible of a prior has a share of its probability, and what is
possible of the posterior a share of that; the evidence of the law is larger by their quotient than
that of the law without bounds (Klugkist and Hoijtink 2007).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri, stdtr

Array = NDArray[np.float64]

TAIL = 2.0
"""Degrees of freedom of the prior of an effect's size (assumed), a multivariate t: a fault ten
times as large as the effect of an ordinary wrist is rare, but no wonder."""

PRIOR_DRAWS, DRAWS = 100_000, 4_000
"""Draws that estimate a share that only a test of whole sets of values can tell."""


@dataclass(frozen=True, eq=False)
class Possible:
    """What the unknowns of one effect can be, in the standard deviations of their priors."""

    # (k,), least and most of each
    lower: Array
    upper: Array
    # (n, k) values within these bounds -> (n,) whether such a set of values can be; any can by
    # default
    together: Callable[[Array], NDArray[np.bool_]] | None = None

    @cached_property
    def log_prior(self) -> float:
        """Logarithm of the share of the prior that is possible."""
        log = _log_shares(stdtr(TAIL, self.lower), stdtr(TAIL, self.upper))
        if self.together is not None:
            low, high = ndtr(self.lower), ndtr(self.upper)
            random = np.random.default_rng(0)
            draws = ndtri(low + (high - low) * random.random((PRIOR_DRAWS, len(low))))
            log += _log_share(self.together(draws))
        return log

    def gain(self, z: Array, covariance: Array) -> float:
        """Return what bounds add to the log evidence of an effect.

        `z` (k,): most probable values; `covariance` (k, k): of a normal posterior about them.
        """
        sigma = np.sqrt(np.diag(covariance))
        if self.together is None:
            log = _log_shares(ndtr((self.lower - z) / sigma), ndtr((self.upper - z) / sigma))
        else:
            # Two times the same draws: what is compared should not differ by chance.
            draws = np.random.default_rng(0).standard_normal((DRAWS, len(z)))
            sizes, vectors = np.linalg.eigh(covariance)
            draws = z + draws @ (vectors * np.sqrt(np.maximum(sizes, 0.0))).T
            within = ((draws >= self.lower) & (draws <= self.upper)).all(axis=1)
            within[within] = self.together(draws[within])
            log = _log_share(within)
        return log - self.log_prior


def within_bounds(
    z: Array,
    lower: Array,
    upper: Array,
    solve: Callable[[NDArray[np.bool_], Array], Array],
    slope: Callable[[Array], Array],
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the most probable unknowns (p,) within bounds, and which of them no bound holds.

    An active set: held one after the other, the furthest first, for others may then come back; and
    released where the slope draws inwards, once each, so that it ends.

    `z`: without bounds; `lower`, `upper` (p,): these; `solve`: from which unknowns are free, and
    the values of all, to the most probable values where those not free stay; `slope`: from the
    values to the gradient of the log posterior.
    """
    free, released = np.ones(len(z), dtype=bool), np.zeros(len(z), dtype=bool)
    while True:
        beyond = np.where(free, np.maximum(lower - z, z - upper), 0.0)
        if (beyond > 0.0).any():
            free[np.argmax(beyond)] = False
            z = np.clip(z, lower, upper)
        elif free.all():
            break
        else:
            inwards = np.where(z <= lower, 1.0, -1.0) * slope(z)
            inwards[free | released] = 0.0
            if not (inwards > 0.0).any():
                break
            first = np.argmax(inwards)
            free[first] = released[first] = True
        z = solve(free, z)
    return z, free


def _log_shares(low: Array, high: Array) -> float:
    """Return the logarithm of what lies between two shares of each unknown, one draw at least."""
    return float(np.sum(np.log(np.maximum(high - low, 1.0 / DRAWS))))


def _log_share(are: NDArray[np.bool_]) -> float:
    """Return the logarithm of a share; where none is, of half a draw."""
    return float(np.log((np.count_nonzero(are) + 0.5) / (len(are) + 1)))
