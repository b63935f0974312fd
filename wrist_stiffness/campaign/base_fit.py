"""The base is refitted before any search: registrations, zeros, tare, and the wrist's tolerances.

Registrations are a millimetre and a fraction of a degree, and a flange touches or does not: so the
fit repeats Gauss-Newton steps on the model itself, and only what is left is taken as linear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import lstsq
from scipy.stats import chi2

from wrist_stiffness.campaign.columns import SessionModel
from wrist_stiffness.campaign.fit_problem import FitProblem
from wrist_stiffness.campaign.free_effects import FreeEffect, commissioning, free_all
from wrist_stiffness.campaign.observing import Observed, UnitSession, tabulate
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.evaluation import situation_of
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.model.situation import Situation

SHIM_UM = 1.5
"""Standard deviation of a flange gap after fitting: shims come in steps of 5 um."""

MOST_STEPS = 12
ENOUGH = 3e-3
"""Relative fall of the sum of squares below which the fit has converged."""

SMALLEST_STEP = 1.0 / 16.0

WANDER = np.repeat([0.5e-6, 5e-6], 3)
"""Slow scatter between units that no instrument states [m, rad]: it only sets weights."""

MEDIAN_CHI2 = float(chi2.ppf(0.5, 1))


@dataclass(frozen=True, eq=False)
class BaseProblem(FitProblem):
    """The fit of a base whose flange gaps are shimmed to its axes at home."""

    @cached_property
    def _models(self) -> tuple[SessionModel, ...]:
        return tuple(SessionModel(self.model, each, ()) for each in self.sessions)

    @cached_property
    def _home(self) -> Situation:
        zero = Block(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 6)), np.zeros((1, 2)))
        return situation_of(self.model.with_effects(), zero, None)

    def effects(self, z: Array, session: int) -> tuple[Effect, ...]:
        """Return the free effects as a session has them, the gaps as shims leave them."""
        found = super().effects(z, session)
        at = self._home
        opened = np.zeros(len(at.parts.sectors.gap))
        for free, effect in zip(self.free, found, strict=True):
            if effect.law.id == "axis_misalignment":
                # The gaps of a calibrated model fit its axes already: only further turns count.
                turned = {key: value - free.effect.si[key] for key, value in effect.si.items()}
                added, _ = effect.law.advance(at, effect.component, turned, None)
                opened += at.carried(added)[1][0]
        return tuple(self._shimmed(effect, opened) for effect in found)

    def _shimmed(self, effect: Effect, opened: Array) -> Effect:
        if effect.law.id != "flange_contact":
            return effect
        own = self._home.parts.sectors.component == ELASTIC.index(effect.component)
        if not own.any():
            return effect
        (parameter,) = effect.parameters
        gap = effect.estimates[parameter.key].value - 1e6 * float(opened[own].mean())
        return effect.with_values(
            {parameter.key: float(np.clip(gap, parameter.lower, parameter.upper))}
        )

    def _residuals(self, number: int, additions: list[tuple[Effect, ...]]) -> list[Array]:
        session = self.sessions[number]
        trials = [(*self.model.effects, *added) for added in additions]
        return [session.residual(each) for each in self._models[number].predicted(trials)]


@dataclass(frozen=True, eq=False)
class BaseFit:
    """The base at its best.

    Parameters
    ----------
    problem : BaseProblem
        What was free.
    z : (p,) float
        Steps from the prior means.
    observed : Observed
        Table of what the fitted base leaves.
    columns : (u, 6, p) float
        Change of what is left by a step of each unknown, about `z` [m, rad].
    """

    problem: BaseProblem
    z: Array
    observed: Observed
    columns: Array

    def models(self, session: int) -> SessionModel:
        """Return the fitted model of one session, on its units."""
        problem = self.problem
        effects = (*problem.model.effects, *problem.effects(self.z, session))
        return SessionModel(problem.model, problem.sessions[session], effects)


def free_base(model: ErrorModel) -> tuple[tuple[FreeEffect, ...], tuple[Effect, ...]]:
    """Return what of the base is free, and the effects that stay as they are."""
    free, held = commissioning(model)
    own = {effect.name: effect for effect in held}
    scale = Effect(find_law("load_scale"), "load_sensor")
    shimmed = [
        replace(each, scale=dict.fromkeys(each.scale, SHIM_UM))
        if each.effect.law.id == "flange_contact"
        else each
        for each in free
    ]
    if scale.name not in own and all(each.effect.name != scale.name for each in free):
        shimmed.append(free_all(scale))
    return tuple(shimmed), held


def fit_base(model: ErrorModel, sessions: tuple[UnitSession, ...]) -> BaseFit:
    """Fit registrations, zeros, tare and tolerances, within their priors.

    Parameters
    ----------
    model : ErrorModel
        Its effects are starts, or held.
    sessions : tuple of UnitSession
        In the order of time.
    """
    free, held = free_base(model)
    problem = BaseProblem(model.with_effects(*held), sessions, free)
    whiten = _whitener(problem)
    z = np.zeros(len(problem.unknowns))
    lower, upper = problem.bounds
    residual = problem.residual(z)
    for _ in range(MOST_STEPS):
        columns = problem.columns(z)
        left = whiten(residual)
        scale = _robust_variance(left)
        step = _step(whiten(columns), left, z * problem.weights, problem.weights, scale)
        before = _cost(left, z, problem.weights, scale)
        size = 1.0
        while True:
            trial = np.clip(z + size * step, lower, upper)
            tried = problem.residual(trial)
            after = _cost(whiten(tried), trial, problem.weights, scale)
            if after < before or size <= SMALLEST_STEP:
                break
            size /= 2.0
        if after >= before:
            break
        z, residual = trial, tried
        if before - after < ENOUGH * before:
            break
    predicted = np.concatenate([each.predicted([each.effects])[0] for each in _at(problem, z)])
    return BaseFit(problem, z, tabulate(model, sessions, predicted), problem.columns(z))


def _at(problem: BaseProblem, z: Array) -> list[SessionModel]:
    return [
        SessionModel(problem.model, session, (*problem.model.effects, *problem.effects(z, number)))
        for number, session in enumerate(problem.sessions)
    ]


def _whitener(problem: BaseProblem):
    """Return the function that brings (u, 6) or (u, 6, p) to unit scatter; NaN become zero."""
    stated = problem.table.covariance
    if stated is None:
        stated = np.diag(4.0 * WANDER**2)
    factor = np.linalg.inv(np.linalg.cholesky(stated + np.diag(WANDER**2)))
    measured = problem.table.measured

    def whiten(values: Array) -> Array:
        columns = values if values.ndim == 3 else values[:, :, None]
        white = factor @ np.where(measured[:, :, None], np.nan_to_num(columns), 0.0)
        flat = white.reshape(-1, columns.shape[2])
        return flat if values.ndim == 3 else flat[:, 0]

    return whiten


def _robust_variance(white: Array) -> float:
    """Variance of what is left, at least that of the noise: priors then hold against an effect."""
    seen = white[white != 0.0]
    return max(1.0, float(np.median(seen**2)) / MEDIAN_CHI2)


def _cost(white: Array, z: Array, prior: Array, scale: float) -> float:
    return float(white @ white / scale + np.sum((prior * z) ** 2))


def _step(columns: Array, left: Array, offset: Array, prior: Array, scale: float) -> Array:
    root = np.sqrt(scale)
    rows = np.vstack([columns / root, np.diag(prior)])
    target = np.concatenate([-left / root, -offset])
    return np.asarray(lstsq(rows, target, lapack_driver="gelsy")[0])
