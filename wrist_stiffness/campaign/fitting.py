"""Fit the free parameters of a model to measured sessions: the maximum of the posterior.

Residuals log(T_measured T_predicted^-1) of the units are made white with the noise that the data
show, priors are further rows, and Gauss-Newton steps within the bounds find the least sum of
squares.  Noise and lost beams depend on the fit, so they are found again at each step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from wrist_stiffness.campaign.fit_problem import FitProblem, Progress, silent
from wrist_stiffness.diagnosis.noise import estimate_noise
from wrist_stiffness.diagnosis.observations import Mask, Observations
from wrist_stiffness.diagnosis.outliers import lost_units
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.whitening import NoiseModel
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.parameters import Estimate

MOST_STEPS = 10
"""Gauss-Newton steps."""

NOISE_STEPS = 3
"""Steps at which the noise is estimated anew; then it is kept, so that the steps converge."""

CLOSE = 0.05
"""The fit has arrived when no parameter moves by more than this share of its uncertainty."""

MOST_HALVINGS = 6

EXCITED = 0.7
"""A parameter is excited if its uncertainty falls below this share of its prior's."""

TOGETHER = 0.7
"""Correlation from which two parameters are said to be told together only."""


@dataclass(frozen=True)
class Fitted:
    """One parameter after the fit.

    Parameters
    ----------
    effect, key : str
        `law@component`, name with unit.
    session : str or None
        Session whose own it is, None for the wrist's.
    value, sigma : float
        Estimate and one standard uncertainty, in the unit of the name.
    prior, prior_sigma : float
        Mean and standard deviation of the prior.
    at_bound : bool
        Whether the estimate lies on a bound of what is possible.
    together : tuple of str
        Parameters with which it is told together only.
    """

    effect: str
    key: str
    session: str | None
    value: float
    sigma: float
    prior: float
    prior_sigma: float
    at_bound: bool
    together: tuple[str, ...]

    @property
    def excited(self) -> bool:
        """Whether the data say more of it than its prior."""
        return self.sigma < EXCITED * self.prior_sigma

    @property
    def moved(self) -> float:
        """How far it went from the mean of its prior, in standard deviations of the prior."""
        return (self.value - self.prior) / self.prior_sigma


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit arrived.

    Parameters
    ----------
    problem : FitProblem
        What was fitted.
    z : (p,) float
        Steps of the unknowns from the means of their priors.
    covariance : (p, p) float
        Of `z`; the colour of the noise and a misfit beyond it are in it.
    residual : (u, 6) float
        Of the units of `problem.table`, NaN where not measured or lost [m, rad].
    used : (u,) bool
        Units that the fit saw.
    noise : NoiseModel
        Scatter of the units.
    misfit : float
        Sum of the squared white residuals over their degrees of freedom; 1 if only noise is left.
    lost : int
        Units left out as lost beams.
    arrived : bool
        Whether the steps converged.
    """

    problem: FitProblem
    z: Array
    covariance: Array
    residual: Array
    used: Mask
    noise: NoiseModel
    misfit: float
    lost: int
    arrived: bool

    @property
    def observations(self) -> Observations:
        """The units with their residuals."""
        return self.problem.table.with_values(self.residual)

    @property
    def parameters(self) -> tuple[Fitted, ...]:
        """All that was fitted, with uncertainties."""
        problem = self.problem
        sigma = np.sqrt(np.diag(self.covariance))
        correlation = np.abs(self.covariance / np.outer(sigma, sigma)) - np.eye(len(sigma))
        names = [f"{problem.free[u.free].effect.name} {u.key}" for u in problem.unknowns]
        out = []
        for place, (unknown, z) in enumerate(zip(problem.unknowns, self.z, strict=True)):
            value = unknown.mean + float(z) * unknown.step
            near = 1e-6 * unknown.step
            out.append(
                Fitted(
                    problem.free[unknown.free].effect.name,
                    unknown.key,
                    None if unknown.session is None else problem.sessions[unknown.session].name,
                    value,
                    float(sigma[place]) * unknown.step,
                    unknown.mean,
                    unknown.step / unknown.weight,
                    min(value - unknown.lower, unknown.upper - value) < near,
                    tuple(names[i] for i in np.flatnonzero(correlation[place] > TOGETHER)),
                )
            )
        return tuple(out)

    def effects(self, session: int = -1) -> tuple[Effect, ...]:
        """Return the free effects with estimates and uncertainties, as a session has them."""
        problem = self.problem
        session %= len(problem.sessions)
        sigma = np.sqrt(np.diag(self.covariance))
        estimates: list[dict[str, Estimate]] = [
            dict(each.effect.estimates) for each in problem.free
        ]
        values = problem.effects(self.z, session)
        for unknown, own in zip(problem.unknowns, sigma, strict=True):
            if unknown.session in (None, session):
                value = values[unknown.free].estimates[unknown.key].value
                estimates[unknown.free][unknown.key] = Estimate(value, float(own) * unknown.step)
        return tuple(
            replace(each.effect, estimates=own)
            for each, own in zip(problem.free, estimates, strict=True)
        )

    def model(self, session: int = -1) -> ErrorModel:
        """Return the model with the fitted effects, as a session has them."""
        model = self.problem.model
        return model.with_effects(*model.effects, *self.effects(session))


def fit(
    problem: FitProblem,
    start: Array | None = None,
    held_out: Mask | None = None,
    progress: Progress = silent,
) -> Fit:
    """Find the most probable parameters.

    Parameters
    ----------
    problem : FitProblem
        Model, sessions and what may move.
    start : (p,) float, optional
        Where to begin, in steps; at the means of the priors if None.
    held_out : (u,) bool, optional
        Units of `problem.table` that the fit must not see.
    progress : callable
        Is told steps done and steps at most.

    Returns
    -------
    Fit
        Estimates, uncertainties and what is left.

    Raises
    ------
    InputError
        If fewer numbers were measured than parameters without a prior are free.
    """
    table, weight = problem.table, problem.weights
    unseen = np.zeros(table.n_units, dtype=bool) if held_out is None else held_out
    if table.measured[~unseen].sum() < max(1, np.count_nonzero(weight < 1.0)):
        raise InputError(f"fit: only {table.measured[~unseen].sum()} numbers were measured")
    lower, upper = problem.bounds
    z = np.zeros(len(weight)) if start is None else start
    residual, noise, arrived, step = problem.residual(z), None, False, 0
    while True:
        columns = problem.columns(z)
        lost = lost_units(table.with_values(residual), columns, Settings().outlier_limit)
        seen = table.with_values(np.where((lost | unseen)[:, None], np.nan, residual))
        if noise is None or step < NOISE_STEPS:
            noise = estimate_noise(seen, columns, np.empty((*residual.shape, 0)))
        white = noise.whiten(seen, np.concatenate([columns, residual[:, :, None]], axis=2))
        design, target = white[:, :-1], white[:, -1]
        misfit, covariance = _uncertainty(design, target, weight, seen)
        progress(step, MOST_STEPS)
        if arrived or step == MOST_STEPS:
            break
        triangle = np.linalg.qr(
            np.vstack([np.hstack([design, -target[:, None]]), _prior_rows(weight, z)]), mode="r"
        )
        move = lsq_linear(
            triangle[:, :-1], triangle[:, -1], (lower - z, upper - z), method="bvls"
        ).x
        z, residual, taken = _descended(problem, seen, noise, z, move, residual)
        arrived = bool((np.abs(taken) < CLOSE * np.sqrt(np.diag(covariance))).all())
        step += 1
    progress(MOST_STEPS, MOST_STEPS)
    residual = np.where(lost[:, None], np.nan, residual)
    return Fit(problem, z, covariance, residual, ~unseen, noise, misfit, int(lost.sum()), arrived)


def _prior_rows(weight: Array, z: Array) -> Array:
    return np.hstack([np.diag(weight), (-weight * z)[:, None]])


def _uncertainty(
    design: Array, target: Array, weight: Array, seen: Observations
) -> tuple[float, Array]:
    """Return the misfit, and the covariance with a misfit above 1 counted as more noise.

    `target` belongs to the point at which `design` was taken, so the misfit is that of the linear
    problem's end.
    """
    information = design.T @ design
    prior = np.diag(weight**2)
    spent = float(np.trace(np.linalg.solve(information + prior, information)))
    best = np.linalg.lstsq(
        np.vstack([design, np.diag(weight)]),
        np.concatenate([target, np.zeros(len(weight))]),
        rcond=None,
    )[0]
    left = target - design @ best
    misfit = float(left @ left) / max(float(seen.measured.sum()) - spent, 1.0)
    return misfit, np.linalg.inv(information / max(misfit, 1.0) + prior)


def _descended(
    problem: FitProblem,
    seen: Observations,
    noise: NoiseModel,
    z: Array,
    move: Array,
    residual: Array,
) -> tuple[Array, Array, Array]:
    """Take a step, halved until the sum of squares falls; return z, residual and the step."""

    def squares(z: Array, residual: Array) -> float:
        white = noise.whiten(seen, residual[:, :, None])
        return float((white**2).sum() + ((problem.weights * z) ** 2).sum())

    now = squares(z, residual)
    for _ in range(MOST_HALVINGS):
        tried = problem.residual(z + move)
        if squares(z + move, tried) <= now:
            return z + move, tried, move
        move = 0.5 * move
    return z, residual, np.zeros_like(move)
