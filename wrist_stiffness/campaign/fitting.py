"""Fit the free parameters of a model to measured sessions: the maximum of the posterior.

Residuals log(T_measured T_predicted^-1) of the units are made white with the noise that the data
show, priors are further rows, and Gauss-Newton steps within the bounds find the least sum of
squares.  Noise and lost beams depend on the fit, so they are found again at each step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from wrist_stiffness.campaign.fit_problem import FitProblem, Progress, silent
from wrist_stiffness.campaign.free_effects import FreeEffect
from wrist_stiffness.campaign.shims import GAPS
from wrist_stiffness.diagnosis.noise import estimate_noise
from wrist_stiffness.diagnosis.observations import Mask, Observations
from wrist_stiffness.diagnosis.outliers import lost_units
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.whitening import NoiseModel
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.parameters import Estimate

MOST_STEPS = 40
"""Gauss-Newton steps."""

NOISE_ROUNDS = 2
"""Rounds of steps, the noise estimated at each: without its colour, and with it."""

CLOSE, SMALL_FALL = 0.05, 0.1
"""A round ends when no parameter moves by more than this share of its uncertainty, or the sum of
squares falls by less than this, which no parameter can feel."""

SUSPECT = 2.0
"""Mean square, by the scatter that is known without any fit, from which other ways are tried."""

LOST_COST = 50.0
"""What a lost number costs when ways are compared: seven standard deviations."""

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
    columns : (u, 6, p) float
        Change of the residual by a step of each unknown [m, rad].
    residual : (u, 6) float
        Of the units of `problem.table`, NaN where not measured or lost [m, rad].
    used : (u,) bool
        Units that the fit saw.
    noise : NoiseModel
        Scatter of the units, with a misfit counted as more of it.
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
    columns: Array
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
    def seen(self) -> Observations:
        """The units that the fit saw, the others blank."""
        return self.problem.table.with_values(np.where(self.used[:, None], self.residual, np.nan))

    @property
    def parameters(self) -> tuple[Fitted, ...]:
        """All that was fitted, with uncertainties."""
        problem = self.problem
        sigma = np.sqrt(np.diag(self.covariance))
        correlation = np.abs(self.covariance / np.outer(sigma, sigma)) - np.eye(len(sigma))
        names = [f"{problem.free[u.free].effect.name} {u.key}" for u in problem.unknowns]
        fitted = [problem.effects(self.z, number) for number in range(len(problem.sessions))]
        out = []
        for place, (unknown, z) in enumerate(zip(problem.unknowns, self.z, strict=True)):
            effect = fitted[unknown.session or 0][unknown.free]
            value = effect.estimates[unknown.key].value
            near = 1e-6 * unknown.step
            out.append(
                Fitted(
                    problem.free[unknown.free].effect.name,
                    unknown.key,
                    None if unknown.session is None else problem.sessions[unknown.session].name,
                    value,
                    float(sigma[place]) * unknown.step,
                    value - float(z) * unknown.step,
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

    @property
    def joint(self) -> JointUncertainty:
        """What the uncertainties of all parameters make of a prediction together."""
        rows = self.columns[self.used]
        variance = np.einsum("uij,jk,uik->ui", rows, self.covariance, rows)
        measured = self.problem.table.measured[self.used]
        mean = (variance * measured).sum(axis=0) / np.maximum(measured.sum(axis=0), 1)
        names = tuple(free.effect.name for free in self.problem.free)
        return JointUncertainty(names, np.sqrt(mean))

    def model(self, session: int = -1) -> ErrorModel:
        """Return the model with the fitted effects, as a session has them."""
        model = self.problem.model
        return model.with_effects(*model.effects, *self.effects(session))


def fit(
    problem: FitProblem,
    start: Array | None = None,
    held_out: Mask | None = None,
    progress: Progress = silent,
    most_ways: int = 3,
) -> Fit:
    """Find the most probable parameters.

    Parameters
    ----------
    problem : FitProblem
        Model, sessions and what may move.
    start : (p,) float, optional
        Where to begin, in steps; if None, at the means of the priors, from where the fit is led in
        stages.
    held_out : (u,) bool, optional
        Units of `problem.table` that the fit must not see.
    progress : callable
        Is told steps done and steps at most.
    most_ways : int
        How many ways to try from the means of the priors where much is left: 1 where an effect is
        known to be missing.

    Returns
    -------
    Fit
        Estimates, uncertainties and what is left.

    Raises
    ------
    InputError
        If no parameter is free, or fewer numbers were measured than parameters without a prior.
    """
    table, weight = problem.table, problem.weights
    unseen = np.zeros(table.n_units, dtype=bool) if held_out is None else held_out
    if not len(weight):
        raise InputError("fit: no parameter is free")
    if (measured := table.measured[~unseen].sum()) < max(1, np.count_nonzero(weight < 1.0)):
        raise InputError(f"fit: only {measured} numbers were measured")
    if start is not None:
        return _settled(problem, start, unseen, NOISE_ROUNDS, progress)
    found_all: list[Fit] = []
    for way in _ways(problem)[:most_ways]:
        z = np.zeros(len(weight))
        for stage in way:
            led = _settled(stage, start_of(stage, problem, z), unseen, 1, silent)
            z = start_of(problem, stage, led.z)
        found_all.append(_settled(problem, z, unseen, NOISE_ROUNDS, progress))
        if _cost(found_all[-1]) < SUSPECT * table.measured[~unseen].sum():
            break
    return min(found_all, key=_cost)


def _ways(problem: FitProblem) -> list[tuple[FitProblem, ...]]:
    """Return the stages of the ways to try, the best one first.

    Flanges touch or do not, so the sum of squares has valleys apart from the deepest one.  Most
    often the way through the set-up, and then through gaps that follow the axes, leads into that.
    """

    def only(kept: Callable[[FreeEffect], bool]) -> FitProblem:
        free = tuple(each if kept(each) else replace(each, scale={}) for each in problem.free)
        return replace(problem, free=free)

    set_up = only(lambda each: each.per_session)
    shimmed = only(lambda each: each.effect.law.id != GAPS)
    if not 0 < len(set_up.unknowns) < len(problem.unknowns):
        return [()]
    if len(shimmed.unknowns) == len(problem.unknowns):
        return [(set_up,)]
    return [(set_up, shimmed), (set_up,), ()]


def _cost(found: Fit) -> float:
    """Sum of squares by the scatter that is known without any fit, for ways to be compared."""
    factor = replace(found.noise, scatter=np.eye(6), colour_share=0.0)
    seen = found.observations.take(found.used)
    white = factor.whiten(seen, seen.values[:, :, None])
    # A unit that counts as lost on one way only must not make that way the better one.
    blank = found.problem.table.measured[found.used].sum() - seen.measured.sum()
    return float((white**2).sum()) + LOST_COST * float(blank)


def _settled(
    problem: FitProblem, z: Array, unseen: Mask, noise_rounds: int, progress: Progress
) -> Fit:
    """Take steps until they are done with the noise as it was found in the last round."""
    table, weight = problem.table, problem.weights
    residual, rounds = problem.residual(z), 0
    noise: NoiseModel | None = None
    for step in range(MOST_STEPS + 1):
        columns = problem.columns(z)
        lost = lost_units(table.with_values(residual), columns, Settings().outlier_limit)
        seen = table.with_values(np.where((lost | unseen)[:, None], np.nan, residual))
        if noise is None or rounds < noise_rounds:
            noise = estimate_noise(seen, columns, np.empty((*residual.shape, 0)))
            if rounds == 0:
                # Far from the end, what the fit has not yet reached would pass for wander.
                noise = _without_colour(noise)
        linear = _Linear.of(seen, noise, columns, residual, weight, z)
        progress(step, MOST_STEPS)
        if rounds == noise_rounds or step == MOST_STEPS:
            break
        sigma = np.sqrt(np.diag(linear.covariance))
        z, residual, taken, fall = _descended(problem, seen, linear, z, residual)
        rounds += fall < SMALL_FALL or bool((np.abs(taken) < CLOSE * sigma).all())
    progress(MOST_STEPS, MOST_STEPS)
    return Fit(
        problem,
        z,
        linear.covariance,
        columns,
        np.where(lost[:, None], np.nan, residual),
        ~unseen,
        linear.noise,
        linear.misfit,
        int(lost.sum()),
        rounds == noise_rounds,
    )


def _without_colour(noise: NoiseModel) -> NoiseModel:
    white = 1.0 - noise.colour_share if noise.source == "given" else 1.0
    return replace(noise, colour_share=0.0, scatter=white * noise.scatter)


def start_of(problem: FitProblem, other: FitProblem, z: Array) -> Array:
    """Return where a problem starts from a point of another one of the same model, (p,).

    Parameters
    ----------
    problem, other : FitProblem
        They may differ in sessions, which go by name, and in what is free.
    z : (q,) float
        Steps of the other's unknowns.
    """
    known = dict(zip(_names(other), z.tolist(), strict=True))
    return np.array([known.get(name, 0.0) for name in _names(problem)])


def _names(problem: FitProblem) -> list[tuple[str, str, str | None]]:
    sessions = [session.name for session in problem.sessions]
    return [
        (
            problem.free[unknown.free].effect.name,
            unknown.key,
            None if unknown.session is None else sessions[unknown.session],
        )
        for unknown in problem.unknowns
    ]


@dataclass(frozen=True, eq=False)
class _Linear:
    """The least squares problem of one step: white rows, then the priors.

    Parameters
    ----------
    noise : NoiseModel
        With a misfit above 1 counted as more noise.
    rows, target : (k, p), (k,) float
        What the step should explain, priors included.
    covariance : (p, p) float
        Of the parameters.
    misfit : float
        Sum of squares at the best step over its degrees of freedom.
    """

    noise: NoiseModel
    rows: Array
    target: Array
    covariance: Array
    misfit: float

    @classmethod
    def of(
        cls,
        seen: Observations,
        noise: NoiseModel,
        columns: Array,
        residual: Array,
        weight: Array,
        z: Array,
    ) -> _Linear:
        white = noise.whiten(seen, np.concatenate([columns, residual[:, :, None]], axis=2))
        design, target = white[:, : len(z)], -white[:, len(z)]
        rows = np.vstack([design, np.diag(weight)])
        left = np.concatenate([target, -weight * z])
        information, prior = design.T @ design, np.diag(weight**2)
        spent = float(np.trace(np.linalg.solve(information + prior, information)))
        best = np.linalg.lstsq(rows, left, rcond=None)[0]
        freedom = max(float(seen.measured.sum()) - spent, 1.0)
        misfit = float(((target - design @ best) ** 2).sum()) / freedom
        more = max(misfit, 1.0)
        share = np.concatenate([np.full(len(design), 1.0 / np.sqrt(more)), np.ones(len(z))])
        return cls(
            replace(noise, scatter=noise.scatter * more),
            rows * share[:, None],
            left * share,
            np.asarray(np.linalg.inv(information / more + prior), dtype=float),
            misfit,
        )


def _descended(
    problem: FitProblem, seen: Observations, linear: _Linear, z: Array, residual: Array
) -> tuple[Array, Array, Array, float]:
    """Take a step, halved until the sum of squares falls.

    Returns
    -------
    (p,), (u, 6) float
        Where it led, and what is left there.
    (p,) float
        The step.
    float
        By how much the sum of squares fell.
    """

    def squares(z: Array, residual: Array) -> float:
        white = linear.noise.whiten(seen, residual[:, :, None])
        return float((white**2).sum() + ((problem.weights * z) ** 2).sum())

    lower, upper = problem.bounds
    move = lsq_linear(linear.rows, linear.target, (lower - z, upper - z), method="bvls").x
    now = squares(z, residual)
    for _ in range(MOST_HALVINGS):
        tried = problem.residual(z + move)
        if (after := squares(z + move, tried)) <= now:
            return z + move, tried, move, now - after
        move = 0.5 * move
    return z, residual, np.zeros_like(move), 0.0
