"""On what that which a model leaves depends: which groups of its discrepancy are there.

Every set of groups has an evidence.  Sets are visited from none on: what would add most to the
evidence comes first, and what is there is left out once, so that another one can take
its place.  All probabilities are the shares of the sets in the evidence of all that were visited.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.inference.amplitudes import further, settled
from wrist_stiffness.inference.answer import MEMBER
from wrist_stiffness.inference.discrepancy import SLOW_DRIFT
from wrist_stiffness.inference.evidence import OFF, Array, Evidence
from wrist_stiffness.inference.point import Background, Point

HELD = 3.0
"""Log evidence that a group may gain when the amplitudes of the others follow."""

HOPELESS = 10.0
"""Log evidence below the best at which a set is not searched further."""

Chosen = frozenset[int]


@dataclass(frozen=True)
class Dependence:
    """One condition on which the error depends.

    Parameters
    ----------
    members : dict of str to float
        Questions that these data cannot tell apart, with the probability of each to be the one; the
        most probable first.
    probability : float
        That the error depends on one of them.
    groups : tuple of int
        Places of the groups of the first one in the background.
    """

    members: Mapping[str, float]
    probability: float
    groups: tuple[int, ...]

    @property
    def name(self) -> str:
        """Most probable question."""
        return next(iter(self.members))


@dataclass(frozen=True, eq=False)
class Dependences:
    """Answer to the question on what an error depends.

    Parameters
    ----------
    found : tuple of Dependence
        Of the most probable set, the surest first.
    nothing : float
        Probability that the error depends on nothing.
    chances : dict of str to float
        Probability of each question that was asked.
    state : Evidence
        Of the most probable set; its rows sum up those of the table.
    chosen : tuple of int
        Places of its groups in the background that was given.
    """

    found: tuple[Dependence, ...]
    nothing: float
    chances: Mapping[str, float]
    state: Evidence
    chosen: tuple[int, ...]


def dependences(point: Point, background: Background) -> Dependences:
    """Find the groups of the discrepancy on which depends what a fit leaves.

    Parameters
    ----------
    point : Point
        Where the fit ended.
    background : Background
        All groups that are asked, and the drift.
    """
    sets = _Sets(*_summed_up(point, background))
    sets.climbed(sets.always)
    best = sets.best
    for name in sets.names(best):
        sets.without(best, name)
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
        sets.state(best),
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
        _beside={},
    )
    return summed, replace(background, groups=groups)


class _Sets:
    """Sets of groups and their evidence."""

    def __init__(self, point: Point, background: Background) -> None:
        self._point, self._all = point, background
        self._known: dict[Chosen, tuple[float, Array, float]] = {}
        self._logs: dict[Chosen, float] = {}
        self.always: Chosen = self.of(SLOW_DRIFT)
        self._optional: Chosen = frozenset(np.flatnonzero(background.optional).tolist())

    def name(self, number: int) -> str:
        """Return the question of a group."""
        return self._all.groups[number].name

    def names(self, chosen: Chosen) -> frozenset[str]:
        """Return the questions of a set."""
        return frozenset(self.name(number) for number in chosen & self._optional)

    def of(self, name: str) -> Chosen:
        """Return the groups of a question."""
        return frozenset(n for n, each in enumerate(self._all.groups) if each.name == name)

    @property
    def best(self) -> Chosen:
        """Most probable set."""
        return max(self._known, key=lambda chosen: self._known[chosen][0])

    def weights(self) -> dict[Chosen, float]:
        """Return the probability of each set, of those that were not tried whole to first order."""
        logs = self._logs | {n: log for n, (log, _, _) in self._known.items() if log > -np.inf}
        values = np.array(list(logs.values()))
        weights = np.exp(values - values.max())
        return dict(zip(logs, (weights / weights.sum()).tolist(), strict=True))

    def state(
        self, chosen: Chosen, start: Mapping[int, float] | None = None, excess: float = 1.0
    ) -> Evidence:
        """Return the evidence of a set, the search for its amplitudes begun at those given."""
        if chosen in self._known:
            return self._evidence(chosen, *self._known[chosen][1:])
        begun = np.array([(start or {}).get(number, 1.0) for number in sorted(chosen)])
        found = settled(self._evidence(chosen, begun, excess))
        # With a group that is off it is the smaller set once more.
        log = found.log if (found.amplitude > OFF).all() else -np.inf
        self._known[chosen] = log, found.amplitude, found.excess
        return found

    def _evidence(self, chosen: Chosen, amplitude: Array, excess: float) -> Evidence:
        return Evidence(self._point, self._all.part(chosen), amplitude, excess)

    def climbed(self, chosen: Chosen, barred: Chosen = frozenset()) -> None:
        """Add to a set what helps most for as long as that pays."""
        at = self.state(chosen)
        while True:
            log, more, amplitude = self._promising(at, chosen, barred)
            if log < at.log - HELD:
                break
            there = self._added(at, chosen, more, amplitude)
            reached = self.state(there)
            if reached.log <= at.log:
                break
            chosen, at = there, reached

    def without(self, best: Chosen, name: str) -> None:
        """Visit the best sets without a question, others in its place included."""
        at, rest, barred = self.state(best), best - self.of(name), self.of(name)
        kept = [place for place, number in enumerate(sorted(best)) if number in rest]
        held = self._evidence(rest, at.amplitude[kept], at.excess)
        log, more, amplitude = self._promising(held, rest, barred)
        self.state(rest, dict(zip(sorted(rest), held.amplitude, strict=True)), at.excess)
        if log > at.log - HOPELESS:
            self.climbed(self._added(held, rest, more, amplitude), barred)

    def _added(self, at: Evidence, chosen: Chosen, more: int, amplitude: float) -> Chosen:
        """Return what is there of a set with one group more."""
        known = dict(zip(sorted(chosen), at.amplitude.tolist(), strict=True))
        both = chosen | {more}
        reached = self.state(both, {**known, more: amplitude}, at.excess)
        on = zip(sorted(both), reached.amplitude, strict=True)
        return frozenset(number for number, size in on if size > OFF)

    def _promising(self, at: Evidence, chosen: Chosen, barred: Chosen) -> tuple[float, int, float]:
        """Return which group adds most, all else held: log evidence, group and amplitude."""
        found = [(-np.inf, -1, 0.0)]
        for number, (gain, amplitude) in further(at, self._all).items():
            if number not in barred:
                self._logs[chosen | {number}] = at.log + gain
                found.append((at.log + gain, number, amplitude))
        return max(found)
