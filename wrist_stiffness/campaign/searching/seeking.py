"""The point about which effects become columns: the base, fitted along with what shows beside it.

Effects enter one at a time with their own laws, for as long as the next one pays for its freedom.
After each the earlier ones must still pay, and at the end each must be the best in its place.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from wrist_stiffness.campaign.searching.base_fit import LOOSE, BaseFit, free_base
from wrist_stiffness.campaign.searching.candidates import Point, WristCandidate, wrist_candidates
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.from_afar import from_afar
from wrist_stiffness.campaign.searching.place import (
    INEXACT,
    WORTH,
    Candidates,
    Place,
    Reached,
    point_of,
)
from wrist_stiffness.campaign.searching.screening import Fitted
from wrist_stiffness.campaign.unit_session import UnitSession
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel

Sessions = tuple[UnitSession, ...]

LEADING = 0.3
"""Candidates that explain this share of what the best explains are fitted too."""

MOST_FITTED = 6
"""So many leaders are fitted with their own law, the base to first order."""

CLOSE, MOST_REFITTED = 0.6, 2
"""So many candidates that gain nearly as much as the best are fitted with the whole base: what the
base took up of one of them shows only then."""

CAUGHT = 0.5
"""Share of what effects seem to explain from which on it is the base's own: a wrong flange had
caught it at first, and what is found at such a place stands in for that."""

MOST_TRIED = 3
"""So many candidates are fitted with the whole base before a step is given up."""

PRESSING = frozenset(("axis_misalignment", "flange_contact", "gravity"))
"""Laws that press and open flanges: where the base took up a part of one, other flanges touch, and
its columns there say little of what it would explain."""

RUBBING = frozenset(("joint_friction", "cable_wrench"))
"""Laws that stick before they slip: tried likewise, as the base takes up what holds it."""

CLOSING = frozenset(("bushing_stiffness", "bushing_hardening"))
"""Laws of a bushing: 0.5 um of play of another shape looked like one of 0.2 of its stiffness."""

UNSEEN = PRESSING | RUBBING | LOOSE
"""Laws that no slope shows as they are."""

MOST_EXTRAS = 3
"""With each the next fit takes longer; more are hardly told apart in a recording of minutes."""


class Search:
    """The search on some sessions: quick at first, and thorough where that explains too little.

    Parameters
    ----------
    fitter : Fitter
        Knows the model.
    sessions : tuple of UnitSession
        In the order of time.
    """

    def __init__(self, fitter: Fitter, sessions: Sessions) -> None:
        self._fitter = fitter
        self._begin(self._fitter(sessions))
        explained = self._first.base.cost - self._reached.base.cost
        if self._first.base.cost - self._alone.base.cost > CAUGHT * explained > 0.0:
            self._begin(self._alone.base)

    def _begin(self, base: BaseFit) -> None:
        """Search from a base alone."""
        self._first = Reached(base, {}, base.cost)
        self._catalogue = self._at(self._first)
        self._reached = _extended(self._fitter, self._first, self._catalogue)
        self._alone = self._again()

    def _again(self) -> Reached:
        """Return the base alone from where the search led: a wrong flange may have caught it."""
        if self._reached is self._first:
            return self._first
        sessions = self._first.base.problem.sessions
        again = self._fitter(sessions, (), self._reached.base)
        if again.cost > self._first.base.cost - WORTH:
            return self._first
        return Reached(again, {}, again.cost)

    @property
    def catalogue(self) -> Candidates:
        """The catalogue about the base alone."""
        return self._catalogue

    @property
    def found(self) -> Collection[str]:
        """Names of the effects to which tangents led, each fitted whole."""
        return self._reached.prices.keys()

    @property
    def strained(self) -> bool:
        """Whether the base alone had to go far to explain the sessions."""
        return self._alone.base.strained

    @property
    def first_cost(self) -> float:
        """Weighted sum of squares that the base alone leaves."""
        return self._first.base.cost

    @property
    def doubtful(self) -> bool:
        """Whether the base is strained still beside what tangents led to.

        Not where that was large: then nothing else explains as much.
        """
        return self._reached.base.strained and not self._first.rough

    @property
    def rough(self) -> bool:
        """Whether very much is left beside what tangents led to."""
        return self._reached.rough

    @property
    def explained(self) -> bool:
        """Whether one effect, to which tangents led, leaves no more than the noise as it is."""
        base = self._reached.base
        return len(self.found) == 1 and base.cost <= float(base.problem.table.measured.sum())

    def quick(self) -> Place:
        """Return where tangents led, and the catalogue there."""
        if self._reached is self._first:
            return Place(self._first.base, self._catalogue)
        return Place(self._reached.base, self._at(self._reached))

    def thorough(self, laws: Collection[str] = UNSEEN) -> Place | None:
        """Fit what no tangent shows one by one with the whole base; return all side by side.

        Each with what it changes, base and all, in place of its tangents.  None where nothing comes
        as far as the base alone, or as what tangents led to.

        Parameters
        ----------
        laws : collection of str
            Which are fitted, beside those to which tangents led.
        """
        alone = self._alone
        known = self._catalogue if alone is self._first else self._at(alone)
        tried = [e for e in known if e.law.id in laws or e.name in self.found]
        trials = self._trials(alone, tried)
        self._finish(trials)
        least = min((each.total for each in trials.values()), default=np.inf)
        if least > min(alone.total, self._reached.total + WORTH):
            return None
        if len(self._reached.prices) == 1:
            trials |= dict.fromkeys(self._reached.prices, self._reached)
        return _as_they_are(alone, known, trials)

    def further(self, names: Collection[str], fits: Mapping[str, BaseFit]) -> Place | None:
        """Try play with the whole base beside what was named, where that leaves more than noise.

        Beside what of it was fitted: what only slopes named stands to question again.  Axes, gaps
        and weights would be mistaken for each other, play is not; nor is, beside play that leaves
        very much, a joint that rubs.  Where nothing was named only if very much is left.

        Parameters
        ----------
        names : collection of str
            What was named.
        fits : dict of str to BaseFit
            Whole fits that were found already, by what was named last.
        """
        begun = self._named(names, fits)
        if begun is None or begun.base.cost < INEXACT * begun.base.problem.table.measured.sum():
            return None
        if (fits or not names) and not begun.rough:
            return None
        if begun.rough:
            trials = from_afar(self._fitter, begun, self._catalogue)
        else:
            trials = self._trials(begun, self.beside(begun.base, LOOSE).candidates)
        trials = {name: each for name, each in trials.items() if each.total < begun.total}
        if not trials:
            return None
        if not begun.rough:
            self._finish(trials)
        known = self.beside(begun.base).candidates
        return replace(_as_they_are(begun, known, trials), known=True)

    def _named(self, names: Collection[str], fits: Mapping[str, BaseFit]) -> Reached | None:
        """Return where the search stands with what was named alone; None where no fit has it."""
        if not names:
            return self._first
        begun = self._reached
        if whole := [fits[name] for name in names if name in fits]:
            base = max(whole, key=lambda each: len(each.extras))
            begun = Reached(base, dict.fromkeys(base.extras, 0.0), self.first_cost)
        if not begun.prices.keys() & set(names):
            return None
        for name in [each for each in begun.prices if each not in names]:
            begun = _without(self._fitter, begun, name)
        return begun

    def _trials(self, begun: Reached, tried: Sequence[WristCandidate]) -> dict[str, Reached]:
        """Fit candidates one by one, with the whole base and what it has."""
        screen, found = begun.screen(), {}
        leaders = screen.leaders(tried)
        for value, each, shape in leaders:
            found[each.name] = _with(self._fitter, begun, screen.fitted(each, shape, value))
        return found

    def _finish(self, trials: dict[str, Reached]) -> None:
        """Fit play to its end where it explains most, and put it in its place.

        What it leaves where the base's slopes do not know of it would be taken for an effect.
        Where very much is left these lead nowhere: then it is begun from the drawing as well.  So
        is all play where the base gave way to something: from there no pin finds its play.
        """
        loose = [e for e in trials if any(f.law.id in LOOSE for f in trials[e].effects.values())]
        if not loose:
            return
        if self._alone.gave_way:
            for each in loose:
                trials[each] = self._from_the_drawing(trials[each])
        name = min(loose, key=lambda each: trials[each].total)
        best = trials[name]
        if best.total > min(each.total for each in trials.values()) and not best.rough:
            return
        sessions, extras = best.base.problem.sessions, list(best.effects.values())
        starts = (best.base, None) if best.rough else (best.base,)
        ends = [self._fitter(sessions, extras, start, beside=True) for start in starts]
        fits = [best, *(replace(best, base=base) for base in ends)]
        trials[name] = min(fits, key=lambda each: each.total)

    def _from_the_drawing(self, reached: Reached) -> Reached:
        """Return the better of a fit and of the same begun from the drawing, beside its play."""
        sessions, extras = reached.base.problem.sessions, list(reached.effects.values())
        afresh = replace(reached, base=self._fitter(sessions, extras, beside=True))
        return min(reached, afresh, key=lambda each: each.total)

    def beside(self, base: BaseFit, laws: Collection[str] | None = None) -> Place:
        """Return the place where everything that was fitted along with a base is known.

        How a gap closes is of its law, which is not exact: the bushing in it is not asked for.
        Of some laws alone where these are asked for: with play in the base all take long.
        """
        held = {effect.name for effect in base.problem.model.effects} | set(base.extras)
        gaps = [each.component for each in base.beyond().values() if each.law.id in LOOSE]
        held |= {f"{law}@{gap}" for law in CLOSING for gap in gaps}
        point = point_of(base, with_extras=True)
        return Place(base, self._evaluated(point, held, {}, laws), known=True)

    def after(self, base: BaseFit) -> Place:
        """Return the place of a whole fit, to ask whether anything is left.

        With the slopes about the first base: about this one, with play in it, they take a minute.
        """
        others = tuple(each for each in self._catalogue if each.name not in base.extras)
        return Place(base, others, known=True)

    def _at(self, reached: Reached) -> Candidates:
        held = {effect.name for effect in reached.base.problem.model.effects}
        near = _near(self._fitter.model, reached.effects)
        return self._evaluated(point_of(reached.base), held, near)

    def _evaluated(
        self,
        point: Point,
        held: Collection[str],
        near: Mapping[str, Mapping[str, float]],
        laws: Collection[str] | None = None,
    ) -> Candidates:
        tried = ", ".join(sorted(laws)) if laws else "every effect of the catalogue"
        self._fitter.tell(f"trying {tried}")
        return wrist_candidates(point, held, near, laws)


def _as_they_are(begun: Reached, known: Candidates, trials: Mapping[str, Reached]) -> Place:
    """Return a place where candidates that were fitted stand for their whole fits."""
    alone, fits = begun.base, {name: each.base for name, each in trials.items()}
    catalogue = tuple(
        each.changed_by(
            # What was not measured has no residual.
            np.nan_to_num(alone.residual - fits[each.name].residual),
            fits[each.name].strain - alone.strain,
        )
        if each.name in fits
        else each
        for each in known
    )
    return Place(alone, catalogue, fits)


def _near(model: ErrorModel, extras: Mapping[str, Effect]) -> dict[str, Mapping[str, float]]:
    """Return the values found, of effects that are no part of the base."""
    usual = {each.effect.name for each in free_base(model)[0]}
    return {
        name: {key: own.value for key, own in each.estimates.items()}
        for name, each in extras.items()
        if name not in usual
    }


def _extended(fitter: Fitter, reached: Reached, candidates: Candidates) -> Reached:
    """Add effects while they pay, and let each of them hold its place."""
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
    leaders = screen.leaders([each for each in candidates if each.name not in reached.prices])
    least = reached.least
    chosen = [each for each in leaders if each[0] > max(least, LEADING * leaders[0][0])]
    fits = [screen.fitted(each, shape, value) for value, each, shape in chosen[:MOST_FITTED]]
    # Columns may promise what the law itself, within its bounds, does not keep.
    hopeful = sorted((each for each in fits if each.gain > least), key=lambda each: -each.gain)
    hopeful = hopeful[:MOST_TRIED]
    while hopeful:
        close = [each for each in hopeful if each.gain > CLOSE * hopeful[0].gain][:MOST_REFITTED]
        trials = [_with(fitter, reached, each) for each in close]
        best = min(trials, key=lambda each: each.total)
        if reached.total - best.total > least - WORTH:
            return best
        hopeful = hopeful[len(close) :]
    return None


def _thinned(fitter: Fitter, reached: Reached) -> Reached:
    """Take out effects that do not pay any more beside the newest."""
    for name in list(reached.prices)[:-1]:
        lost = reached.screen(without=name).energy - reached.screen().energy
        if lost < WORTH + reached.prices[name]:
            less = _without(fitter, reached, name)
            reached = less if less.total < reached.total else reached
    return reached


def _contested(fitter: Fitter, reached: Reached, name: str, candidates: Candidates) -> Reached:
    """Give the place of one effect to another where that explains more beside all the others."""
    screen = reached.screen(without=name)
    others = reached.prices.keys() - {name}
    value, best, shape = screen.leaders([e for e in candidates if e.name not in others])[0]
    if best.name == name or value < WORTH:
        return reached
    rival = screen.fitted(best, shape, value)
    kept = screen.energy - reached.screen().energy - reached.prices[name]
    if rival.gain < kept:
        return reached
    swapped = _with(fitter, reached, rival, instead_of=name)
    return swapped if swapped.total < reached.total else reached


def _with(
    fitter: Fitter, reached: Reached, added: Fitted, instead_of: str | None = None
) -> Reached:
    prices = {name: price for name, price in reached.prices.items() if name != instead_of}
    extras = [reached.effects[name] for name in prices] + [added.effect]
    sessions = reached.base.problem.sessions
    base = fitter(sessions, extras, reached.base)
    found = replace(reached, base=base, prices={**prices, added.candidate.name: added.price})
    if found.rough:
        afresh = replace(found, base=fitter(sessions, extras))
        found = min(found, afresh, key=lambda each: each.total)
    return found


def _without(fitter: Fitter, reached: Reached, name: str) -> Reached:
    prices = {own: price for own, price in reached.prices.items() if own != name}
    extras = [reached.effects[own] for own in prices]
    base = fitter(reached.base.problem.sessions, extras, reached.base)
    return replace(reached, base=base, prices=prices)
