"""Effects enter one at a time with their own laws, for as long as the next one pays.

After each the earlier ones must still pay, and at the end each must be the best in its place.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from wrist_stiffness.campaign.searching.candidates import WristCandidate
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.place import WORTH, Candidates, Reached
from wrist_stiffness.campaign.searching.screening import FittedCandidate

LEADING = 0.3
"""Candidates that explain this share of what the best explains are fitted too."""

MOST_FITTED = 6
"""So many leaders are fitted with their own law, the base to first order."""

CLOSE, MOST_REFITTED = 0.6, 2
"""So many candidates that gain nearly as much as the best are fitted with the whole base: what the
base took up of one of them shows only then."""

MOST_TRIED = 3
"""So many candidates are fitted with the whole base before a step is given up."""

BROAD = 30
"""A law of so many constants (cross-talk of a load sensor) takes up a part of all that is missing:
beside an effect that was found it is not fitted, and only slopes may name it."""

MOST_EXTRAS = 3
"""With each the next fit takes longer; more are hardly told apart in a recording of minutes."""


def extended(fitter: Fitter, reached: Reached, candidates: Candidates) -> Reached:
    """Add effects while they pay, and let each of them hold its place.

    Parameters
    ----------
    fitter : Fitter
        Knows the model.
    reached : Reached
        Where the search stands.
    candidates : tuple of WristCandidate
        The catalogue there.
    """
    while len(reached.prices) < MOST_EXTRAS:
        more = _one_more(fitter, reached, candidates)
        if more is None:
            break
        reached = _thinned(fitter, more)
    if len(reached.prices) > 1:
        for name in reached.prices:
            reached = _contested(fitter, reached, name, candidates)
    return reached


def _one_more(fitter: Fitter, reached: Reached, candidates: Candidates) -> Reached | None:
    """Add the effect that gains most with its own law, if it pays."""
    screen = reached.screen()
    leaders = screen.leaders([e for e in candidates if _may_follow(e, reached.prices)])
    least = reached.least
    chosen = [each for each in leaders if each[0] > max(least, LEADING * leaders[0][0])]
    fits = [screen.fitted(each, shape, value) for value, each, shape in chosen[:MOST_FITTED]]
    # Columns may promise what the law itself, within its bounds, does not keep.
    hopeful = sorted((each for each in fits if each.gain > least), key=lambda each: -each.gain)
    hopeful = hopeful[:MOST_TRIED]
    while hopeful:
        close = [each for each in hopeful if each.gain > CLOSE * hopeful[0].gain][:MOST_REFITTED]
        trials = [with_one_more(fitter, reached, each) for each in close]
        best = min(trials, key=lambda each: each.total)
        if reached.total - best.total > least - WORTH:
            return best
        hopeful = hopeful[len(close) :]
    return None


def _may_follow(candidate: WristCandidate, found: Collection[str]) -> bool:
    return not found or (candidate.name not in found and len(candidate.usual) < BROAD)


def _thinned(fitter: Fitter, reached: Reached) -> Reached:
    """Take out effects that do not pay any more beside the newest."""
    for name in list(reached.prices)[:-1]:
        lost = reached.screen(without=name).energy - reached.screen().energy
        if lost < WORTH + reached.prices[name]:
            less = without_one(fitter, reached, name)
            reached = less if less.total < reached.total else reached
    return reached


def _contested(fitter: Fitter, reached: Reached, name: str, candidates: Candidates) -> Reached:
    """Give the place of one effect to another where that explains more beside all the others."""
    screen = reached.screen(without=name)
    others = reached.prices.keys() - {name}
    value, best, shape = screen.leaders([e for e in candidates if _may_follow(e, others)])[0]
    if best.name == name or value < WORTH:
        return reached
    rival = screen.fitted(best, shape, value)
    kept = screen.energy - reached.screen().energy - reached.prices[name]
    if rival.gain < kept:
        return reached
    swapped = with_one_more(fitter, reached, rival, instead_of=name)
    return swapped if swapped.total < reached.total else reached


def with_one_more(
    fitter: Fitter, reached: Reached, added: FittedCandidate, instead_of: str | None = None
) -> Reached:
    """Fit the whole base along with one effect more.

    From the drawing as well where very much is left: a base that gave way does not find back.

    Parameters
    ----------
    fitter : Fitter
        Knows the model.
    reached : Reached
        Where the search stands.
    added : FittedCandidate
        What is added, fitted with the base to first order.
    instead_of : str, optional
        Name of an effect that leaves its place to it.
    """
    prices = {name: price for name, price in reached.prices.items() if name != instead_of}
    extras = [reached.effects[name] for name in prices] + [added.effect]
    sessions = reached.base.problem.sessions
    base = fitter(sessions, extras, reached.base)
    found = replace(
        reached,
        base=base,
        prices={**prices, added.candidate.name: added.price},
        steps=(*reached.steps, reached.base),
    )
    if found.rough:
        afresh = replace(found, base=fitter(sessions, extras))
        found = min(found, afresh, key=lambda each: each.total)
    return found


def without_one(fitter: Fitter, reached: Reached, name: str) -> Reached:
    """Fit the whole base along with one effect less.

    Parameters
    ----------
    fitter : Fitter
        Knows the model.
    reached : Reached
        Where the search stands.
    name : str
        Of the effect that is taken out.
    """
    prices = {own: price for own, price in reached.prices.items() if own != name}
    extras = [reached.effects[own] for own in prices]
    base = fitter(reached.base.problem.sessions, extras, reached.base)
    return replace(reached, base=base, prices=prices)
