"""Add one effect to a model and fit it together with what is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.base_fit import fit_base
from wrist_stiffness.identification.calibration import said_calibrated, told_model
from wrist_stiffness.identification.free_effects import (
    FreeEffect,
    commissioning,
    within_tolerances,
)
from wrist_stiffness.identification.held_out import Judge
from wrist_stiffness.identification.problem import FitProblem, require_units
from wrist_stiffness.identification.result import FittedParameter
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.held_out import HeldOut, bought, refuted
from wrist_stiffness.inference.observations import Quantity
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.numerals import number
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.refitted import AXES, TOLERATED
from wrist_stiffness.sessions.unit_session import QUANTITIES, UnitSession, all_units

STEPS = 5
"""That are told of."""

MOVED = 2.0
"""Uncertainties, of before, by which a parameter of the base must move to be named."""

SIGNIFICANT = 2.0
"""Uncertainties that tell something from nothing."""

MOST_FAR = 3
"""So many parameters far beyond their typical magnitude are named, the furthest first."""


@dataclass(frozen=True, eq=False)
class Extension:
    """A model with one more effect."""

    effect: Effect  # what was added, as it was given
    fit: WristFit  # of everything together, to all recordings
    without: WristFit  # without the effect, where its first steps ended
    # without and with the effect, of units that neither fit has seen
    before: HeldOut
    after: HeldOut
    judged_by: str  # which those are

    @cached_property
    def model(self) -> ErrorModel:
        """The extended model of the newest session."""
        return told_model(self.fit, keep=(self.effect.name,))

    @cached_property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted."""
        return self.fit.parameters

    @cached_property
    def base(self) -> WristFit:
        """Fit without the effect, to all recordings."""
        return self.without.settled()

    @property
    def own(self) -> tuple[FittedParameter, ...]:
        """Parameters of the effect itself."""
        return tuple(each for each in self.parameters if each.effect == self.effect.name)

    @property
    def log_gain(self) -> float:
        """Natural logarithm of the evidence with the effect over that without it.

        It says nothing of an effect without a typical magnitude, such as a formula's.
        """
        return self.fit.evidence.log - self.base.evidence.log

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What was measured."""
        return self.fit.problem.table.reported

    @cached_property
    def bought(self) -> dict[str, tuple[float, float]]:
        """Fall of the held-out error and its standard uncertainty, by the key of the quantity."""
        seen = self.after.rms(self.quantities)
        return {q.key: bought(self.before, self.after, q) for q in self.quantities if q.key in seen}

    @property
    def base_moved(self) -> tuple[tuple[FittedParameter, FittedParameter], ...]:
        """Parameters of the base before and after, of those that the effect moved."""
        after = {(p.effect, p.key, p.session): p for p in self.parameters}
        pairs = [
            (p, after[p.effect, p.key, p.session])
            for p in self.base.parameters
            if p.effect != self.effect.name
        ]
        moved = [
            (abs(b.value - a.value) / a.sigma, a, b)
            for a, b in pairs
            if abs(b.value - a.value) > MOVED * a.sigma
        ]
        return tuple((a, b) for _, a, b in sorted(moved, key=lambda each: -each[0]))

    @cached_property
    def _unsure_by(self) -> dict[str, float]:
        """One standard uncertainty of what the effect does to the platform, RMS by quantity."""
        fit, at = self.fit, self.fit.places[self.effect.name]
        rows = fit.problem.twists(fit.z)[:, :, at]
        variance = np.einsum("uij,jk,uik->ui", rows, fit.covariance[np.ix_(at, at)], rows)
        mean = np.maximum(variance.mean(axis=0), 0.0)
        return {
            q.key: float(np.sqrt(mean[list(q.components)].sum())) * q.per_si for q in QUANTITIES
        }

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
            out.append(f"not identifiable from these recordings: {keys}; needs {law.excited_by}")
        if far:
            sizes = ", ".join(f"{each.key} is {abs(each.moved):.1f} x" for each in far[:MOST_FAR])
            more = f" ({len(far) - MOST_FAR} more are far off)" if len(far) > MOST_FAR else ""
            check = law.check.replace("{place}", place)
            out.append(f"{sizes} the typical magnitude{more}: {check}")
        told = [each for each in self.own if each.excited]
        if told and all(abs(each.value) < SIGNIFICANT * each.sigma for each in told):
            out.append("none of its parameters differs from zero by more than chance")
        error = self.before.rms(self.quantities)
        for quantity in QUANTITIES:
            sigma, whole = self._unsure_by[quantity.key], error.get(quantity.key, np.inf)
            if sigma > whole:
                out.append(
                    f"it may move the platform by {number(sigma)} {quantity.unit} more or less, "
                    f"where the whole error is {number(whole)}: these recordings do not tell it "
                    "from the set-up, and nodes would apply all of it"
                )
        if refuted(self.before, self.after):
            out.append("the error on the unseen part GROWS: leave this effect out")
        elif not refuted(self.after, self.before):
            out.append("the error on the unseen part does not fall beyond chance")
        return tuple(out)


def extend(
    model: ErrorModel,
    effect: Effect,
    sessions: Sequence[MeasuredSession],
    progress: Progress = silent,
    known: WristProblem | None = None,
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
        Told steps done and in all.
    known : WristProblem, optional
        Of these sessions; used where it asks the same, so that nothing is fitted twice.

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
    free, held = base_beside(model, effect, sessions)
    # A tolerance that is found is one no more: the usual prior would hold it back.
    others = tuple(each for each in free if each.effect.name != effect.name)
    if known is None or not known.asks(model, (others, held)):
        known = None
        units = all_units(model, sessions)
    else:
        units = known.begin().base.problem.sessions
    _require_signals(model, effect, units)
    require_units(FitProblem(model.with_effects(*held), units, free))
    progress(0, STEPS)
    problem = known or WristProblem(model, units, (others, held))
    base = problem.begin()
    progress(1, STEPS)
    grown = problem.extended(base, effect)
    progress(2, STEPS)
    found = grown.settled()
    progress(3, STEPS)
    judge = Judge(base.base)
    seen, own = judge.seen, list(grown.base.beyond().values())
    before = judge.left(fit_base(model, seen, (), base.base, base=(free, held)))
    # A pin that rests where it does leads back there; from the nominal model it may not.
    after = judge.left(fit_base(model, seen, own, found.base, base=(others, held)))
    progress(4, STEPS)
    if others != free:
        sessions_used = grown.base.problem.sessions
        whole = fit_base(model, sessions_used, (), base.base, base=(free, held))
        base = WristFit(whole, problem.table)
    progress(STEPS, STEPS)
    return Extension(effect, found, base, before, after, judge.by)


def base_beside(
    model: ErrorModel, effect: Effect, sessions: Sequence[MeasuredSession]
) -> tuple[tuple[FreeEffect, ...], tuple[Effect, ...]]:
    """Return what of the base is free beside an effect, and what stays as it is.

    Raises `InputError` if the model has the effect already or calibration fits it anyway.
    """
    loose, held = commissioning(model, said_calibrated(sessions))
    free = within_tolerances(loose, shimmed=effect.law.id != AXES)
    tolerances = {each.effect.name for each in free if each.effect.law.id in TOLERATED}
    # A tolerance of the model was calibrated only, or was found.
    found = {step.added for step in model.lineage} | ({effect.name} - tolerances)
    if effect.name in found and any(own.name == effect.name for own in model.effects):
        raise InputError(f"{effect.name}: the model has it already; 'calibrate' fits it again")
    if any(each.effect.name == effect.name and each.per_session for each in free):
        raise InputError(
            f"{effect.name}: 'calibrate' fits it anew to every recording, there is nothing to add"
        )
    return free, held


def _require_signals(model: ErrorModel, effect: Effect, units: Sequence[UnitSession]) -> None:
    """Refuse an effect without its signals: its parameters would stay at nothing in silence."""
    for each in units:
        tried = model.with_effects().batch_with(each.block.take(slice(0, 2)), [(effect,)])[0]
        if signal := tried.lacking.get(effect.name):
            raise InputError(f"{each.name}: {effect.name}: {signal} is missing")
