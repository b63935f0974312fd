"""What a model leaves of the units, taken apart: noise, drift, and on what the rest depends."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from wrist_stiffness.comparing.curve import Curve, curve_of
from wrist_stiffness.identification.likelihood import WristTable
from wrist_stiffness.identification.questions import finer_questions
from wrist_stiffness.inference.dependence import Dependences, dependences
from wrist_stiffness.inference.discrepancy import PASSING_DRIFT
from wrist_stiffness.inference.held_out import time_blocks
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.point import Group, Point
from wrist_stiffness.inference.reading import NAMING
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.observing import without_mounting
from wrist_stiffness.sessions.unit_session import UnitSession

BLOCKS = 10
"""Stretches of the recordings that are predicted by all others."""

LEAST = 0.01
"""Share of the square of the error below which a condition is named and no more."""


@dataclass(frozen=True, eq=False)
class Part:
    """A group of the discrepancy that is there."""

    group: Group
    amplitude: float
    wrong: bool  # whether it is more than an instrument's usual drift
    places: np.ndarray  # (k,), of its columns among all of the state
    own: Array  # (u, 6, k), what its columns do by themselves
    seen: Array  # (u, 6, k), what they do beyond what the fit would have taken up
    values: Array  # (k,), of the columns

    @property
    def drifts(self) -> bool:
        """Whether it is an instrument's drift."""
        return self.group.expected > 0.0


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
    # `observing.tabulate` names them
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
    def parts(self) -> dict[int, Part]:
        """Those groups by their places in the background."""
        state = self.answer.state
        flat = self.columns.reshape(-1, self.columns.shape[2])
        weighted = self.weights.reshape(-1, 1) * flat
        information = weighted.T @ flat + np.diag(self.point.weight**2)
        named = flat.shape[1]
        found, first = {}, named
        for at, number in enumerate(self.answer.chosen):
            group = self.table.background.groups[number]
            units = np.eye(group.columns.shape[1])
            own = np.stack([group.change(unit) for unit in units], axis=2)
            own = without_mounting(self.observations, own)
            taken = np.linalg.solve(information, weighted.T @ own.reshape(len(flat), -1))
            places = np.arange(first, first + len(units))
            found[number] = Part(
                group,
                float(state.amplitude[at]),
                bool(state.discrepant[at]),
                places,
                own,
                self.columns @ taken - own,
                state.unnamed[places - named],
            )
            first += len(units)
        return found

    @cached_property
    def error(self) -> dict[str, float]:
        """RMS of what is left, by the key of the quantity."""
        return self.observations.rms(np.nan_to_num(self.observations.values) ** 2)

    @cached_property
    def noise(self) -> dict[str, float]:
        """What the instrument's noise makes of it."""
        return self.table.noise(self.answer.state)

    @property
    def noise_known(self) -> bool:
        """Whether anything tells the noise; else it is at most so large."""
        return self.table.background.noise_known

    @cached_property
    def drift(self) -> dict[str, float]:
        """What an instrument's usual drift makes of it."""
        usual = [each for each in self.parts.values() if each.drifts and not each.wrong]
        return self._rms(self._fitted(usual))

    @property
    def usual_drift(self) -> dict[str, float]:
        """What such an instrument is expected to drift, RMS."""
        return self._rms(np.broadcast_to(self.table.drift, self.observations.values.shape))

    @cached_property
    def above(self) -> dict[str, float]:
        """What laws of the conditions surely explain above noise and drift, RMS.

        With a misfit, which no law explains, the rest above the noise counts too.
        """
        parts, found = self.parts.values(), {}
        # What the fit takes up of a turn shifts the platform too, so laws of both count together.
        laws = self._rms(self._fitted(each for each in parts if each.wrong))
        rest = self._rms(np.nan_to_num(self.observations.values - self._fitted(parts)))
        asked = {each.group.quantity for each in parts if each.wrong}
        for quantity in self.observations.reported:
            key = quantity.key
            square = laws[key] ** 2 if quantity.name in asked else 0.0
            if self.answer.state.misfit:
                square += max(rest[key] ** 2 - self.noise[key] ** 2, 0.0)
            found[key] = min(float(np.sqrt(square)), self.error[key])
        return found

    @cached_property
    def every(self) -> tuple[Told, ...]:
        """On what the error surely depends, the largest part first."""
        found = [
            Told(dict(each.members), each.probability, *self._shown(each.groups))
            for each in self.answer.found
            if each.probability >= NAMING
        ]
        drifts = {n: each for n, each in self.parts.items() if each.wrong and each.drifts}
        if drifts:
            away = max(
                np.log(each.amplitude / each.group.expected) / each.group.width
                for each in drifts.values()
            )
            shown = self._shown(tuple(drifts))
            found.append(Told({PASSING_DRIFT: 1.0}, float(ndtr(away)), *shown))
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
        state, table, values = self.answer.state, self.table, self.observations.values
        groups = [each.group for each in self.parts.values()]
        if not groups:
            return self.error
        columns = np.concatenate([each.columns for each in groups], axis=1)
        known = self.point.left + self.point.columns @ state.step
        sizes = [group.columns.shape[1] for group in groups]
        # What only drifts is no law.
        law = np.repeat([0.0 if group.expected else 1.0 for group in groups], sizes)
        information = columns.T @ columns / state.excess + np.diag(state.precision[-len(law) :])
        slope = columns.T @ known / state.excess
        blocks = time_blocks(self.observations.sessions, min(BLOCKS, self.observations.n_units))
        left = values + self.columns @ state.step
        for block in np.unique(blocks):
            own = columns[blocks[table.unit] == block]
            seen = information - own.T @ own / state.excess
            step = -law * np.linalg.solve(
                seen, slope - own.T @ known[blocks[table.unit] == block] / state.excess
            )
            for group, part in zip(groups, np.split(step, np.cumsum(sizes)[:-1]), strict=True):
                left[blocks == block] += group.change(part)[blocks == block]
        after = self.observations.rms(np.nan_to_num(left) ** 2)
        return {key: min(size, after[key]) for key, size in self.error.items()}

    def _fitted(self, parts: Iterable[Part]) -> Array:
        """Part of what is left that goes with some groups, (u, 6)."""
        return sum((each.seen @ each.values for each in parts), np.zeros_like(self.weights))

    def _rms(self, values: Array) -> dict[str, float]:
        return self.observations.rms(values**2)

    def _shown(self, numbers: tuple[int, ...]) -> tuple[dict[str, float], Curve]:
        """Return what goes with the groups of one condition, and how to show it."""
        quantities = {q.name: q for q in self.observations.reported}
        parts = [self.parts[n] for n in numbers]
        own = [quantities[each.group.quantity].key for each in parts]
        every = self._rms(self._fitted(parts))
        # Parts may cancel each other; none is told as more than the whole.
        sizes = {key: min(every[key], self.above[key]) for key in own}
        over = [sizes[key] / max(self.noise[key], 1e-12) for key in own]
        strongest = parts[int(np.argmax(over))].group
        shown = [each for each in parts if each.group.quantity == strongest.quantity]
        asked = {q.name: q.conditions for q in finer_questions(self.observations.covariates)}
        conditions = asked.get(strongest.name, ("time_s",))
        values = np.concatenate([each.values for each in shown])
        seen = np.concatenate([each.seen for each in shown], axis=2)
        others = [each for each in self.parts.values() if each not in shown]
        left = self.observations.values - self._fitted(others)
        if len(conditions) == 1:
            # A law of one condition is shown as it is, with what the fit took of it.
            alone = -np.concatenate([each.own for each in shown], axis=2)
            left, seen = left + (alone - seen) @ values, alone
        places = np.concatenate([each.places for each in shown])
        covariance = self.answer.state.covariance[np.ix_(places, places)]
        quantity = quantities[strongest.quantity]
        return sizes, curve_of(
            self.observations, quantity, conditions, left, seen, values, covariance
        )


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
    table = WristTable(left, sessions, columns, finer_questions)
    white = table.whiten(left.values)
    prior = np.ones(len(z)) if prior is None else prior
    point = Point(white, table.whiten(columns), z, prior, {}, np.zeros((len(white), 0)))
    # What is shown lacks what a mounting of gauges does; the point knows of it by its whitening.
    shown = left.with_values(without_mounting(left, left.values))
    return Explained(shown, table, point, without_mounting(left, columns), weights)
