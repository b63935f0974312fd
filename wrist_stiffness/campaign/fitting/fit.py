"""Fit the free parameters of a model to measured sessions: the maximum of the posterior.

Residuals log(T_measured T_predicted^-1) of the units are made white with the noise that the data
show, priors are further rows, and Gauss-Newton steps within the bounds find the least sum of
squares.  Noise and lost beams depend on the fit, so they are found again at each step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from wrist_stiffness.campaign.fitting.free_effects import FreeEffect
from wrist_stiffness.campaign.fitting.problem import NO_PRIOR, FitProblem
from wrist_stiffness.campaign.fitting.result import Fit
from wrist_stiffness.campaign.fitting.wander import found_wander, with_wander
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.noise import estimate_noise
from wrist_stiffness.inference.observations import Mask, Observations
from wrist_stiffness.inference.outliers import lost_units
from wrist_stiffness.inference.settings import OUTLIER_LIMIT
from wrist_stiffness.inference.whitening import NoiseModel
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.progress import Progress, silent

MOST_STEPS = 40
"""Gauss-Newton steps."""

NOISE_ROUNDS = 2
"""Rounds of steps, the noise estimated at each: without its colour, and with it."""

CLOSE, SMALL_FALL = 0.05, 0.1
"""A round ends when no parameter moves by more than this share of its uncertainty, or the sum of
squares falls by less than this, which no parameter can feel."""

ROUGH = np.tile(np.repeat([30e-6, np.radians(0.09)], 3), (2, 1))
"""Scatter that the measurements are taken to have at first.  Flanges touch or do not, so the sum of
squares has valleys apart from the deepest one; rough data lead into that which the priors favour.
"""

MOST_HALVINGS = 6

NOTHING = np.zeros((2, 6))


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
        Where to begin, in steps; if None, at the means of the priors, from where the fit is led in
        stages.
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
        If fewer numbers were measured than parameters without a prior.
    """
    table, weight = problem.table, problem.weights
    unseen = np.zeros(table.n_units, dtype=bool) if held_out is None else held_out
    if (measured := table.measured[~unseen].sum()) < max(1, np.count_nonzero(weight <= NO_PRIOR)):
        raise InputError(f"fit: only {measured} numbers were measured")
    if start is not None:
        return _settled(problem, start, unseen, NOISE_ROUNDS, progress)
    z = np.zeros(len(weight))
    set_up = replace(problem, free=tuple(_per_session(each) for each in problem.free))
    if 0 < len(set_up.unknowns) < len(weight):
        led = _settled(set_up, start_of(set_up, problem, z), unseen, 1, silent)
        z = start_of(problem, set_up, led.z)
        z = _settled(problem, z, unseen, 1, silent, ROUGH).z
    return _settled(problem, z, unseen, NOISE_ROUNDS, progress)


def _per_session(free: FreeEffect) -> FreeEffect:
    return free if free.per_session else replace(free, scale={})


def _settled(
    problem: FitProblem,
    z: Array,
    unseen: Mask,
    noise_rounds: int,
    progress: Progress,
    wander: Array = NOTHING,
) -> Fit:
    """Take steps until they are done with the noise as it was found in the last round."""
    table, weight = problem.table, problem.weights
    residual, rounds = problem.residual(z), 0
    noise: NoiseModel | None = None
    for step in range(MOST_STEPS + 1):
        columns = problem.columns(z)
        lost = lost_units(table.with_values(residual), columns, OUTLIER_LIMIT)
        seen = table.with_values(np.where((lost | unseen)[:, None], np.nan, residual))
        if rounds and rounds < noise_rounds:
            wander = found_wander(seen, columns, weight, z)
        seen = with_wander(seen, wander)
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
        wander,
        linear.misfit,
        int(lost.sum()),
        rounds == noise_rounds,
    )


def _without_colour(noise: NoiseModel) -> NoiseModel:
    white = 1.0 - noise.colour_share if noise.source == "given" else 1.0
    return replace(noise, colour_share=0.0, beyond=white * noise.beyond)


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
            replace(noise, scale=more),
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

    if not len(z):
        return z, residual, z, 0.0
    lower, upper = problem.bounds
    move = lsq_linear(linear.rows, linear.target, (lower - z, upper - z), method="bvls").x
    now = squares(z, residual)
    for _ in range(MOST_HALVINGS):
        tried = problem.residual(z + move)
        if (after := squares(z + move, tried)) <= now:
            return z + move, tried, move, now - after
        move = 0.5 * move
    return z, residual, np.zeros_like(move), 0.0
