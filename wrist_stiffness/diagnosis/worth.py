"""What a candidate's columns are worth: the fall of the sum of squares, less what freedom costs.

A prior of the usual size of each parameter charges a direction by how far it could move the data
(Bayes factor of a linear model with a Gaussian prior; MacKay 1992).  A direction that no plausible
size would show is free of charge and explains nothing; so a spring of 21 constants of which six
show pays for six.  How far from the usual a hidden effect lies is not known: the width of the
prior, one number an effect, is the one that suits it best.
"""

import numpy as np

from wrist_stiffness.diagnosis.observations import Array

WIDTHS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
"""Width of the prior in usual sizes."""


def worth(columns: Array, residual: Array, scales: Array, variance: float = 1.0) -> float:
    """Twice the logarithm of the Bayes factor of columns against none of them.

    Parameters
    ----------
    columns : (N, k) array
        What a unit of each parameter does beyond the base, whitened.
    residual : (N,) array
        What the base leaves, whitened.
    scales : (k,) array
        Usual size of each parameter.
    variance : float
        Of a number of the residual.
    """
    directions, size = directions_of(columns, scales)
    return float(worth_along(directions.T @ residual, size, variance))


def directions_of(columns: Array, scales: Array) -> tuple[Array, Array]:
    """Return independent directions of columns at usual sizes (N, k), and their squares (k,)."""
    scaled = columns * scales
    size, vectors = np.linalg.eigh(scaled.T @ scaled)
    return scaled @ vectors, np.maximum(size, 0.0)


def worth_along(moment: Array, size: Array, variance: Array | float) -> Array:
    """Return what directions are worth to one residual or many, (...).

    Parameters
    ----------
    moment : (k, ...) array
        Product of each direction with each residual.
    size : (k,) array
        Squared length of each direction.
    variance : (...) array or float
        Of a number of each residual.
    """
    own = size.reshape(-1, *(1,) * (moment.ndim - 1)) / variance
    square = (moment / variance) ** 2
    width = np.square(WIDTHS).reshape(-1, *(1,) * moment.ndim)
    shown = width * own
    trials = np.sum(width * square / (1.0 + shown) - np.log1p(shown), axis=1)
    return np.asarray(trials.max(axis=0))
