"""Add one effect to a model and fit it together with what is there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wrist_stiffness.campaign.fitting.calibrate import said_calibrated, told_model
from wrist_stiffness.campaign.fitting.fit import fit, start_of
from wrist_stiffness.campaign.fitting.free_effects import (
    FreeEffect,
    commissioning,
    within_tolerances,
)
from wrist_stiffness.campaign.fitting.judge import Judged, judged
from wrist_stiffness.campaign.fitting.problem import FitProblem
from wrist_stiffness.campaign.fitting.result import Fit, FittedParameter
from wrist_stiffness.campaign.fitting.start_search import start_values
from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.noise_floor import NoiseFloor, noise_floor
from wrist_stiffness.campaign.refitted import AXES, TOLERATED
from wrist_stiffness.campaign.unit_session import UnitSession, as_units
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.held_out import bought, refuted
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.progress import Progress, silent

MOVED = 2.0
"""Uncertainties, of before, by which a parameter of the base must move to be named."""

WORTH_WIDENING = 1.15
"""A prior is made wider if its parameters are so many times its width."""

HASTE = 2.0
"""Power by which a round widens more than the parameters, held back by the old priors, ask for."""

MOST_WIDENINGS, MOST_WIDENED = 4, 100.0
"""Rounds, and how much wider a prior may become."""

SIGNIFICANT = 2.0
"""Uncertainties that tell something from nothing."""

MOST_FAR = 3
"""So many parameters far beyond their usual size are named, the furthest first."""


@dataclass(frozen=True, eq=False)
class Extension:
    """A model with one more effect.

    Parameters
    ----------
    effect : Effect
        What was added, as it was given.
    fit : Fit
        Of everything together to all recordings.
    before, after : Judged
        Without and with the effect, by units that neither fit has seen.
    """

    effect: Effect
    fit: Fit
    before: Judged
    after: Judged

    @cached_property
    def model(self) -> ErrorModel:
        """The extended model of the newest session."""
        return told_model(self.fit, keep=(self.effect.name,))

    @cached_property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted."""
        return self.fit.parameters

    @property
    def own(self) -> tuple[FittedParameter, ...]:
        """Parameters of the effect itself."""
        return tuple(each for each in self.parameters if each.effect == self.effect.name)

    @cached_property
    def floor(self) -> NoiseFloor:
        """Scatter of the units that judge."""
        return noise_floor(self.after.observations)

    @cached_property
    def bought(self) -> dict[str, tuple[float, float]]:
        """Fall of the held-out error and its standard uncertainty, by the key of the quantity."""
        judge = self.after.fit
        return {
            q.key: bought(self.before.held_out(judge), self.after.held_out(judge), q)
            for q in self.after.observations.reported
        }

    @property
    def base_moved(self) -> tuple[tuple[FittedParameter, FittedParameter], ...]:
        """Parameters of the base before and after, of those that the effect moved, farthest first.

        Both from the recordings without the held-out part.
        """
        after = {(p.effect, p.key, p.session): p for p in self.after.fit.parameters}
        pairs = [
            (p, after[p.effect, p.key, p.session])
            for p in self.before.fit.parameters
            if p.effect != self.effect.name
        ]
        moved = [
            (abs(b.value - a.value) / a.sigma, a, b)
            for a, b in pairs
            if abs(b.value - a.value) > MOVED * a.sigma
        ]
        return tuple((a, b) for _, a, b in sorted(moved, key=lambda each: -each[0]))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the effect, a sentence each."""
        out = []
        law, place = self.effect.law, self.effect.component
        # On a bound of zero a parameter is nothing, which every effect may be in part.
        bounded = [each for each in self.own if each.at_bound and each.value != 0.0]
        untold = [each for each in self.own if not (each.at_bound or each.excited)]
        far = [each for each in self.own if each.far and not each.at_bound]
        far.sort(key=lambda each: -abs(each.moved))
        if bounded:
            keys = ", ".join(each.key for each in bounded)
            out.append(f"on its bound: {keys}; the data ask for what cannot be")
        if untold:
            keys = ", ".join(each.key for each in untold)
            out.append(f"not told by these recordings: {keys}; needs {law.excited_by}")
        if far:
            sizes = ", ".join(f"{each.key} is {abs(each.moved):.1f} x" for each in far[:MOST_FAR])
            more = f" ({len(far) - MOST_FAR} more are far off)" if len(far) > MOST_FAR else ""
            check = law.check.replace("{place}", place)
            out.append(f"{sizes} its usual size{more}: {check}")
        told = [each for each in self.own if each.excited]
        if told and all(abs(each.value) < SIGNIFICANT * each.sigma for each in told):
            out.append("none of its parameters differs from zero by more than chance")
        judge = self.after.fit
        without, with_it = self.before.held_out(judge), self.after.held_out(judge)
        if refuted(without, with_it):
            # Its RMS may fall all the same: there wander counts like white noise.
            out.append(
                "the error on the unseen part GROWS, weighed with the noise and its wander: leave "
                "this effect out"
            )
        elif not refuted(with_it, without):
            out.append("the error on the unseen part does not fall beyond chance")
        return tuple(out)


def extend(
    model: ErrorModel,
    effect: Effect,
    sessions: Sequence[MeasuredSession],
    progress: Progress = silent,
) -> Extension:
    """Add an effect, fit it with everything else, and judge it by units that were not seen.

    Parameters
    ----------
    model : ErrorModel
        What is there.
    effect : Effect
        What is added; its values are starts where its law knows no prior.
    sessions : sequence of MeasuredSession
        In the order of time.
    progress : callable
        Told steps done and steps at most of each fit in turn: four, and one more for each time
        that the effect's prior is made wider.

    Returns
    -------
    Extension
        Fitted and judged.

    Raises
    ------
    InputError
        If the model has the effect already or calibration fits it anyway, or the recordings lack a
        signal that it needs.
    """
    loose, held = commissioning(model, said_calibrated(sessions))
    free = within_tolerances(loose, shimmed=effect.law.id != AXES)
    _require_new(model, effect, free)
    units = tuple(as_units(model, session) for session in sessions)
    _require_signals(model, effect, units)
    base = FitProblem(model.with_effects(*held), units, free)
    before = judged(base, progress=progress)
    # A tolerance that is found is one no more: the usual prior would hold it back.
    others = tuple(each for each in free if each.effect.name != effect.name)
    without = before if others == free else judged(replace(base, free=others), progress=progress)
    values = start_values(without.fit, effect)
    own = _free(effect, units)
    wide = replace(base, free=(*others, own))
    start = _with_effect(wide, without.fit, values)
    wide, after = _judged_at_size(wide, start, progress)
    everything = fit(wide, start_of(wide, after.fit.problem, after.fit.z), progress=progress)
    return Extension(effect, everything, before, after)


def _judged_at_size(
    wide: FitProblem, start: tuple[FitProblem, Array], progress: Progress
) -> tuple[FitProblem, Judged]:
    """Judge the fit with the priors of the effect, the last one, as wide as it turns out large.

    A prior of the usual size would hold a fault that is far beyond it back; and what is held back
    goes into whatever else is free, most of all into the tare.
    """
    # Flanges and play let a base that took up a part of the effect not find back: from the drawing.
    starts = judged(wide, start, progress), judged(wide, progress=progress)
    after = min(starts, key=_left_beside(*starts))
    for _ in range(MOST_WIDENINGS):
        own = wide.free[-1]
        widening = _widened(own, _sizes(after.fit))
        if widening == own.widening:
            break
        wide = replace(wide, free=(*wide.free[:-1], replace(own, widening=widening)))
        after = judged(wide, (after.fit.problem, after.fit.z), progress)
    return wide, after


def _left_beside(one: Judged, other: Judged) -> Callable[[Judged], float]:
    """Return the sum of squares that each of two leaves, priors included, by the noise of one.

    Of the units that both kept: else the one that takes more for lost beams would leave less.
    """
    noise, seen = one.fit.noise, one.fit.seen
    kept = np.isfinite(one.fit.residual) & np.isfinite(other.fit.residual)

    def left(each: Judged) -> float:
        found = each.fit
        white = noise.whiten(seen, np.where(kept, found.residual, 0.0)[:, :, None])
        return float((white**2).sum() + ((found.problem.weights * found.z) ** 2).sum())

    return left


def _widened(own: FreeEffect, sizes: Mapping[str, float]) -> dict[str, float]:
    """Return how wide the priors of an effect should be, never less than they are.

    A common factor on all parameters that the effect is proportional to is the most probable one
    (empirical Bayes): those that are not told still stay at nothing.  Any other that is nothing as
    a rule has a factor of its own; shapes, which have a mean, keep their prior.

    Parameters
    ----------
    own : FreeEffect
        With its priors as they are.
    sizes : dict of str to float
        How large its parameters are, in usual widths.
    """
    known = [p for p in own.effect.parameters if p.key in sizes and np.isfinite(p.scale)]
    linear = [sizes[p.key] for p in known if p.linear]
    together = float(np.sqrt(np.mean(np.square(linear)))) if linear else 0.0
    widening = dict(own.widening)
    for p in known:
        if p.linear or p.mean == 0.0:
            now = widening.get(p.key, 1.0)
            beyond = (together if p.linear else sizes[p.key]) / now
            if beyond > WORTH_WIDENING:
                widening[p.key] = min(now * beyond**HASTE, MOST_WIDENED)
    return widening


def _sizes(found: Fit) -> dict[str, float]:
    """Return the root mean squares of the last effect's parameters in usual widths."""
    last = len(found.problem.free) - 1
    square = found.z**2 + np.diag(found.covariance)
    return {
        unknown.key: float(np.sqrt(size))
        for unknown, size in zip(found.problem.unknowns, square, strict=True)
        if unknown.free == last
    }


def _free(effect: Effect, units: Sequence[UnitSession]) -> FreeEffect:
    """Return the effect with all parameters free that do anything in these recordings."""
    signals = frozenset.intersection(*(frozenset(each.block.temperatures) for each in units))
    known = all(np.isfinite(parameter.scale) for parameter in effect.parameters)
    idle = effect.law.linearised(effect.component, signals).idle if known else ()
    scale = {p.key: p.scale for p in effect.parameters if p.key not in idle}
    return FreeEffect(effect, scale)


def _with_effect(wide: FitProblem, base: Fit, values: dict[str, float]) -> tuple[FitProblem, Array]:
    """Return the point of the base's fit with an effect's values added."""
    problem = replace(wide, sessions=base.problem.sessions)
    z = start_of(problem, base.problem, base.z)
    for place, unknown in enumerate(problem.unknowns):
        if unknown.free == len(problem.free) - 1 and unknown.key in values:
            z[place] = (values[unknown.key] - unknown.mean) / unknown.step
    return problem, z


def _require_new(model: ErrorModel, effect: Effect, free: Sequence[FreeEffect]) -> None:
    tolerances = {each.effect.name for each in free if each.effect.law.id in TOLERATED}
    # A tolerance of the model was calibrated only, or was found.
    found = {step.added for step in model.lineage} | ({effect.name} - tolerances)
    if effect.name in found and any(own.name == effect.name for own in model.effects):
        raise InputError(f"{effect.name}: the model has it already; 'calibrate' fits it again")
    if any(each.effect.name == effect.name and each.per_session for each in free):
        raise InputError(
            f"{effect.name}: 'calibrate' fits it anew to every recording, there is nothing to add"
        )


def _require_signals(model: ErrorModel, effect: Effect, units: Sequence[UnitSession]) -> None:
    """Refuse an effect without its signals: its parameters would stay at nothing in silence."""
    for each in units:
        tried = model.with_effects().batch_with(each.block.take(slice(0, 2)), [(effect,)])[0]
        if signal := tried.lacks(effect.name):
            raise InputError(f"{each.name}: {effect.name}: {signal} is missing")
