"""What a model leaves of the units, taken apart: noise, drift, and on what the rest depends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from wrist_stiffness.comparing.curve import Curve, curve_of
from wrist_stiffness.identification.likelihood import WristTable, unstated
from wrist_stiffness.identification.questions import finer_questions
from wrist_stiffness.inference.answer import NAMING
from wrist_stiffness.inference.blocks import time_blocks
from wrist_stiffness.inference.dependence import Dependences, dependences
from wrist_stiffness.inference.discrepancy import PASSING_DRIFT
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.point import Group, Point
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.observing import without_mounting
from wrist_stiffness.sessions.unit_session import UnitSession

BLOCKS = 10
"""Stretches of the recordings that are predicted by all others."""

LEAST = 0.01
"""Share of the square of the error below which a condition is named and no more."""


@dataclass(frozen=True, eq=False)
class Told:
    """A condition on which the error depends."""

    # conditions that these recordings cannot tell apart, most probable first, with the probability
    # of each to be the one
    members: dict[str, float]
    probability: float  # that the error depends on one of them
    sizes: dict[str, float]  # what of the error goes with it, RMS by the key of the quantity
    curve: Curve  # what it does

    @property
    def name(self) -> str:
        """Most probable condition."""
        return next(iter(self.members))


@dataclass(frozen=True, eq=False)
class Explained:
    """What is left of the units, and what the evidence says of it."""

    # values are what is left after set-up (and whatever else was fitted); conditions as
    # `observing.observe` names them
    observations: Observations
    table: WristTable  # of the same units
    point: Point  # the same, whitened, with the slopes of what was fitted
    columns: Array  # (u, 6, p), those slopes before they were whitened [m, rad]
    # (u, 6), what the square of each number counted in the fit, where the priors count as in the
    # point
    weights: Array

    @cached_property
    def answer(self) -> Dependences:
        """Which groups of the discrepancy are there."""
        return dependences(self.point, self.table.background)

    @cached_property
    def error(self) -> dict[str, float]:
        """RMS of what is left, by the key of the quantity."""
        return self.observations.rms(np.nan_to_num(self.observations.values) ** 2)

    @cached_property
    def noise(self) -> dict[str, float]:
        """What the instrument's noise makes of it."""
        return self.table.noise(self.answer.state)

    @cached_property
    def drift(self) -> dict[str, float]:
        """What an instrument's usual drift makes of it."""
        state = self.answer.state
        pairs = zip(self.answer.chosen, state.discrepant, strict=True)
        usual = [n for n, wrong in pairs if self._drifts(n) and not wrong]
        return self._rms(self._fitted(usual)) if usual else dict.fromkeys(self.error, 0.0)

    @property
    def usual_drift(self) -> dict[str, float]:
        """What such an instrument is expected to drift, RMS."""
        return self._rms(np.broadcast_to(self.table.drift, self.observations.values.shape))

    @cached_property
    def above(self) -> dict[str, float]:
        """What is left above noise and drift, RMS."""
        answer, found = self.answer, {}
        rest = self._rms(np.nan_to_num(self.observations.values - self._fitted(answer.chosen)))
        for quantity in self.observations.reported:
            pairs = zip(answer.chosen, answer.state.discrepant, strict=True)
            own = [n for n, bad in pairs if bad and self._group(n).quantity == quantity.name]
            key = quantity.key
            square = self._rms(self._fitted(own))[key] ** 2
            if answer.state.misfit:
                square += max(rest[key] ** 2 - self.noise[key] ** 2, 0.0)
            found[key] = float(np.sqrt(square))
        return found

    @cached_property
    def every(self) -> tuple[Told, ...]:
        """On what the error surely depends, the largest part first."""
        found = [
            Told(dict(each.members), each.probability, *self._shown(each.groups))
            for each in self.answer.found
            if each.probability >= NAMING
        ]
        state = self.answer.state
        pairs = zip(self.answer.chosen, state.discrepant, strict=True)
        drifts = [at for at, (n, wrong) in enumerate(pairs) if wrong and self._drifts(n)]
        if drifts:
            groups = [state.background.groups[at] for at in drifts]
            away = [
                np.log(state.amplitude[at] / group.expected) / group.width
                for at, group in zip(drifts, groups, strict=True)
            ]
            shown = self._shown(tuple(self.answer.chosen[at] for at in drifts))
            found.append(Told({PASSING_DRIFT: 1.0}, float(ndtr(max(away))), *shown))
        noise = {key: max(size, 1e-12) for key, size in self.noise.items()}
        return tuple(
            sorted(found, key=lambda t: -sum((s / noise[k]) ** 2 for k, s in t.sizes.items()))
        )

    @property
    def told(self) -> tuple[Told, ...]:
        """Those that are worth a sentence."""
        return tuple(each for each in self.every if each not in self.minor)

    @cached_property
    def minor(self) -> tuple[Told, ...]:
        """Those with so little of the error that they are only named."""
        return tuple(
            each
            for each in self.every
            if all(size**2 < LEAST * self.error[key] ** 2 for key, size in each.sizes.items())
        )

    @property
    def perhaps(self) -> dict[str, float]:
        """What is more likely than not, but not sure, with its probability."""
        return {
            each.name: each.probability
            for each in self.answer.found
            if 0.5 <= each.probability < NAMING
        }

    @property
    def not_varied(self) -> tuple[str, ...]:
        """Questions of which these recordings say nothing; of each signal once."""
        asked = {each.name for each in self.table.background.groups}
        every = finer_questions(self.observations.covariates)
        still = [each.name for each in every if each.name not in asked]
        twice = {f"{name} and the pose together" for name in still}
        return tuple(name for name in still if name not in twice)

    @cached_property
    def reachable(self) -> dict[str, float]:
        """RMS that the laws of the conditions leave of stretches that they have not seen."""
        answer, table, values = self.answer, self.table, self.observations.values
        state, groups = answer.state, [self._group(n) for n in answer.chosen]
        if not groups:
            return self.error
        columns = np.concatenate([each.columns for each in groups], axis=1)
        known = self.point.left + self.point.columns @ state.step
        law = np.concatenate(
            [
                np.zeros(len(g.columns.T)) if g.expected else np.ones(len(g.columns.T))
                for g in groups
            ]
        )
        information = columns.T @ columns / state.excess + np.diag(state.precision[-len(law) :])
        slope = columns.T @ known / state.excess
        blocks = time_blocks(self.observations.sessions, min(BLOCKS, self.observations.n_units))
        left = values + self.columns @ state.step
        ends = np.cumsum([len(each.columns.T) for each in groups])
        for block in np.unique(blocks):
            own = columns[blocks[table.unit] == block]
            seen = information - own.T @ own / state.excess
            # What only drifts is no law.
            step = -law * np.linalg.solve(
                seen, slope - own.T @ known[blocks[table.unit] == block] / state.excess
            )
            for group, part in zip(groups, np.split(step, ends[:-1]), strict=True):
                left[blocks == block] += group.change(part)[blocks == block]
        after = self.observations.rms(np.nan_to_num(left) ** 2)
        return {key: min(size, after[key]) for key, size in self.error.items()}

    def _group(self, number: int) -> Group:
        return self.table.background.groups[number]

    def _drifts(self, number: int) -> bool:
        return self._group(number).expected > 0.0

    def _places(self, number: int) -> np.ndarray:
        """Places of a group's columns among all of the state."""
        at = self.answer.chosen.index(number)
        sizes = self.answer.state.background.sizes
        first = self.point.columns.shape[1] + int(sizes[:at].sum())
        return np.arange(first, first + int(sizes[at]))

    def _seen(self, number: int) -> Array:
        """Return what a group's columns do beyond what the fit would have taken up, (u, 6, k)."""
        own = self._own(number)
        return np.asarray(self.columns @ self._absorbed(own) - own)

    def _own(self, number: int) -> Array:
        """Return what a group's columns do by themselves, (u, 6, k)."""
        group = self._group(number)
        units = np.eye(group.columns.shape[1])
        own = np.stack([group.change(unit) for unit in units], axis=2)
        return without_mounting(self.observations, own)

    def _absorbed(self, change: Array) -> Array:
        """Return what the fit would have taken for changes (u, 6, k), (p, k)."""
        flat = self.columns.reshape(-1, self.columns.shape[2])
        weighted = self.weights.reshape(-1, 1) * flat
        information = weighted.T @ flat + np.diag(self.point.weight**2)
        taken = np.linalg.solve(information, weighted.T @ change.reshape(len(flat), -1))
        return np.asarray(taken)

    def _fitted(self, numbers: Sequence[int]) -> Array:
        """Part of what is left that goes with some groups, (u, 6)."""
        state, out = self.answer.state, np.zeros_like(self.observations.values)
        named = self.point.columns.shape[1]
        for n in numbers:
            out += self._seen(n) @ state.unnamed[self._places(n) - named]
        return out

    def _rms(self, values: Array) -> dict[str, float]:
        return self.observations.rms(values**2)

    def _shown(self, numbers: tuple[int, ...]) -> tuple[dict[str, float], Curve]:
        """Return what goes with the groups of one condition, and how to show it."""
        quantities = {q.name: q for q in self.observations.reported}
        own = [quantities[self._group(n).quantity].key for n in numbers]
        every = self._rms(self._fitted(numbers))
        # Parts may cancel each other; none is told as more than the whole.
        sizes = {key: min(every[key], self.error[key]) for key in own}
        noise = {key: max(self.noise[key], 1e-12) for key in own}
        strongest = numbers[int(np.argmax([sizes[key] / noise[key] for key in own]))]
        quantity = quantities[self._group(strongest).quantity]
        shown = [n for n in numbers if self._group(n).quantity == quantity.name]
        places = np.concatenate([self._places(n) for n in shown])
        others = [n for n in self.answer.chosen if n not in shown]
        asked = {q.name: q for q in finer_questions(self.observations.covariates)}
        name = self._group(strongest).name
        state = self.answer.state
        conditions = asked[name].conditions if name in asked else ("time_s",)
        values = state.unnamed[places - self.point.columns.shape[1]]
        seen = np.concatenate([self._seen(n) for n in shown], axis=2)
        left = self.observations.values - self._fitted(others)
        if len(conditions) == 1:
            # A law of one condition is shown as it is, with what the fit took of it.
            alone = -np.concatenate([self._own(n) for n in shown], axis=2)
            left, seen = left + (alone - seen) @ values, alone
        covariance = state.covariance[np.ix_(places, places)]
        curve = curve_of(self.observations, quantity, conditions, left, seen, values, covariance)
        return sizes, curve


def explain(
    left: Observations,
    sessions: Sequence[UnitSession],
    columns: Array,
    z: Array,
    weights: Array,
    prior: Array | None = None,
) -> Explained:
    """Return what is left of the units, to be taken apart.

    `left`: residuals of the sessions after a fit of the set-up, and maybe of more; `columns` (u, 6,
    p): change of that by a step of each parameter that was fitted [m, rad]; `z` (p,): those
    parameters in steps, from the means of their priors; `weights` (u, 6): what the square of each
    number counted in the fit; `prior` (p,): weights of the priors of the parameters in that fit, by
    default 1.
    """
    table = WristTable(left, sessions, unstated(left, left.values, columns), finer_questions)
    white = table.whiten(left.values)
    prior = np.ones(len(z)) if prior is None else prior
    point = Point(white, table.whiten(columns), z, prior, {}, np.zeros((len(white), 0)))
    # What is shown lacks what a mounting of gauges does; the point knows of it by its whitening.
    shown = left.with_values(without_mounting(left, left.values))
    return Explained(shown, table, point, without_mounting(left, columns), weights)
