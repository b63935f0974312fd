"""What a change of a model's effects does to the units of a session: columns by differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import cached_property

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.batch import Recent
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.evaluation import evaluate
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.model.held import HeldLaw
from wrist_stiffness.sessions.unit_session import UnitSession

Effects = tuple[Effect, ...]

AT_A_TIME = 256
"""Trials evaluated together: they share the work of the base, and their results are in memory."""


class Moments(Enum):
    """At which moments a model is evaluated."""

    MEAN = auto()
    """At the mean one of each unit."""
    UNITS = auto()
    """At all that are kept of each unit."""
    PATH = auto()
    """At those that lie between units as well."""


@dataclass(frozen=True, eq=False)
class SessionModel:
    """A model with the effects that hold in one session, on the units of that session."""

    model: ErrorModel  # table and evaluation; its own effects do not count
    session: UnitSession  # units and the moments that tell their path
    effects: Effects  # all effects at the point about which columns are wanted

    def remembers(self, effects: Effects) -> bool:
        """Tell whether any of the effects needs the path and not the mean moment alone."""
        return any(each.law.many_waves or self._has_past(each) for each in effects)

    def held(self, effects: Effects) -> dict[str, Effect]:
        """Return those effects that have a past, by name, doing what they do beside all others."""
        remembering = [each for each in effects if self._has_past(each)]
        if not remembering:
            return {}
        self._batch([effects], Moments.PATH)
        chunks = self.session.known[Moments.PATH].added
        found = {}
        for each in remembering:
            law = HeldLaw(each, [chunk[each.name] for chunk in chunks])
            found[each.name] = Effect(law, each.component)
        return found

    def _has_past(self, effect: Effect) -> bool:
        """Tell whether earlier moments decide what an effect does.

        The law is asked with its first values: with no play there is nothing to seek, so play has
        no past.  A formula may be undefined there; then it is asked with those of the effect.
        """
        if isinstance(effect.law, HeldLaw):
            return True
        known, asked = self.session.known, (effect.law, effect.component)
        if asked not in known:
            first = self.session.block.take(slice(0, 1))
            try:
                memory = evaluate(self.model.with_effects(Effect(*asked)), first, None).memory
            except UndefinedFormulaError:
                memory = evaluate(self.model.with_effects(effect), first, None).memory
            known[asked] = memory.states[0] is not None
        return bool(known[asked])

    def along(self, trials: Sequence[Effects], slopes: bool = False) -> list[Array]:
        """Return what the sensor would say of each unit, from all its moments, (u, 6).

        In motion the mean of a pose is not the pose at the mean angles: a target a millimetre off
        bends that by micrometres.  `slopes`: whether the trials differ from the first by little.
        """
        return self.predicted(trials, [True] * len(trials), slopes)

    def _batch(
        self, trials: Sequence[Effects], moments: Moments, slopes: bool = False
    ) -> list[Array]:
        """Return what the sensor would say of each unit, (u, 6); pins begin where they rested."""
        session = self.session if moments is Moments.PATH else self._without_path
        block = self.session.still if moments is Moments.MEAN else session.block
        recent = self.session.known.setdefault(moments, Recent())
        found = self.model.with_effects().batch_with(block, trials, recent, slopes)
        if moments is Moments.MEAN:
            return [each.measured for each in found]
        return [session.mean_twist(each.measured) for each in found]

    @cached_property
    def _without_path(self) -> UnitSession:
        return replace(self.session, cut=self.session.cut.without_path)

    def predicted(
        self,
        trials: Sequence[Effects],
        along: Sequence[bool] | None = None,
        slopes: bool = False,
    ) -> list[Array]:
        """Return the same, good enough for differences: the path only where an effect needs it.

        `along`: which of them are evaluated on the path; by default those that remember; `slopes`:
        as for `along`.
        """
        path = [self.remembers(trial) for trial in trials] if along is None else along
        wanted = [self._moments(*each) for each in zip(trials, path, strict=True)]
        out: list[Array] = [np.empty(0)] * len(trials)
        for moments in Moments:
            chosen = [i for i, own in enumerate(wanted) if own is moments]
            for start in range(0, len(chosen), AT_A_TIME):
                part = chosen[start : start + AT_A_TIME]
                found = self._batch([trials[i] for i in part], moments, slopes)
                for i, each in zip(part, found, strict=True):
                    out[i] = each
        return out

    def _moments(self, effects: Effects, along: bool) -> Moments:
        """Return where effects must be evaluated; what has no past needs no path between units."""
        if not along:
            return Moments.MEAN
        return Moments.PATH if any(map(self._has_past, effects)) else Moments.UNITS

    def changes(self, trials: Sequence[Effects]) -> list[Array]:
        """Return the change of the units' predicted poses by other effects than the point's.

        `trials`: full sets of effects; those with a memory are compared on the path.  Gives list of
        (u, 6) arrays: predicted with the trial minus predicted at the point, at O in F [m, rad].
        """
        path = [self.remembers(trial) for trial in trials]
        # First of all: the trials take over what they have in common with it.
        own, *found = self.predicted([self.effects, *trials])
        base = {self.remembers(self.effects): own}
        if True in path and True not in base:
            base[True] = self._own_along
        return [each - base[on_path] for each, on_path in zip(found, path, strict=True)]

    @cached_property
    def _own_along(self) -> Array:
        return self.along([self.effects])[0]
