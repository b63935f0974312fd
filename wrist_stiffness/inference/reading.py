"""From the sets that a search fitted to probabilities: what is missing, and how sure that is."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from wrist_stiffness.inference.answer import CHANCE, Standing, Verdict
from wrist_stiffness.inference.point import EXPECTED, OUTSIDE
from wrist_stiffness.inference.search import NEGLIGIBLE, Names, Search, State

NAMING = 0.9
"""Probability from which an effect is named, by default."""

MEMBER = 0.05
"""Share of the probability of a class from which an effect is one of its members."""

MOST_MEMBERS = 8
"""A class of more effects names nothing."""

LEAST_REST = 1e-3
"""Least share of an effect's energy that something else beside it may have: its logarithm is evenly
spread from there to 1 (assumed)."""

GROWS = "makes the held-out error grow"
"""Why something is not named that only held-out units speak against."""

AS_MUCH = "explains as much, with less usual values"
"""Why something is not named that only what is usual speaks against."""

DETECTABLE = 3.0
"""Standard deviations that an effect of typical size must leave beyond the rest to be seen."""


@dataclass(frozen=True)
class Class:
    """An effect of the most probable set, and those that these data cannot tell from it.

    Parameters
    ----------
    members : dict of str to float
        Probability of each to be the one, most probable first.
    probability : float
        That one of them is missing in the model.
    itself : float
        That it is no stand-in for something outside the catalogue; a factor of `probability`.
    rest : float
        How much of it is left in its own shape: see `Evidence.rest`.
    left : float
        Share of what was left without it that is left with it, above the noise.
    log_gain : float
        Natural logarithm of the evidence with it over that without it.
    within, without : State
        The most probable set, and the best fit of its others alone.
    """

    members: Mapping[str, float]
    probability: float
    itself: float
    rest: float
    left: float
    log_gain: float
    within: State
    without: State

    @property
    def name(self) -> str:
        """Most probable member."""
        return next(iter(self.members))


@dataclass(frozen=True, eq=False)
class Reading:
    """What the sets of a search say.

    Parameters
    ----------
    state : State
        The set of everything that is named, or the nominal model.
    classes : tuple of Class
        Of the most probable set, the surest first; those from `naming` on are named.
    named : tuple of Class
        These.
    verdict : str
        `effect`, `none`, `undecided` or `unknown`.
    probability : float
        Of the verdict.
    depends_on : dict of str to float
        On what that which is left depends: share of its energy by question, largest first.
    unexplained : float
        Share of what the nominal model left above the noise that is left, in [0, 1].
    refuted : tuple of Class
        What would be named, if the held-out error did not grow by it.
    """

    state: State
    classes: tuple[Class, ...]
    named: tuple[Class, ...]
    verdict: Verdict
    probability: float
    depends_on: Mapping[str, float]
    unexplained: float
    refuted: tuple[Class, ...] = ()

    def refute(self, nominal: State) -> Reading:
        """Return the same without what is named, because the held-out error grows by it."""
        unknown = replace(self, state=nominal, named=(), verdict="unknown", unexplained=1.0)
        doubt = 1.0 - stands_in(1.0)
        doubted = {
            each.name: replace(
                each, probability=doubt * each.probability, itself=doubt * each.itself
            )
            for each in self.named
        }
        classes = tuple(doubted.get(each.name, each) for each in self.classes)
        return replace(unknown, classes=classes, refuted=tuple(doubted.values()))


def probabilities(search: Search) -> dict[Names, float]:
    """Return the probability of each set, of single effects that were not fitted to first order.

    A candidate of which the data say nothing keeps its prior probability, whatever is recorded: it
    does not count.  What slopes only promise is never more probable than the best fit.
    """
    logs = {names: state.log for names, state in search.states.items()}
    for name, gain in search.promised.items():
        if gain > 0.0:
            log = search.base.log + gain - search.price
            logs.setdefault(frozenset((name,)), min(log, search.best.log))
    values = np.array(list(logs.values()))
    weights = np.exp(values - values.max())
    return dict(zip(logs, (weights / weights.sum()).tolist(), strict=True))


def stands_in(rest: float, beside: float = OUTSIDE) -> float:
    """Return the probability that an effect only stands in for one outside the catalogue.

    What is outside leaves any share of itself in the shape of its best imitation; an effect that is
    there leaves nothing there, or now and then something else that looks like it, of any size.

    Parameters
    ----------
    rest : float
        Share that is left in its shape, 0 where it is no more than noise.
    beside : float, optional
        How much else is missing on average that may have left it; by default what is outside, for
        of the catalogue nothing explains what is left.
    """
    rest, outside = min(rest, 1.0), OUTSIDE / EXPECTED
    if rest <= LEAST_REST:
        return outside * LEAST_REST / (outside * LEAST_REST + 1.0)
    there = beside / (rest * -np.log(LEAST_REST))
    return float(outside / (outside + there))


def read(search: Search, naming: float = NAMING) -> Reading:
    """Return what the sets of a search say.

    Parameters
    ----------
    search : Search
        That ended.
    naming : float
        Probability from which an effect is named.
    """
    weights = probabilities(search)
    best = search.best
    classes = sorted(
        (_class_of(search, weights, best, name) for name in best.names),
        key=lambda each: (-each.probability, -each.log_gain),
    )
    named = tuple(
        each for each in classes if each.probability >= naming and len(each.members) <= MOST_MEMBERS
    )
    state = search.only(frozenset(each.name for each in named), best)
    first, left = search.base.evidence.unexplained, state.evidence.unexplained
    share = min(left / first, 1.0) if first > 0.0 else float(left > 0.0)
    verdict, probability = _verdict(weights, named, search.base.rough, naming)
    return Reading(state, tuple(classes), named, verdict, probability, _depends_on(state), share)


def settled(reading: Reading, state: State, search: Search, naming: float) -> Reading:
    """Return what the sets say where that which is handed over was fitted to the end.

    What the search had left above the noise may be taken up then: it is no error that is real.

    Parameters
    ----------
    reading : Reading
        Of the search.
    state : State
        Its set, fitted to the end.
    search : Search
        That ended.
    naming : float
        Probability from which an effect is named.
    """
    if state.rough or reading.refuted:
        return replace(reading, state=state)
    verdict, probability = _verdict(probabilities(search), reading.named, False, naming)
    return replace(
        reading,
        state=state,
        verdict=verdict,
        probability=probability,
        depends_on={},
        unexplained=0.0,
    )


def _verdict(
    weights: Mapping[Names, float], named: Sequence[Class], rough: bool, naming: float
) -> tuple[Verdict, float]:
    """Return the verdict and its probability; `rough`: more than noise is left without effects."""
    nothing = weights.get(frozenset(), 0.0) * (not rough)
    if named:
        return "effect", named[0].probability
    if rough or nothing < 1.0 - naming:
        return "unknown", 1.0 - nothing
    return "none" if nothing >= 0.5 else "undecided", nothing


def _class_of(search: Search, weights: Mapping[Names, float], best: State, name: str) -> Class:
    others = best.names - {name}
    found = _in_place_of(name, weights, best.names)
    total = sum(found.values())
    members = {
        each: weight / total
        for each, weight in sorted(found.items(), key=lambda pair: -pair[1])
        if weight >= MEMBER * total
    }
    present = sum(w for names, w in weights.items() if not names.isdisjoint(members))
    without = search.only(others, best)
    before, after = without.evidence.unexplained, best.evidence.unexplained
    left = min(after / before, 1.0) if before > 0.0 else 0.0
    rest = best.evidence.rest(name) if best.rough else 0.0
    itself = 1.0 - stands_in(rest)
    gain = best.evidence.log - without.evidence.log
    return Class(members, present * itself, itself, rest, left, gain, best, without)


def _in_place_of(name: str, weights: Mapping[Names, float], best: Names) -> dict[str, float]:
    """Return what stands in place of an effect of the best set, and how probable it is there.

    Beside the others of that set; or beside what stands in place of these, which data that cannot
    tell them apart allow as well.
    """
    least = MEMBER * weights[best]
    alike = {n: w for n, w in weights.items() if len(n) == len(best) and w >= least}
    swapped = {own: {own} for own in best}
    for names in alike:
        if len(best - names) == 1:
            swapped[next(iter(best - names))] |= names - best
    others, found = sorted(best - {name}), dict[str, float]()
    for names, weight in alike.items():
        for own in names.difference(others):
            pairs = (zip(others, each, strict=True) for each in permutations(names - {own}))
            if any(all(one in swapped[other] for other, one in each) for each in pairs):
                found[own] = found.get(own, 0.0) + weight
    return found


def _depends_on(state: State) -> dict[str, float]:
    found = state.evidence
    energies: dict[str, float] = {}
    groups = zip(found.background.groups, found.energies, found.discrepant, strict=True)
    for each, energy, wrong in groups:
        if wrong:
            energies[each.name] = energies.get(each.name, 0.0) + float(energy)
    total = sum(energies.values())
    if not found.unexplained:
        return {}
    shares = {name: energy / total for name, energy in energies.items() if energy > MEMBER * total}
    return dict(sorted(shares.items(), key=lambda pair: -pair[1]))


def not_shown(search: Search, reading: Reading) -> list[str]:
    """Return the candidates of which a typical size would not show, but for those that are told."""
    told = {name for each in reading.classes for name in each.members}
    return [
        name
        for name, strength in search.strength.items()
        if name not in told and strength < DETECTABLE
    ]


def standings(search: Search, reading: Reading) -> tuple[Standing, ...]:
    """Return how every candidate stands, the most probable first."""
    weights = probabilities(search)
    nominal = search.base.evidence.log
    named = {name for each in reading.named for name in each.members}
    refuted = {name for each in reading.refuted for name in each.members}
    itself = {name: each.itself for each in reading.classes for name in each.members}
    chance = {
        name: sum(w for names, w in weights.items() if name in names)
        for name in {name for names in weights for name in names}
    }
    fitted: dict[str, float] = {}
    for names, state in search.states.items():
        for name in names:
            gain = state.evidence.log - nominal
            fitted[name] = max(gain, fitted.get(name, gain))
    alike = _as_good(search, named)
    found = []
    for name in {**fitted, **search.promised}:
        gain = fitted[name] if name in fitted else search.promised[name]
        probability = chance.get(name, 0.0) * itself.get(name, 1.0)
        why = "" if name in named else _why_not(gain, probability, name in fitted)
        if why and name in alike:
            why = AS_MUCH
        if name in refuted:
            why = GROWS
        late = name not in fitted and gain >= CHANCE and bool(search.ended)
        if late:
            why = f"not compared: {search.ended}"
        known = None if late else probability
        found.append(Standing(name, known, gain, name in fitted, why))
    return tuple(sorted(found, key=lambda each: (-(each.probability or 0.0), -each.log_gain)))


def _as_good(search: Search, named: Collection[str]) -> set[str]:
    """Return the effects that in place of a named one leave no more than it does, but for noise."""
    best = search.best.evidence
    most = best.square + 2.0 * NEGLIGIBLE * best.excess
    return {
        name
        for names, state in search.states.items()
        if len(names) == len(search.best.names)
        and search.best.names - names <= set(named)
        and state.evidence.unexplained <= best.unexplained
        and state.evidence.square <= most
        for name in names - search.best.names
    }


def _why_not(gain: float, probability: float, fitted: bool) -> str:
    if gain < CHANCE:
        return "explains no more than chance would"
    if probability < MEMBER:
        return "others explain far more" if fitted else "others explain far more, to first order"
    return "not sure enough to be named"
