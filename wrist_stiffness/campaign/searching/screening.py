"""Candidates as they are, not as columns: each fitted with the base refitted along.

A column is a tangent.  Play, gaps and friction are not, and what an effect does beside the base
that took up a part of it is not either.  So the few that lead by their columns are fitted with
their own law, the base to first order, before one is chosen to be fitted with all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.campaign.searching.candidates import Point, WristCandidate
from wrist_stiffness.diagnosis.worth import worth
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect

MOST_TRIALS = 7
"""Steps of the fit of one leader."""


@dataclass(frozen=True, eq=False)
class FittedCandidate:
    """A candidate at its best.

    Parameters
    ----------
    candidate : WristCandidate
        The effect.
    values : dict of str to float
        Of the law's parameters.
    gain : float
        Fall of the weighted sum of squares against the base alone, less the parameters' price.
    price : float
        What the freedom of the parameters costs.
    """

    candidate: WristCandidate
    values: Mapping[str, float]
    gain: float
    price: float

    @property
    def effect(self) -> Effect:
        """The effect with these values."""
        return self.candidate.effect_of(self.values)


class Screen:
    """What a fitted base leaves, with the base projected out.

    Parameters
    ----------
    base : BaseFit
        Fitted.
    point : Point
        The same base, for trials.
    without : str, optional
        Name of an effect fitted along that is taken out, to first order.
    variance : float
        Of what is left, in units of the noise: priors hold against a part that is not noise.
    """

    def __init__(
        self, base: BaseFit, point: Point, without: str | None = None, variance: float = 1.0
    ) -> None:
        self._base, self._point, self._root = base, point, np.sqrt(variance)
        free, weights = base.problem.free, base.problem.weights
        names = np.array([free[u.free].effect.name for u in base.problem.unknowns])
        stays = (names != without) | base.of_base
        rows = np.vstack([self._whiten(base.columns), np.diag(weights)])
        target = np.concatenate([self._whiten(base.residual), weights * base.z])
        target = target - rows[:, ~stays] @ base.z[~stays]
        # NO_PRIOR weights are tiny: QR keeps them apart from rounding.
        self._basis = np.linalg.qr(rows[:, stays])[0]
        self.left = self.beyond(target)

    @property
    def energy(self) -> float:
        """Weighted sum of squares that the base leaves."""
        return float(self.left @ self.left)

    def beyond(self, rows: Array) -> Array:
        """Return the part of rows (N,) or (N, k) that the base cannot imitate."""
        return rows - self._basis @ (self._basis.T @ rows)

    def white(self, changes: Array) -> Array:
        """Whiten changes (u, 6, k) of the predictions and take the base out, (N, k)."""
        white = self._whiten(changes)
        priors = np.zeros((len(self.left) - len(white), white.shape[1]))
        return self.beyond(np.vstack([white, priors]))

    def _whiten(self, values: Array) -> Array:
        return self._base.whiten(values) / self._root

    def leaders(
        self, candidates: Sequence[WristCandidate]
    ) -> list[tuple[float, WristCandidate, tuple[float, ...]]]:
        """Return what each candidate gains by its columns, at its best shape, largest first."""
        found = []
        for candidate in candidates:
            best = max(
                (
                    (worth(self.white(candidate.at(shape)), self.left, candidate.usual), shape)
                    for shape in candidate.shapes
                ),
                key=lambda pair: pair[0],
            )
            found.append((best[0] - len(best[1]) * self._base.unit_price, candidate, best[1]))
        return sorted(found, key=lambda each: -each[0])

    def fitted(
        self, candidate: WristCandidate, shape: tuple[float, ...], value: float
    ) -> FittedCandidate:
        """Fit a candidate with its own law, from where its columns lead.

        Parameters
        ----------
        candidate : WristCandidate
            A leader.
        shape : tuple of float
            Where on its grid it leads.
        value : float
            What it gains there by its columns.
        """
        rows = self.white(candidate.at(shape))
        norm = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        factors = np.linalg.lstsq(rows / norm, self.left, rcond=1e-6)[0] / norm
        after = self.left - rows @ factors
        price = self.energy - float(after @ after) - value
        names = [each.factor.name for each in candidate.recipe.columns(shape)]
        start = candidate.effect(dict(zip(names, factors, strict=True)), shape)
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
            return self.left[:, None] - self.white(np.moveaxis(changes, 0, -1))

        def jacobian(x: Array) -> Array:
            step = np.maximum(1e-3, 1e-2 * np.abs(x))
            step = np.where(x + step <= upper, step, -step)
            ends = residual([x, *(x + step * row for row in np.eye(len(x)))])
            return np.asarray((ends[:, 1:] - ends[:, :1]) / step)

        x0 = np.array([fixed[key] for key in keys]) / scale
        x0 = np.clip(x0, lower + 1e-6, upper - 1e-6)
        found = least_squares(
            lambda x: residual([x])[:, 0],
            x0,
            jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            ftol=1e-3,
            xtol=1e-4,
            max_nfev=MOST_TRIALS,
        )
        gain = self.energy - 2.0 * float(found.cost) - price
        return FittedCandidate(candidate, values(found.x), gain, price)
