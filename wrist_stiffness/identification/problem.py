"""What a fit compares: measured pose errors of the units, and what a model says of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.free_effects import FreeEffect
from wrist_stiffness.identification.shims import GAP, Shims
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.outliers import FEWEST_UNITS
from wrist_stiffness.inference.shared import Apart, own_covariance, with_shared
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.sessions.columns import SessionModel
from wrist_stiffness.sessions.observing import tabulate, usual_wander
from wrist_stiffness.sessions.refitted import REGISTRATIONS
from wrist_stiffness.sessions.unit_session import UnitSession

NO_PRIOR = 1e-3
"""Weight where a law knows no prior: a thousand times its first value, so that what the data do not
excite stays where it is."""

MOST_KNOWN = 4096
"""Effects with values that are kept: a fit asks for one a parameter at a time."""

Values = tuple[tuple[str, float], ...]

STEP = 1e-2
"""Step of the difference quotients, in standard deviations of the prior."""

MOST_POINTS = 4
"""So many points keep their columns."""

SILENT = 1e-6
"""Length, in standard deviations of the noise, of a column that is rounding: bases of columns are
blind to scales, and what rounding says differs from machine to machine."""


def require_units(problem: FitProblem) -> None:
    """Refuse recordings that are too short to fit to.

    Raises `InputError` with the sessions, the number of units and the least one, or that of
    measured numbers.
    """
    units, table = problem.table.n_units, problem.table
    if units < FEWEST_UNITS:
        names = ", ".join(session.name for session in problem.sessions)
        raise InputError(
            f"{names}: {units} dwells and moments are too few to fit to, it needs {FEWEST_UNITS}"
        )
    if (measured := table.measured.sum()) < np.count_nonzero(problem.weights <= NO_PRIOR):
        raise InputError(f"fit: only {measured} numbers were measured")


@dataclass(frozen=True)
class Unknown:
    """One number that is fitted, counted in steps from the mean of its prior."""

    free: int  # place of its effect among the free ones
    effect: Effect  # this one, as it starts
    parameter: Parameter
    session: int | None  # session whose own it is, None for the wrist's
    # where it starts and its natural size, in the unit of its name
    mean: float
    step: float
    weight: float  # `step` over the standard deviation of the prior

    @property
    def key(self) -> str:
        """Name of the parameter."""
        return self.parameter.key

    def value(self, steps: float) -> float:
        """Return its value so many steps from the mean, within the bounds."""
        own = self.parameter
        return min(max(self.mean + steps * self.step, own.lower), own.upper)


def _as_held(effects: tuple[Effect, ...], held: Mapping[str, Effect]) -> tuple[Effect, ...]:
    return tuple(held.get(each.name, each) for each in effects)


def _together(one: Effect, other: Effect) -> Effect:
    """Return the sum of two effects of one name, within the bounds of its parameters."""
    total = {}
    for each in one.parameters:
        value = one.estimates[each.key].value + other.estimates[each.key].value
        total[each.key] = min(max(value, each.lower), each.upper)
    return one.with_values(total)


@dataclass(frozen=True, eq=False)
class FitProblem:
    """A model, sessions, and what may move."""

    model: ErrorModel  # table and the effects that stay as they are
    sessions: tuple[UnitSession, ...]  # in the order of time
    # what may move; none of them is among the model's effects.  The second of one name is what came
    # on top of the first after the wrist was fitted: no shim follows it
    free: tuple[FreeEffect, ...]

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """All numbers that are fitted: the wrist's, then those of each session."""
        found = []
        for session in (None, *range(len(self.sessions))):
            for place, free in enumerate(self.free):
                if free.per_session == (session is None) or self._mounted(free):
                    continue
                parameters = {p.key: p for p in free.effect.parameters}
                found += [
                    Unknown(
                        place,
                        free.effect,
                        parameters[key],
                        session,
                        free.effect.estimates[key].value,
                        free.step[key],
                        1.0 if np.isfinite(free.scale[key]) else NO_PRIOR,
                    )
                    for key in free.scale
                ]
        return tuple(found)

    def _mounted(self, free: FreeEffect) -> bool:
        """Tell whether the mountings of gauges are all that an effect could be."""
        gauges = self.sessions[0].gauges is not None
        return gauges and free.effect.law.id in REGISTRATIONS

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds in steps, (p,)."""
        lower = [(u.parameter.lower - u.mean) / u.step for u in self.unknowns]
        upper = [(u.parameter.upper - u.mean) / u.step for u in self.unknowns]
        return np.array(lower), np.array(upper)

    @property
    def weights(self) -> Array:
        """Weights of the priors, (p,)."""
        return np.array([unknown.weight for unknown in self.unknowns])

    def effects(self, z: Array, session: int) -> tuple[Effect, ...]:
        """Return the free effects as a session has them, gaps as shims leave them.

        `z` (p,): steps from the prior means; `session`: number of the session.
        """
        return self._with_values(self._values(z, session))

    def _values(self, z: Array, session: int) -> list[dict[str, float]]:
        """Return the fitted values of each free effect."""
        values: list[dict[str, float]] = [{} for _ in self.free]
        for unknown, steps in zip(self.unknowns, z.tolist(), strict=True):
            if unknown.session in (None, session):
                values[unknown.free][unknown.key] = unknown.value(steps)
        return values

    def _with_values(self, values: list[dict[str, float]]) -> tuple[Effect, ...]:
        keys = [(place, tuple(own.items())) for place, own in enumerate(values)]
        built = self._built
        gaps = self._shims.gaps(self._as_built, [self._effect(*keys[place]) for place in built])
        for number, gap in gaps.items():
            place, own = keys[built[number]]
            keys[place] = place, (*own, (GAP, gap))
        found = {place: self._effect(*keys[place]) for place in built}
        for place, first in self._on_top.items():
            found[first] = self._effect(*keys[first], *keys[place])
        return tuple(found.values())

    def _moved(
        self,
        effects: tuple[Effect, ...],
        values: list[dict[str, float]],
        unknown: Unknown,
        steps: float,
    ) -> tuple[Effect, ...]:
        """Return the effects of these values with one unknown so many steps from its mean."""
        free = unknown.free
        own = values[free] | {unknown.key: unknown.value(steps)}
        with_others = self._shims.move_with(unknown.effect)
        if with_others or free in self._on_top or free in self._on_top.values():
            return self._with_values([*values[:free], own, *values[free + 1 :]])
        at = self._built.index(free)
        return (*effects[:at], self._effect(free, tuple(own.items())), *effects[at + 1 :])

    @cached_property
    def _on_top(self) -> dict[int, int]:
        """Place of what came on top of an effect, and of that effect."""
        names = [each.effect.name for each in self.free]
        firsts = [names.index(name) for name in names]
        return {place: first for place, first in enumerate(firsts) if first != place}

    @cached_property
    def _effect(self) -> Callable[..., Effect]:
        """Free effects by place and values: trials that differ in one effect share all others.

        With a further place and values it is the sum of both.
        """

        @lru_cache(maxsize=MOST_KNOWN)
        def effect(place: int, values: Values, *on_top: Any) -> Effect:
            if on_top:
                return _together(effect(place, values), effect(*on_top))
            return self.free[place].effect.with_values(dict(values))

        return effect

    @cached_property
    def _built(self) -> tuple[int, ...]:
        """Places of the free effects but for what came on top of them later."""
        return tuple(place for place in range(len(self.free)) if place not in self._on_top)

    @cached_property
    def _as_built(self) -> tuple[Effect, ...]:
        """Starts of these."""
        return tuple(self.free[place].effect for place in self._built)

    @cached_property
    def _shims(self) -> Shims:
        return Shims.of(self.model, self._as_built)

    def residual(self, z: Array) -> Array:
        """Return log(T_measured T_predicted^-1) of all units, (u, 6) at O in F [m, rad]."""
        blocks = []
        for number, (session, model) in enumerate(zip(self.sessions, self._models, strict=True)):
            effects = (*self.model.effects, *self.effects(z, number))
            blocks.append(session.residual(model.along([effects])[0]))
        return self.rows(blocks)

    def columns(
        self,
        z: Array,
        places: Collection[int] | None = None,
        width: float = STEP,
        slopes: bool = False,
    ) -> Array:
        """Return the change of the residuals by a step of each unknown, (u, 6, p); NaN as 0.

        By one-sided differences, away from the nearer bound, and from where a formula is undefined.
        Effects with a past do beside another parameter what they do beside this one: so only their
        own columns follow the path anew.

        `z` (p,): steps from the prior means; `places`: which unknowns are asked for, in that order;
        all by default; `width`: of the differences, in steps; `slopes`: whether constants are
        carried to first order, with flanges that touch held closed: that is quicker by a third, and
        as near but where a flange touches within a step.
        """
        asked = list(range(len(self.unknowns)) if places is None else places)
        slopes &= width == STEP
        return self._changes(z, asked, lambda s, twists: s.residual(twists), width, slopes)

    def twists(self, z: Array) -> Array:
        """Return by how much a step of each unknown turns and shifts the platform, (u, 6, p)."""
        return self._changes(z, list(range(len(z))), lambda session, twists: twists, STEP, True)

    def _changes(
        self,
        z: Array,
        asked: list[int],
        shown: Callable[[UnitSession, Array], Array],
        width: float,
        slopes: bool,
    ) -> Array:
        """Return the change by a step of some unknowns of what twists (t, u, 6) are shown as."""
        blocks = []
        for number, session in enumerate(self.sessions):
            asking = partial(self._trials, number, z, asked, width, slopes)
            try:
                twists, moved, step = asking()
            except UndefinedFormulaError:
                twists, moved, step = asking(upwards=False)
            first, *others = shown(session, np.stack(twists))
            block = np.zeros((*first.shape, len(z)))
            for place, other in zip(moved, others, strict=True):
                block[:, :, place] = np.nan_to_num((other - first) / step[place])
            blocks.append(block[:, :, asked])
        return self.rows(blocks)

    def _trials(
        self,
        number: int,
        z: Array,
        asked: list[int],
        width: float,
        slopes: bool,
        upwards: bool = True,
    ) -> tuple[list[Array], list[int], Array]:
        """Return a session's predicted twists (u, 6), and those with a step of some unknowns.

        `upwards`: which way it goes where there is room on both sides.
        """
        model = self._models[number]
        values = self._values(z, number)
        effects = self._with_values(values)
        whole = (*self.model.effects, *effects)
        held = model.held(whole)
        up, down = (np.minimum(width, room) for room in (self.bounds[1] - z, z - self.bounds[0]))
        step = np.where((up > down) | (upwards & (up == down)), up, -down)
        moved, trials = [], [_as_held(whole, held)]
        for place in asked:
            unknown = self.unknowns[place]
            if unknown.session not in (None, number):
                continue
            other = self._moved(effects, values, unknown, float(z[place] + step[place]))
            trial = (*self.model.effects, *other)
            trials.append(trial if unknown.effect.name in held else _as_held(trial, held))
            moved.append(place)
        return model.along(trials, slopes), moved, step

    def same_as(self, other: FitProblem) -> bool:
        """Tell whether another problem asks the same, so that what is known of it may be used."""
        one, two = self.model, other.model
        return (
            self.sessions is other.sessions
            and one.table is two.table
            and (one.evaluation, one.effects) == (two.evaluation, two.effects)
            and self.free == other.free
        )

    def columns_at(
        self,
        z: Array,
        places: tuple[int, ...] | None = None,
        width: float = STEP,
        slopes: bool = False,
    ) -> Array:
        """Return `columns`, of the last few points without evaluating anew; not to be changed.

        A fit ends where its last step failed, and the next one begins where it ended.
        """
        key = (z.tobytes(), places, width, slopes)
        if key not in self._known:
            if len(self._known) == MOST_POINTS:
                self._known.pop(next(iter(self._known)))
            found = self.columns(z, places, width, slopes)
            found[..., np.linalg.norm(self.whiten(found), axis=0) < SILENT] = 0.0
            self._known[key] = found
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[bytes, tuple[int, ...] | None, float, bool], Array]:
        return {}

    @cached_property
    def _apart(self) -> Apart:
        stated, wander = self.table.covariance, usual_wander(self.table.quantities)
        if stated is None:
            stated = with_shared(self.table, np.diag(4.0 * wander**2))
        own = own_covariance(self.table, stated) + np.diag(wander**2)
        return Apart(self.table, np.linalg.inv(np.linalg.cholesky(own)))

    def whiten(self, values: Array) -> Array:
        """Bring (u, 6) or (u, 6, k) to about unit scatter, (6u,) or (6u, k); NaN become zero."""
        return self._apart.rows(values)

    @cached_property
    def table(self) -> Observations:
        """Conditions, known scatter and labels of the units, with what was measured as values."""
        units = sum(map(len, self.sessions))
        return tabulate(self.model, self.sessions, np.zeros((units, 6))).observations

    def rows(self, blocks: list[Array]) -> Array:
        """Put the sessions' units together and keep those of the table."""
        return np.concatenate(
            [block[each.measured] for block, each in zip(blocks, self.sessions, strict=True)]
        )

    @cached_property
    def _models(self) -> tuple[SessionModel, ...]:
        return tuple(SessionModel(self.model, each, ()) for each in self.sessions)
