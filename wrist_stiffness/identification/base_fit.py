"""The base is refitted before any search: registrations, zeros, tare, and the wrist's tolerances.

Registrations are a millimetre and a fraction of a degree, and a flange touches or does not: so the
fit repeats Gauss-Newton steps on the model itself, and only what is left is taken as linear.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lstsq
from scipy.special import chdtri

from wrist_stiffness.identification.free_effects import (
    FreeEffect,
    commissioning,
    within_tolerances,
)
from wrist_stiffness.identification.problem import STEP, FitProblem, Unknown
from wrist_stiffness.identification.questions import smooth_columns
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.outliers import OUTLIER_LIMIT, lost_units
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.sessions.columns import SessionModel
from wrist_stiffness.sessions.unit_session import UnitSession
from wrist_stiffness.sessions.units import Mask

MOST_STEPS = 20

COOLING = 0.05
"""Least ratio of the variances of two steps: believed too early, the data close a wrong flange."""

ENOUGH, NEARLY = 3e-3, 3e-2
"""Relative fall of the sum of squares below which a fit has converged; the second of a quick fit,
and over wide differences."""

SMALLEST_STEP = 1.0 / 16.0

BEGUN_WITH = 60
"""Measured units of each session, evenly spread, with which a fit begins: registrations are far off
at first, and few units bring them near."""

WIDTHS = (3.0, 1.0, 0.3, 0.1)
"""Widths of differences, in standard deviations of the priors, with which a fit that begins far off
begins once more: the sum of squares has a kink for every unit in which a flange touches or a pin
turns over, and slopes lead no further than the next one; a wide difference sees past them
(graduated non-convexity, Blake and Zisserman 1987; `pytest test/identification/test_base_fit.py -k
lead`)."""

ELSEWHERE = 1.5
"""Standard deviations from the mean at which a gap begins again (1, 1.5 and 2 lead as far)."""

MOST_CLEANINGS = 3
"""Fits after which lost beams are looked for."""

Base = tuple[tuple[FreeEffect, ...], tuple[Effect, ...]]
"""What of a model is free, and what stays as it is."""

MEDIAN_CHI2 = float(chdtri(1, 0.5))


@dataclass(frozen=True, eq=False)
class BaseFit:
    """The base at its best, with further effects where some were fitted along."""

    problem: FitProblem  # what was free
    z: Array  # (p,), steps from the prior means
    residual: Array  # (u, 6), what is left, log(T_measured T_predicted^-1) at O in F [m, rad]
    # (u, 6, p), change of what is left by a step of each unknown [m, rad], from where the last step
    # began
    columns: Array
    bare: FitProblem  # the base alone
    firm: FitProblem  # the base with those extras beside which its columns are taken

    @property
    def extras(self) -> tuple[str, ...]:
        """Names of the further effects."""
        return tuple(free.effect.name for free in self.problem.free[len(self.bare.free) :])

    @property
    def cost(self) -> float:
        """Weighted sum of squares with the priors' part, in units of the noise."""
        return _cost(self.problem.whiten(self.residual), self.z, self.problem.weights, 1.0)

    def with_columns_here(self) -> BaseFit:
        """Return the fit with the columns of the very point where it ended."""
        return replace(self, columns=_columns(self.problem, self.firm, self.z))

    @property
    def prior_std(self) -> Array:
        """Standard deviations of the priors of the base in steps, (p,); infinite for none."""
        return np.where(self.of_base & (self.problem.weights == 1.0), 1.0, np.inf)

    @property
    def of_base(self) -> Mask:
        """Which unknowns belong to the base, (p,) bool."""
        usual = len(self.bare.free)
        return np.array([unknown.free < usual for unknown in self.problem.unknowns], dtype=bool)

    def beyond(self) -> dict[str, Effect]:
        """Return the extras by their names, of those on top of the base only what is on top."""
        usual, found = len(self.bare.free), {}
        for place, free in enumerate(self.problem.free[usual:], usual):
            # On a bound the way to steps and back rounds beyond it.
            values = {
                u.key: u.value(z)
                for u, z in zip(self.problem.unknowns, self.z.tolist(), strict=True)
                if u.free == place
            }
            found[free.effect.name] = free.effect.with_values(values)
        return found

    @property
    def variance(self) -> float:
        """Mean square of what is left, in units of the noise."""
        white = self.problem.whiten(self.residual)
        return float(white @ white) / np.count_nonzero(self.problem.table.measured)

    def effects(self, session: int) -> tuple[Effect, ...]:
        """Return the fitted effects of one session, also those that were held."""
        return (*self.problem.model.effects, *self.problem.effects(self.z, session))

    def model(self, session: int) -> SessionModel:
        """Return the fitted model of one session, on its units."""
        problem = self.problem
        return SessionModel(problem.model, problem.sessions[session], self.effects(session))


def free_base(model: ErrorModel) -> Base:
    """Return what of the base is free, and the effects that stay as they are."""
    free, held = commissioning(model)
    return within_tolerances(free), held


def fit_base(
    model: ErrorModel,
    sessions: tuple[UnitSession, ...],
    extras: Sequence[Effect] = (),
    start: BaseFit | None = None,
    base: Base | None = None,
    quickly: bool = False,
    gradually: bool = False,
) -> BaseFit:
    """Fit registrations, zeros, tare and tolerances, within their priors.

    Parameters
    ----------
    model : ErrorModel
        Its effects are starts, or held.
    sessions : tuple of UnitSession
        In the order of time.
    extras : sequence of Effect, optional
        Effects fitted along, from the values that they have, with priors about zero as wide as
        they are large, at least of the typical magnitude: what the data do not show stays small.
        One that belongs to the base comes on top of what the wrist was built with.
    start : BaseFit, optional
        Where the base begins.
    base : (tuple of FreeEffect, tuple of Effect), optional
        What of the model is free and what stays as it is; by default as `free_base` says.
    quickly : bool
        Whether the columns of the base's start serve to the end: nearly as far, far quicker.
    gradually : bool
        Whether it begins with few units over wide differences, and takes the base's columns beside
        play too; else as if no play were there, which is far quicker and leads nearly as far.
    """
    free, held = base or free_base(model)
    added = {effect.name: effect for effect in extras}
    usual = {each.effect.name for each in free}
    # Those on top of the base follow it, and play comes last.
    ordered = sorted(added.values(), key=lambda e: (e.law.state_is_a_guess, e.name not in usual))
    more = [_about_zero(each) for each in ordered]
    alone = FitProblem(model.with_effects(*held), sessions, free)
    same = start is not None and start.bare.same_as(alone)
    if start is not None and same:
        alone = start.bare
    problem = replace(alone, free=(*free, *more))
    count = len(ordered) if gradually else sum(not e.law.state_is_a_guess for e in ordered)
    firm = problem if count == len(more) else alone
    if 0 < count < len(more):
        firm = replace(alone, free=(*free, *more[:count]))
    z = _start(problem, start, added)
    near, known = _near(problem, start) if start is not None and same else (None, None)
    few = _few(problem) if gradually else problem
    for width in WIDTHS if gradually else ():
        z = _led(few, z, width).z
    enough = NEARLY if quickly else ENOUGH
    return _descended(problem, alone, firm, z, enough, near, known, quickly)


def fit_cleaned(problem: FitProblem, start: Array | None = None) -> tuple[BaseFit, int]:
    """Fit a problem as it stands, without units that no smooth law could explain: lost beams.

    `problem`: what is free; `start` (p,): where to begin, in steps; by default at the means of the
    priors.
    Returns the fit, whose problem lacks those units, and how many there were.
    """
    if start is None:
        start = _led(_few(problem), np.zeros(len(problem.unknowns))).z
    found, total = _descended(problem, problem, problem, start), 0
    for _ in range(MOST_CLEANINGS):
        table = problem.table.with_values(found.residual)
        # Exact data scatter by rounding: what is lost is far beyond the noise as well.
        white = problem.whiten(found.residual).reshape(table.values.shape)
        lost = unexplained_units(table, found.columns)
        lost &= np.abs(white).max(axis=1) > OUTLIER_LIMIT
        if not lost.any():
            break
        total += int(lost.sum())
        problem = replace(problem, sessions=without_units(problem.sessions, lost))
        near = found.columns[~lost]
        found = _descended(problem, problem, problem, found.z, near=near)
    return found, total


def unexplained_units(left: Observations, columns: Array) -> Mask:
    """Return which units (u,) of what a fit left no smooth law explains, nor its own columns.

    `columns` (u, m, p): slopes of the fit.
    """
    beside = [smooth_columns(left), *([] if left.common is None else [left.common])]
    everything = np.concatenate([columns, *beside], axis=2)
    # What is left of the base after its fit is small: nothing of it must be in the model.
    return lost_units(left, everything[:, :, :0], everything, OUTLIER_LIMIT)


def without_units(sessions: tuple[UnitSession, ...], aside: Mask) -> tuple[UnitSession, ...]:
    """Return sessions as if nothing had been measured in some units (u,) of all measured ones."""
    parts, start = [], 0
    for each in sessions:
        rows = np.flatnonzero(each.measured)
        own = rows[aside[start : start + len(rows)]]
        start += len(rows)
        parts.append(each.without(own))
    return tuple(parts)


def best_valley(problem: FitProblem) -> BaseFit:
    """Return the best of several fits to a few units of each session.

    A flange touches or does not: the sum of squares has a minimum each, and steps do not go from
    one to the other.  So the fit begins again over wide differences, where a wrist within its
    tolerances would be, and with each gap on either side.
    """
    few = _few(problem)
    z = np.zeros(len(few.unknowns))
    sharp = _led(few, z)
    for width in WIDTHS:
        z = _led(few, z, width).z
    found = [sharp, _led(few, z)]
    if (tight := within_tolerances(few.free)) != few.free:
        found.append(_led(few, _as_drawn(few, tight)))
    for place, unknown in enumerate(few.unknowns):
        if not (unknown.parameter.linear or unknown.effect.law.smooth):
            for side in (-ELSEWHERE, ELSEWHERE):
                start = sharp.z.copy()
                start[place] = side
                found.append(_led(few, np.clip(start, *few.bounds)))
    best = min(found, key=lambda each: each.cost)
    return _descended(few, few, few, best.z)


def _as_drawn(problem: FitProblem, within: tuple[FreeEffect, ...]) -> Array:
    """Return where a fit ends that holds the wrist within its tolerances, (p,) steps."""
    tight = replace(problem, free=within)
    found = _led(tight, np.zeros(len(tight.unknowns))).z
    ratio = [t.step / own.step for t, own in zip(tight.unknowns, problem.unknowns, strict=True)]
    return found * ratio


def _few(problem: FitProblem) -> FitProblem:
    """Return the problem of a few units of each session."""
    return replace(problem, sessions=tuple(s.thinned(BEGUN_WITH) for s in problem.sessions))


def _led(problem: FitProblem, start: Array, width: float = STEP) -> BaseFit:
    """Return where steps end nearly."""
    return _descended(problem, problem, problem, start, NEARLY, width=width)


def _descended(
    problem: FitProblem,
    bare: FitProblem,
    firm: FitProblem,
    z: Array,
    enough: float = ENOUGH,
    near: Array | None = None,
    known: Mask | None = None,
    kept: bool = False,
    width: float = STEP,
) -> BaseFit:
    """Return where Gauss-Newton steps lead from `z`.

    Columns cost by far the most and hardly change about a fit: those of `near` (u, 6, p), where
    there is one, serve until they lead no further; all of them, or the `known` ones (p,).  The end
    is after a step with all columns of the very point where it began that gains next to nothing;
    where these are `kept`, it is where they lead no further.  A fit that begins far off takes
    differences, which see flanges that touch within a step, and so does one whose columns are
    `kept`; near by, slopes are as good.
    """
    lower, upper = problem.bounds
    weights = problem.weights
    residual = problem.residual(z)
    scale, columns, slopes = 0.0, near, near is not None and not kept
    for _ in range(MOST_STEPS):
        fresh = columns is None
        columns = _columns(problem, firm, z, columns, known, width, slopes)
        left = problem.whiten(residual)
        found = _robust_variance(left)
        scale = max(found, COOLING * scale)
        cooled = scale == found
        step = _step(problem.whiten(columns), left, z * weights, weights, scale)
        before = _cost(left, z, weights, scale)
        size = 1.0
        while True:
            trial = np.clip(z + size * step, lower, upper)
            try:
                tried = problem.residual(trial)
                after = _cost(problem.whiten(tried), trial, weights, scale)
            except UndefinedFormulaError:
                after = np.inf
            if after < before or size <= SMALLEST_STEP:
                break
            size /= 2.0
        if after < before:
            z, residual = trial, tried
        small = cooled and before - after < enough * before
        if small and (fresh or kept):
            return BaseFit(problem, z, residual, columns, bare, firm)
        if small or near is None:
            columns = None
    return BaseFit(problem, z, residual, _columns(problem, firm, z, slopes=slopes), bare, firm)


def _columns(
    problem: FitProblem,
    firm: FitProblem,
    z: Array,
    near: Array | None = None,
    known: Mask | None = None,
    width: float = STEP,
    slopes: bool = False,
) -> Array:
    """Return the columns of one problem, and of what another has on top of it, (u, 6, p).

    Play would be solved again for each column of the base.

    `problem`, `firm`: the whole, and the one beside which columns of its own unknowns are taken;
    `z` (p,): where; `near` (u, 6, p): columns of a point near by; `known` (p,): which of them
    serve, by default all; `width`, `slopes`: as for `FitProblem.columns`.
    """
    columns = np.zeros((*problem.table.values.shape, len(z))) if near is None else near.copy()
    wanted = np.full(len(z), near is None)
    if near is not None and known is not None:
        wanted = ~known
    in_firm = np.array([each.free < len(firm.free) for each in problem.unknowns], dtype=bool)
    for of, own in ((firm, np.flatnonzero(in_firm)), (problem, np.arange(len(z)))):
        here = wanted[own] if of is firm else wanted & ~in_firm
        if here.any():
            places = None if here.all() else tuple(np.flatnonzero(here).tolist())
            columns[:, :, own[here]] = of.columns_at(z[own], places, width, slopes)
    return columns


def _about_zero(effect: Effect) -> FreeEffect:
    """Return an effect with priors about its absence; shapes, which have a mean, are free."""
    sizes = [p for p in effect.parameters if p.mean == 0.0 and np.isfinite(p.scale)]
    found = {p.key: abs(effect.estimates[p.key].value) / p.scale for p in sizes}
    linear = [found[p.key] for p in sizes if p.linear]
    together = float(np.sqrt(np.mean(np.square(linear)))) if linear else 0.0
    scale = dict.fromkeys((p.key for p in effect.parameters), np.inf)
    sized = effect.law.sized_by(effect.component)
    for p in sizes:
        wide = max(1.0, together if p.linear else found[p.key]) if p.key in sized else 1.0
        scale[p.key] = p.scale * wide
    return FreeEffect(effect.with_values({p.key: 0.0 for p in sizes}), scale)


def _start(problem: FitProblem, start: BaseFit | None, added: Mapping[str, Effect]) -> Array:
    """Return where the unknowns begin: where another fit left them, and effects at their values."""
    usual = len(problem.free) - len(added)
    known: dict[tuple[str, str, int | None, bool], float] = {}
    if start is not None:
        known = {
            _key(u, len(start.bare.free)): u.mean + z * u.step
            for u, z in zip(start.problem.unknowns, start.z, strict=True)
        }
    found = []
    for u in problem.unknowns:
        own = _key(u, usual)
        at = u.mean if u.free < usual else added[u.effect.name].estimates[u.key].value
        found.append((known.get(own, at) - u.mean) / u.step)
    return np.array(found)


def _near(problem: FitProblem, start: BaseFit) -> tuple[Array, Mask]:
    """Return the columns where another fit ended, (u, 6, p), and which unknowns it had, (p,)."""
    columns = np.zeros((*problem.table.values.shape, len(problem.unknowns)))
    known = np.zeros(len(problem.unknowns), dtype=bool)
    usual = len(start.bare.free)
    had = {_key(u, usual): (place, u.step) for place, u in enumerate(start.problem.unknowns)}
    for place, unknown in enumerate(problem.unknowns):
        if (key := _key(unknown, usual)) in had:
            at, step = had[key]
            columns[:, :, place] = start.columns[:, :, at] * (unknown.step / step)
            known[place] = True
    return columns, known


def _key(unknown: Unknown, usual: int) -> tuple[str, str, int | None, bool]:
    """Return what an unknown is called in all fits beside the same base of `usual` effects."""
    return unknown.effect.name, unknown.key, unknown.session, unknown.free < usual


def _robust_variance(white: Array) -> float:
    """Variance of what is left, at least that of the noise.

    Priors then hold against an effect that is not there yet, or not at its value: a base that gave
    way to it once does not come back.
    """
    seen = white[white != 0.0]
    return max(1.0, float(np.median(seen**2)) / MEDIAN_CHI2)


def _cost(white: Array, z: Array, prior: Array, scale: float) -> float:
    return float(white @ white / scale + np.sum((prior * z) ** 2))


def _step(columns: Array, left: Array, offset: Array, prior: Array, scale: float) -> Array:
    root = np.sqrt(scale)
    rows = np.vstack([columns / root, np.diag(prior)])
    target = np.concatenate([-left / root, -offset])
    return np.asarray(lstsq(rows, target, lapack_driver="gelsy")[0])
