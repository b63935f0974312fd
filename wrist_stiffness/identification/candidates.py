"""The catalogue as candidates of a diagnosis: columns of every law at every place."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.possible import Possible
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.columns import Carried, Recipe, Shape, Values
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Parameter, si_factor
from wrist_stiffness.model.registry import catalogue, find_law
from wrist_stiffness.sessions.columns import Effects, SessionModel
from wrist_stiffness.sessions.refitted import SET_UP
from wrist_stiffness.sessions.units import Mask

LEVER, SHIFTS_ALONE = 0.03, 0.01
"""A change shifts the platform alone if turns of its normal, at the distance of the bearings [m],
are less than this share of the shifts: below a millimetre they are within an encoder step."""

SET_UP_ANEW = {law for law, _ in SET_UP}
"""Laws refitted in every session before any search; there is nothing to find."""

Trial = tuple[Law, str, Values]


@dataclass(frozen=True, eq=False)
class WristCandidate:
    """A law at a place, its recipe, and its columns on all points of its grid."""

    law: Law  # the physics
    place: str  # component
    recipe: Recipe  # how it became columns
    at: Callable[[Shape], Array]  # columns (u, 6, k) of all units at a point of the grid [m, rad]

    @property
    def name(self) -> str:
        """`law@place`."""
        return f"{self.law.id}@{self.place}"

    @property
    def shapes(self) -> list[Shape]:
        """Every point of the grid."""
        return self.recipe.shapes

    def effect(self, z: Array, shape: Shape) -> Effect:
        """Return the effect with which a fit may begin, its factors (k,) in usual sizes."""
        names = [column.factor.key for column in self.recipe.columns(shape)]
        found = dict(zip(names, (z * self.usual).tolist(), strict=True))
        return effect_at(self.law, self.place, self.recipe.start(found, shape))

    @property
    def usual(self) -> Array:
        """Usual size of the factor of each column, (k,)."""
        return np.array([each.scale for each in self._factors])

    @property
    def possible(self) -> Possible:
        """What these factors can be, in usual sizes."""
        return possible(self.law, tuple(self._factors))

    @property
    def _factors(self) -> list[Parameter]:
        return [column.factor for column in self.recipe.columns(self.shapes[0])]


@cache
def possible(law: Law, parameters: tuple[Parameter, ...]) -> Possible:
    """Return what parameters of a law can be, from their means in their typical magnitudes."""
    mean, scale = np.array([(each.mean, each.scale) for each in parameters]).T
    lower = (np.array([each.lower for each in parameters]) - mean) / scale
    upper = (np.array([each.upper for each in parameters]) - mean) / scale
    if type(law).possible is Law.possible:
        return Possible(lower, upper)
    size = np.array([si_factor(each.key) for each in parameters])

    def together(z: Array) -> Mask:
        values = (mean + z * scale) * size
        named = zip(parameters, values.T, strict=True)
        return law.possible({each.key: own for each, own in named})

    return Possible(lower, upper, together)


def compensable(law: Law, place: str, points: bool = True) -> str:
    """Tell whether the motors can correct for an effect: `yes`, `needs_signal` or `no`.

    `law`: the physics; `place`: component; `points`: whether it turns the platform's normal.
    """
    if law.of_measurement(place) or not points:
        return "no"
    return "needs_signal" if law.signals else "yes"


def turns_normal(columns: Array, normal: Array) -> bool:
    """Tell whether any of the columns turns the platform's normal.

    `columns` (u, 6, k): twists at O in F [m, rad]; `normal` (u, 3): of the platform, unit vectors
    in F.
    """
    turned = np.cross(columns[:, 3:], normal[:, :, None], axis=1)
    lengths = [np.linalg.norm(each, axis=(0, 1)) for each in (turned, columns[:, :3])]
    return bool((LEVER * lengths[0] > SHIFTS_ALONE * lengths[1]).any())


@dataclass(frozen=True, eq=False)
class Point:
    """Where columns are taken: the base of each session on its units."""

    models: tuple[SessionModel, ...]  # with the effects of the base

    @property
    def signals(self) -> frozenset[str]:
        """Components with a thermometer in every session."""
        names = [set(each.session.block.temperatures) for each in self.models]
        return frozenset(set.intersection(*names))

    def changes(self, trials: Sequence[Trial]) -> Array:
        """Return the change of what the instrument shows by each trial, (t, u, m) [m, rad].

        `trials`: a law at a place with values of its parameters; an effect that the base has
        already gets these values on top of its own.
        """
        blocks = []
        for model in self.models:
            sets, rows = [_with(model.effects, *t) for t in trials], model.session.measured
            found = np.stack(model.changes(sets)) if sets else np.empty((0, len(rows), 6))
            blocks.append(np.nan_to_num(model.session.seen(found)[:, rows]))
        return np.concatenate(blocks, axis=1)

    def mean(self, signal: Callable[[SessionModel], Array]) -> Array:
        """Return a signal of each unit of the table, (u, ...)."""
        return np.concatenate([signal(each)[each.session.measured] for each in self.models])


def searched(absent: Collection[str]) -> list[tuple[Law, str]]:
    """Return all laws of the catalogue at all their places, but for effects that are there."""
    return [
        (law, place)
        for law in catalogue().values()
        if law.id not in SET_UP_ANEW
        for place in law.places
        if f"{law.id}@{place}" not in absent
    ]


def wrist_candidates(point: Point, asked: Sequence[tuple[Law, str]]) -> tuple[WristCandidate, ...]:
    """Evaluate laws at places about a point.

    `point`: the base; `asked`: laws with a component each.
    Raises `InputError` if a law of another package does not say how large it usually is.
    """
    signals = point.signals
    plans = [(law, place, law.linearised(place, signals)) for law, place in asked]
    for law, place, _ in plans:
        _require_prior_scales(law, place)
    trials: dict[tuple[object, ...], int] = {}
    listed: list[Trial] = []

    def index(law: Law, place: str, values: Values) -> int:
        key = (law.id, place, *sorted(values.items()))
        if key not in trials:
            trials[key] = len(listed)
            listed.append((law, place, values))
        return trials[key]

    for law, place, own in plans:
        if own.carried:
            index(find_law(own.carried.law), place, own.carried.values)
            continue
        for column in (c for shape in own.shapes for c in own.columns(shape)):
            index(law, place, column.trial)
            if column.origin:
                index(law, place, column.origin)
    changes = point.changes(listed)
    found = []
    for law, place, own in plans:
        if own.carried:
            carrier = changes[index(find_law(own.carried.law), place, own.carried.values)]
            exact = _times_signals(point, carrier, own.carried)
            found.append(WristCandidate(law, place, own, exact))
            continue
        known = {}
        for shape in own.shapes:
            stack = []
            for column in own.columns(shape):
                change = changes[index(law, place, column.trial)]
                if column.origin:
                    change = change - changes[index(law, place, column.origin)]
                stack.append(change / column.size)
            known[shape] = np.stack(stack, axis=-1)
        found.append(WristCandidate(law, place, own, known.__getitem__))
    return tuple(found)


def _require_prior_scales(law: Law, place: str) -> None:
    for each in law.parameters(place):
        if not 0.0 < each.scale < np.inf:
            raise InputError(
                f"{law.id}@{place}: {each.key} has the scale {each.scale:g}; a diagnosis needs its "
                "typical magnitude, finite and above 0"
            )


def _times_signals(point: Point, carrier: Array, carried: Carried) -> Callable[[Shape], Array]:
    """Return columns (u, 6, k) at any shape from what a carrier changes of each unit, (u, 6)."""

    def columns(shape: Shape) -> Array:
        def signals(model: SessionModel) -> Array:
            return model.session.mean(carried.signals(shape, model.session.block))

        return carrier[:, :, None] * point.mean(signals)[:, None, :]

    return columns


def _with(effects: Effects, law: Law, place: str, values: Mapping[str, float]) -> Effects:
    """Return effects with one more, added to its like where the base has it."""
    added = effect_at(law, place, values)
    for number, own in enumerate(effects):
        if own.name == added.name:
            both = {key: own.estimates[key].value + values[key] for key in values}
            return (*effects[:number], effect_at(law, place, both), *effects[number + 1 :])
    return (*effects, added)
