"""A candidate fitted with its own law, set-up and tolerances along to first order.

A column is a tangent.  Play, gaps and friction are none, so a fit of everything begins where the
law itself explains most beside a base that follows it linearly.
"""

from __future__ import annotations

from itertools import islice, product

import numpy as np
from scipy.optimize import least_squares

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.identification.candidates import Point, WristCandidate
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect

MOST_TRIALS = 7
"""Steps of the fit of one candidate."""

FACTORS = (-10.0, -3.0, -1.0, -0.3, 0.3, 1.0, 3.0, 10.0)
"""Multiples of the typed values that are tried where a law knows no typical magnitude."""

MOST_MULTIPLES = 512


class Beyond:
    """What a fit leaves, with everything projected out that it may move.

    Parameters
    ----------
    fitted : BaseFit
        The fit.
    point : Point
        The same, for trials.
    """

    def __init__(self, fitted: BaseFit, point: Point) -> None:
        self._fitted, self._point = fitted, point
        self._root = np.sqrt(max(1.0, fitted.variance))
        weights = fitted.problem.weights
        rows = np.vstack([self._whiten(fitted.columns), np.diag(weights)])
        # Weights where there is no prior are tiny: QR keeps them apart from rounding.
        self._basis = np.linalg.qr(rows)[0]
        target = np.concatenate([self._whiten(fitted.residual), weights * fitted.z])
        self._left = target - self._basis @ (self._basis.T @ target)

    def _whiten(self, values: Array) -> Array:
        return np.asarray(self._fitted.whiten(values) / self._root)

    def _white(self, changes: Array) -> Array:
        """Whiten changes (u, 6, k) of the predictions and project them likewise, (N, k)."""
        white = self._whiten(changes)
        rows = np.vstack([white, np.zeros((len(self._left) - len(white), white.shape[1]))])
        return np.asarray(rows - self._basis @ (self._basis.T @ rows))

    def best_multiple(self, effect: Effect) -> Effect:
        """Return an effect without a typical magnitude at the best multiple of its values.

        Parameters
        ----------
        effect : Effect
            With the values that somebody typed.
        """
        typed = {key: estimate.value or 1.0 for key, estimate in effect.estimates.items()}
        factors = FACTORS if len(FACTORS) ** len(typed) <= MOST_MULTIPLES else (-1.0, 1.0)
        tried = [
            {key: value * f for (key, value), f in zip(typed.items(), each, strict=True)}
            for each in islice(product(factors, repeat=len(typed)), MOST_MULTIPLES)
        ]
        changes = self._point.changes([(effect.law, effect.component, each) for each in tried])
        left = self._left[:, None] - self._white(np.moveaxis(changes, 0, -1))
        return effect.with_values(tried[int(np.argmin(np.sum(left**2, axis=0)))])

    def fitted(self, candidate: WristCandidate, start: Effect) -> Effect:
        """Return a candidate with the values of its law that explain most.

        Parameters
        ----------
        candidate : WristCandidate
            Its law and place.
        start : Effect
            The same with the values where its slopes lead.
        """
        parameters = [p for p in start.parameters if p.key not in candidate.recipe.idle]
        keys = [p.key for p in parameters]
        scale = np.array([p.scale for p in parameters])
        lower = np.array([p.lower for p in parameters]) / scale
        upper = np.array([p.upper for p in parameters]) / scale
        fixed = {key: each.value for key, each in start.estimates.items()}

        def values(x: Array) -> dict[str, float]:
            return fixed | dict(zip(keys, (x * scale).tolist(), strict=True))

        def residual(trials: list[Array]) -> Array:
            law, place = candidate.law, candidate.place
            changes = self._point.changes([(law, place, values(x)) for x in trials])
            return np.asarray(self._left[:, None] - self._white(np.moveaxis(changes, 0, -1)))

        def jacobian(x: Array) -> Array:
            step = np.maximum(1e-3, 1e-2 * np.abs(x))
            step = np.where(x + step <= upper, step, -step)
            ends = residual([x, *(x + step * row for row in np.eye(len(x)))])
            return np.asarray((ends[:, 1:] - ends[:, :1]) / step)

        x0 = np.array([fixed[key] for key in keys]) / scale
        found = least_squares(
            lambda x: residual([x])[:, 0],
            np.clip(x0, lower + 1e-6, upper - 1e-6),
            jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            ftol=1e-3,
            xtol=1e-4,
            max_nfev=MOST_TRIALS,
        )
        return candidate.effect_of(values(found.x))
