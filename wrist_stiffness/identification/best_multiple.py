"""Where the fit of an effect without typical magnitudes begins."""

from __future__ import annotations

from itertools import islice, product

import numpy as np

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.identification.candidates import Point
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect

FACTORS = (-10.0, -3.0, -1.0, -0.3, 0.3, 1.0, 3.0, 10.0)
"""Multiples of the typed values that are tried."""

MOST_MULTIPLES = 512


def best_multiple(fitted: BaseFit, point: Point, effect: Effect) -> Effect:
    """Return an effect at the multiple of its values that explains most beside a base that follows.

    Parameters
    ----------
    fitted : BaseFit
        What everything else explains; to first order it follows.
    point : Point
        The same, for trials.
    effect : Effect
        With the values that somebody typed.
    """
    # Weights where there is no prior are tiny: QR keeps them apart from rounding.
    root, weights = np.sqrt(max(1.0, fitted.variance)), fitted.problem.weights
    basis = np.linalg.qr(np.vstack([fitted.whiten(fitted.columns) / root, np.diag(weights)]))[0]

    def beyond(white: Array, offset: Array) -> Array:
        rows = np.concatenate([white / root, offset])
        return np.asarray(rows - basis @ (basis.T @ rows))

    typed = {key: estimate.value or 1.0 for key, estimate in effect.estimates.items()}
    factors = FACTORS if len(FACTORS) ** len(typed) <= MOST_MULTIPLES else (-1.0, 1.0)
    tried = [
        {key: value * f for (key, value), f in zip(typed.items(), each, strict=True)}
        for each in islice(product(factors, repeat=len(typed)), MOST_MULTIPLES)
    ]
    changes = point.changes([(effect.law, effect.component, each) for each in tried])
    white = fitted.whiten(np.moveaxis(changes, 0, -1))
    explained = beyond(white, np.zeros((len(weights), len(tried))))
    left = beyond(fitted.whiten(fitted.residual), weights * fitted.z)[:, None] - explained
    return effect.with_values(tried[int(np.argmin(np.sum(left**2, axis=0)))])
