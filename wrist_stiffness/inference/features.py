"""Nystroem features of a smooth law of the conditions."""

import numpy as np
from scipy.spatial.distance import cdist

from wrist_stiffness.inference.observations import Array

LANDMARKS = 60


def features(conditions: Array, length: float, rng: np.random.Generator) -> Array:
    """Nystroem features of a squared-exponential process, (n, q)."""
    n, d = conditions.shape
    length = length * np.sqrt(d)
    distinct = np.unique(conditions, axis=0)
    marks = distinct
    if len(distinct) > LANDMARKS:
        marks = distinct[rng.choice(len(distinct), LANDMARKS, replace=False)]

    def kernel(a: Array, b: Array) -> Array:
        return np.exp(-0.5 * cdist(a, b, "sqeuclidean") / length**2)

    size, vectors = np.linalg.eigh(kernel(marks, marks))
    keep = size > 1e-6 * size[-1]
    return kernel(conditions, marks) @ (vectors[:, keep] / np.sqrt(size[keep]))
