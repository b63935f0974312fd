"""The point about which effects become columns: the base, fitted along with what shows beside it.

Where slopes lead nowhere, what they do not show is fitted whole.
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
from wrist_stiffness.campaign.searching.stepwise import extended, with_one_more, without_one
from wrist_stiffness.campaign.unit_session import UnitSession

Sessions = tuple[UnitSession, ...]

CAUGHT = 0.5
"""Share of what effects seem to explain from which on it is the base's own: a wrong flange had
caught it at first, and what is found at such a place stands in for that."""

PRESSING = frozenset(("axis_misalignment", "flange_contact", "gravity"))
"""Laws that press and open flanges: where the base took up a part of one, other flanges touch, and
its columns there say little of what it would explain."""

RUBBING = frozenset(("joint_friction", "cable_wrench"))
"""Laws that stick before they slip: tried likewise, as the base takes up what holds it."""

CLOSING = frozenset(("bushing_stiffness", "bushing_hardening"))
"""Laws of a bushing: what the law of play does not say quite right looks like a softer one."""

UNSEEN = PRESSING | RUBBING | LOOSE
"""Laws that no slope shows as they are."""


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
        self._ends: dict[frozenset[str], BaseFit] = {}
        self._begin(self._fitter(sessions))
        explained = self._first.base.cost - self._reached.base.cost
        if self._first.base.cost - self._alone.base.cost > CAUGHT * explained > 0.0:
            self._begin(self._alone.base)

    def _begin(self, base: BaseFit) -> None:
        """Search from a base alone."""
        self._first = Reached(base, {}, base.cost)
        self._catalogue = self._at(self._first)
        self._reached = extended(self._fitter, self._first, self._catalogue)
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
        if begun is not None and not any(begun.base is each for each in fits.values()):
            begun = self._from_wall_to_wall(begun)
        if begun is None or begun.base.cost < INEXACT * begun.base.problem.table.measured.sum():
            return None
        if (fits or not names) and not begun.astray:
            return None
        if begun.astray:
            trials = from_afar(self._fitter, begun, self._catalogue)
            begun = self._without(begun, trials)
        else:
            trials = self._trials(begun, self.beside(begun.base, LOOSE).candidates)
        return self._side_by_side(begun, trials)

    def _from_wall_to_wall(self, begun: Reached) -> Reached:
        """Return play that leaves very much fitted as what is sought beside it will be.

        In a wrong minimum it may leave many times as much, and whatever is fitted beside it with
        rounded walls seems to explain the difference.
        """
        if not (begun.astray and begun.loose):
            return begun
        sessions, extras = begun.base.problem.sessions, list(begun.effects.values())
        base = self._fitter(sessions, extras, begun.base, beside=True, walls="rounded first")
        return self._better(begun, base)

    def _without(self, begun: Reached, trials: Mapping[str, Reached]) -> Reached:
        """Return play fitted alone from where more beside it led: what led there may be no more.

        Large play of one joint may find its minimum only beside play of another, and then leave as
        little without it.
        """
        if begun.loose:
            for name, each in trials.items():
                begun = self._better(begun, without_one(self._fitter, each, name).base)
        return begun

    def _better(self, begun: Reached, base: BaseFit) -> Reached:
        if base.cost >= begun.base.cost:
            return begun
        self._ends[frozenset(base.extras)] = base
        return replace(begun, base=base)

    def ended(self, names: Collection[str]) -> BaseFit | None:
        """Return the fit along with what was named, if its play was fitted beyond where slopes led.

        Parameters
        ----------
        names : collection of str
            What was named, and nothing else.
        """
        return self._ends.get(frozenset(names))

    def by_law(self, names: Collection[str], members: Collection[str]) -> Place | None:
        """Fit what slopes do not tell apart one by one with the whole base, beside what was named.

        None where no fit has what was named, or none of them explains anything.

        Parameters
        ----------
        names : collection of str
            What was named before.
        members : collection of str
            Of a class.
        """
        begun = self._named(names, {})
        if begun is None:
            return None
        tried = [each for each in self.beside(begun.base).candidates if each.name in members]
        return self._side_by_side(begun, self._trials(begun, tried))

    def _side_by_side(self, begun: Reached, trials: Mapping[str, Reached]) -> Place | None:
        """Return the place of fits that explain more than laws leave of what was found, or None."""
        worthy = {name: each for name, each in trials.items() if each.total < begun.total}
        if not begun.astray:
            self._finish(worthy)
        least = begun.least - WORTH
        worthy = {n: each for n, each in worthy.items() if begun.total - each.total > least}
        if not worthy:
            return None
        known = self.beside(begun.base).candidates
        return replace(_as_they_are(begun, known, worthy), known=True)

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
            begun = without_one(self._fitter, begun, name)
        # The search may have been lower with the same effects than where a further one led it.
        passed = [each for each in begun.steps if set(each.extras) == begun.prices.keys()]
        base = min([begun.base, *passed], key=lambda each: each.cost)
        return replace(begun, base=base)

    def _trials(self, begun: Reached, tried: Sequence[WristCandidate]) -> dict[str, Reached]:
        """Fit candidates one by one, with the whole base and what it has."""
        screen, found = begun.screen(), {}
        leaders = screen.leaders(tried)
        for value, each, shape in leaders:
            found[each.name] = with_one_more(self._fitter, begun, screen.fitted(each, shape, value))
        return found

    def _finish(self, trials: dict[str, Reached]) -> None:
        """Fit play to its end where it explains most, and put it in its place.

        What it leaves where the base's slopes do not know of it would be taken for an effect.
        Where very much is left these lead nowhere: then it is begun from the drawing as well.  So
        is all play where the base gave way to something: from there no pin finds its play.
        """
        loose = [name for name, each in trials.items() if each.loose]
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
        return Place(base, self._evaluated(point, held, (), laws), known=True)

    def after(self, base: BaseFit) -> Place:
        """Return the place of a whole fit, to ask whether anything is left.

        With the slopes about the first base: about this one, with play in it, they take a minute.
        """
        others = tuple(each for each in self._catalogue if each.name not in base.extras)
        return Place(base, others, known=True)

    def _at(self, reached: Reached) -> Candidates:
        held = {effect.name for effect in reached.base.problem.model.effects}
        usual = {each.effect.name for each in free_base(self._fitter.model)[0]}
        return self._evaluated(point_of(reached.base), held, reached.effects.keys() - usual)

    def _evaluated(
        self,
        point: Point,
        held: Collection[str],
        seen: Collection[str],
        laws: Collection[str] | None = None,
    ) -> Candidates:
        tried = ", ".join(sorted(laws)) if laws else "every effect of the catalogue"
        self._fitter.tell(f"trying {tried}")
        return wrist_candidates(point, held, seen, laws)


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
