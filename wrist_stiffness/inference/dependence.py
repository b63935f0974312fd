"""On what that which a model leaves depends: which groups of its discrepancy are there.

Every set of groups has an evidence.  Sets are visited from none on: what would add most to the
evidence comes first, and what is there is left out once, so that another one can take
its place.  All probabilities are the shares of the sets in the evidence of all that were visited.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.inference.amplitudes import beside, further, settled, sizes_of
from wrist_stiffness.inference.discrepancy import SLOW_DRIFT
from wrist_stiffness.inference.evidence import OFF, Array, Evidence
from wrist_stiffness.inference.point import Background, Point
from wrist_stiffness.inference.reading import MEMBER

HELD = 3.0
"""Log evidence that a group may gain when the amplitudes of the others follow."""

HOPELESS = 10.0
"""Log evidence below the best at which a set is not searched further."""

Chosen = frozenset[int]


@dataclass(frozen=True)
class Dependence:
    """One condition on which the error depends."""

    # questions that these data cannot tell apart, with the probability of each to be the one; the
    # most probable first
    members: Mapping[str, float]
    probability: float  # that the error depends on one of them
    groups: tuple[int, ...]  # places of the groups of the first one in the background

    @property
    def name(self) -> str:
        """Most probable question."""
        return next(iter(self.members))


@dataclass(frozen=True, eq=False)
class Dependences:
    """Answer to the question on what an error depends."""

    found: tuple[Dependence, ...]  # of the most probable set, the surest first
    nothing: float  # probability that the error depends on nothing
    chances: Mapping[str, float]  # probability of each question that was asked
    state: Evidence  # of the most probable set; its rows sum up those of the table
    chosen: tuple[int, ...]  # places of its groups in the background that was given


def dependences(point: Point, background: Background) -> Dependences:
    """Find the groups of the discrepancy on which depends what a fit leaves.

    `point`: where the fit ended; `background`: all groups that are asked, and the drift.
    """
    sets = _Sets(*_summed_up(point, background))
    sets.climbed(sets.state(dict.fromkeys(sets.of(SLOW_DRIFT), 1.0)))
    first = sets.best
    for name in sets.names(first):
        sets.without(first, name)
    best = sets.best
    weights = sets.weights()
    asked = dict.fromkeys(each.name for each in background.groups if not each.expected)
    chances = {
        name: sum(w for chosen, w in weights.items() if chosen & sets.of(name)) for name in asked
    }
    found = [_class_of(sets, weights, best, name) for name in sets.names(best)]
    return Dependences(
        tuple(sorted(found, key=lambda each: -each.probability)),
        sum(weight for chosen, weight in weights.items() if not sets.names(chosen)),
        chances,
        sets.known(best),
        tuple(sorted(best)),
    )


def _class_of(sets: _Sets, weights: Mapping[Chosen, float], best: Chosen, name: str) -> Dependence:
    others = sets.names(best) - {name}
    alike: dict[str, float] = {}
    for chosen, weight in weights.items():
        names = sets.names(chosen)
        if len(names) == len(others) + 1 and others < names:
            (own,) = names - others
            alike[own] = alike.get(own, 0.0) + weight
    total = sum(alike.values())
    ranked = sorted(alike.items(), key=lambda pair: -pair[1])
    members = {own: weight / total for own, weight in ranked if weight >= MEMBER * total}
    inside = frozenset().union(*(sets.of(own) for own in members))
    probability = sum(weight for chosen, weight in weights.items() if chosen & inside)
    return Dependence(members, probability, tuple(sorted(best & sets.of(name))))


def _summed_up(point: Point, background: Background) -> tuple[Point, Background]:
    """Return the same question with as many rows as columns, which is all that is asked of them."""
    named = point.columns.shape[1]
    whole = np.column_stack([point.columns, *(g.columns for g in background.groups), point.left])
    rows: Array = whole
    if len(whole) > whole.shape[1]:
        rows = np.asarray(np.linalg.qr(whole, mode="r"))
    ends = named + np.cumsum([0, *background.sizes])
    groups = tuple(
        replace(group, columns=rows[:, first:end])
        for group, first, end in zip(background.groups, ends[:-1], ends[1:], strict=True)
    )
    summed = replace(
        point,
        left=rows[:, -1],
        columns=rows[:, :named],
        inexact=np.zeros((len(rows), 0)),
        numbers=point.count,
    )
    return summed, replace(background, groups=groups)


class _Sets:
    """Sets of groups and their evidence."""

    def __init__(self, point: Point, background: Background) -> None:
        self._bare = Evidence(point, background, np.zeros(0), 1.0)
        self._groups = background.groups
        # Evidences as they were found, without what was computed of them since.
        self._known: dict[Chosen, tuple[float, Evidence]] = {}
        self._logs: dict[Chosen, float] = {}

    def names(self, chosen: Chosen) -> frozenset[str]:
        """Return the questions of a set."""
        groups = [self._groups[number] for number in chosen]
        return frozenset(each.name for each in groups if not each.expected)

    def of(self, name: str) -> Chosen:
        """Return the groups of a question."""
        return frozenset(n for n, each in enumerate(self._groups) if each.name == name)

    @property
    def best(self) -> Chosen:
        """Most probable set."""
        return max(self._known, key=lambda chosen: self._known[chosen][0])

    def weights(self) -> dict[Chosen, float]:
        """Return the probability of each set, of those that were not tried whole to first order."""
        logs = self._logs | {n: log for n, (log, _) in self._known.items() if log > -np.inf}
        values = np.array(list(logs.values()))
        weights = np.exp(values - values.max())
        return dict(zip(logs, (weights / weights.sum()).tolist(), strict=True))

    def known(self, chosen: Chosen) -> Evidence:
        """Return the evidence of a set that was visited."""
        return replace(self._known[chosen][1])

    def state(self, sizes: Mapping[int, float], excess: float = 1.0) -> Evidence:
        """Return the evidence of a set, the search for its amplitudes begun at those given."""
        chosen = frozenset(sizes)
        if chosen in self._known:
            return self.known(chosen)
        found = settled(beside(replace(self._bare, excess=excess), sizes))
        # With a group that is off it is the smaller set once more.
        log = found.log if (found.amplitude > OFF).all() else -np.inf
        self._known[chosen] = log, replace(found)
        return found

    def climbed(self, at: Evidence, barred: Chosen = frozenset()) -> None:
        """Add to a set what helps most for as long as that pays."""
        while True:
            log, more, amplitude = self._promising(at, barred)
            if log < at.log - HELD:
                break
            reached = self._added(at, more, amplitude)
            if reached.log <= at.log:
                break
            at = reached

    def without(self, chosen: Chosen, name: str) -> None:
        """Visit the best sets without a question, others in its place included."""
        at, barred = self.known(chosen), self.of(name)
        rest = {number: size for number, size in sizes_of(at).items() if number not in barred}
        held = beside(at, rest)
        log, more, amplitude = self._promising(held, barred)
        self.state(rest, at.excess)
        if log > at.log - HOPELESS:
            self.climbed(self._added(held, more, amplitude), barred)

    def _added(self, at: Evidence, more: int, amplitude: float) -> Evidence:
        """Return what is there of a set with one group more."""
        reached = self.state({**sizes_of(at), more: amplitude}, at.excess)
        on = [number for number, size in sizes_of(reached).items() if size > OFF]
        return self.state(dict.fromkeys(on, 1.0))

    def _promising(self, at: Evidence, barred: Chosen) -> tuple[float, int, float]:
        """Return which group adds most, all else held: log evidence, group and amplitude."""
        found, chosen = [(-np.inf, -1, 0.0)], frozenset(at.background.numbers)
        for number, (gain, amplitude) in further(at, self._bare.background).items():
            if number not in barred:
                self._logs[chosen | {number}] = at.log + gain
                found.append((at.log + gain, number, amplitude))
        return max(found)
