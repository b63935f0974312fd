"""Find the physical effects that are missing in a model of this wrist.

The statistics are linear, the wrist is not: so the point about which its effects become columns is
sought first, by fits of the leading candidates with their own laws, the base along with them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.observing import Observed
from wrist_stiffness.campaign.searching.asking import asked
from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.campaign.searching.candidates import WristCandidate
from wrist_stiffness.campaign.searching.contributions import (
    Contribution,
    contributions,
    ranked,
)
from wrist_stiffness.campaign.searching.fitter import Fitter, Tell, silent
from wrist_stiffness.campaign.searching.place import INEXACT, Place
from wrist_stiffness.campaign.searching.possible import possible
from wrist_stiffness.campaign.searching.refit import Refitted, foretold, refit
from wrist_stiffness.campaign.searching.seeking import PRESSING, Search
from wrist_stiffness.campaign.searching.stepwise import MOST_EXTRAS
from wrist_stiffness.campaign.searching.taken_up import TakenUp, taken_up
from wrist_stiffness.campaign.searching.telling import (
    buys_anything,
    explained,
    rejudged,
    sized,
    valued,
    withdrawn,
)
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.diagnosis import Diagnosis, Settings
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel

MUCH = 0.25
"""Share of the excess over the noise that is much to be left beside what was named."""

Ask = Callable[[Place], Diagnosis]


@dataclass(frozen=True, eq=False)
class WristDiagnosis:
    """Answer of a diagnosis on the wrist.

    Parameters
    ----------
    diagnosis : Diagnosis
        What the statistics say.
    observed : Observed
        Table of what the refitted base leaves.
    effects : tuple of Effect
        Best member of each finding, fitted with its own law.
    base : BaseFit
        Fitted along with these.
    suspected : BaseFit
        Fitted along with these and with all that explains more than its freedom costs.
    contributions : tuple of Contribution
        What each effect of that fit adds to the error, largest first.
    absorbed : tuple of TakenUp
        What that base took up: the set-up first, then tolerances, furthest from its prior first.
    """

    diagnosis: Diagnosis
    observed: Observed
    effects: tuple[Effect, ...]
    base: BaseFit
    suspected: BaseFit
    contributions: tuple[Contribution, ...]
    absorbed: tuple[TakenUp, ...]


def diagnose_sessions(
    model: ErrorModel,
    sessions: Sequence[MeasuredSession],
    rng: np.random.Generator,
    settings: Settings | None = None,
    tell: Tell = silent,
) -> WristDiagnosis:
    """Find the effects of the catalogue that a model misses.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    sessions : sequence of MeasuredSession
        In the order of time; the last one judges what the others found, the end of the only one
        where there is one.
    rng : numpy.random.Generator
        Source of chance.
    settings : Settings, optional
        Thresholds.
    tell : callable, optional
        Told what is being done, every few seconds.

    Returns
    -------
    WristDiagnosis
        What the statistics say, and the fits that this rests on.

    Raises
    ------
    InputError
        If there is no session, or one without any measured pose.
    """
    _require_poses(sessions)
    chosen = settings or Settings()
    units = tuple(as_units(model, session) for session in sessions)
    fitter = Fitter(model, tell)
    search = Search(fitter, units)

    def ask(place: Place) -> Diagnosis:
        tell("asking chance and resamples")
        return asked(place, rng, chosen)

    def judge(place: Place, result: Diagnosis) -> Refitted:
        base, named = _begun(place, result)
        saw_all = bool(place.fits)
        return refit(fitter, base, named, chosen.sealed_share, search.first_cost, saw_all)

    place, result, judged = _judged(search, ask, judge)
    base, named = _begun(place, result)
    final = judged.base
    effects = {each.name: each for each in final.effects(0) if each.name in final.extras}
    result = rejudged(withdrawn(result, effects), judged.stages)
    result = withdrawn(result, [each.name for each in result.findings if buys_anything(each)])
    kept = tuple(effects[each.name] for each in result.findings)
    absorbed = taken_up(final, [session.name for session in sessions])
    result = replace(result, absorbed=tuple(each.sentence for each in absorbed))
    suspected = _with_all(fitter, base, named, final)
    parts = contributions(suspected, {each.name for each in kept})
    parts = ranked([*parts, *possible(suspected, search.catalogue)])
    observed = base.left(with_extras=False)
    if kept and result.verdict == "unknown":

        def by_laws(found: Diagnosis) -> Diagnosis:
            if judged.stages:
                return found
            stages = foretold(fitter, final, kept, chosen.sealed_share)
            return explained(rejudged(found, stages), kept)

        result = _settled(result, search, final, ask, chosen.unexplained_share, by_laws)
    result = sized(valued(result, final, place.fits.keys() & place.base.extras), kept)
    return WristDiagnosis(result, observed, kept, final, suspected, parts, absorbed)


def _require_poses(sessions: Sequence[MeasuredSession]) -> None:
    if not sessions:
        raise InputError("no session to diagnose")
    for session in sessions:
        if not (np.isfinite(session.shift).any() or np.isfinite(session.rotation).any()):
            raise InputError(f"{session.name}: no measured pose in the whole session")


def _judged(
    search: Search, ask: Ask, judge: Callable[[Place, Diagnosis], Refitted]
) -> tuple[Place, Diagnosis, Refitted]:
    """Return the answer of a search, where it was found, and what of it holds with its own laws.

    Slopes that mislead name what does not hold: then whole fits are asked, where the rest of what
    they named leaves more than noise.
    """
    place, result = _answered(search, ask)
    judged = judge(place, result)
    if not place.fits and judged.base.variance >= INEXACT:
        other = _by_law(search, ask, result)
        if other is not None:
            again = judge(*other)
            if again.base.cost < judged.base.cost:
                return *other, again
    held = judged.base.extras
    explains = bool(held) and judged.base.variance < INEXACT
    if len(held) == len(result.findings) or explains or place.fits:
        return place, result, judged
    other = _whole(search.thorough(), search, ask)
    if other is None or not _says_more(other[1], withdrawn(result, held)):
        return place, result, judged
    return *other, judge(*other)


def _answered(search: Search, ask: Ask) -> tuple[Place, Diagnosis]:
    """Return the answer of a search, the quick one as a rule, and where it was found."""
    place = search.quick()
    result = ask(place)
    strained = search.doubtful if result.findings else search.strained
    # Fits found something else than slopes name, and these do not explain everything.
    others = search.found != {each.name for each in result.findings}
    otherwise = others and result.verdict != "effect"
    doubted = _leaves_much(result) or strained or otherwise
    if doubted and search.explained and not (strained or others):
        # Slopes leave much of what its own law explains: its fit stands for it, no other is needed.
        return replace(place, fits=dict.fromkeys(search.found, place.base)), result
    if search.rough:
        # So much is left that what no slope shows stands beside what was named, not in its place.
        place, further = _furthered(search, ask, place, result)
        little = MUCH * search.first_cost
        if further is not result or any(fit.cost < little for fit in place.fits.values()):
            return place, further
    if doubted or result.verdict == "none":
        # What presses the base takes up whole, within its tolerances: then nothing seems missing.
        whole = search.thorough() if doubted else search.thorough(PRESSING)
        other = _whole(whole, search, ask)
        if other is not None and _says_more(other[1], result):
            return other
    return (place, result) if search.rough else _furthered(search, ask, place, result)


def _by_law(search: Search, ask: Ask, result: Diagnosis) -> tuple[Place, Diagnosis] | None:
    """Return an answer in which whole fits tell apart what slopes did not.

    None without a class, or where fits had led to its first member already.
    """
    unsure_at = [
        n
        for n, each in enumerate(result.findings)
        if len(each.members) > 1 and each.name not in search.found
    ]
    if not unsure_at:
        return None
    before, unsure = result.findings[: unsure_at[0]], result.findings[unsure_at[0]]
    place = search.by_law([each.name for each in before], unsure.names)
    if place is None:
        return None
    more = _with_the_first(search, place, ask)
    if not more.findings or more.findings[0].name not in unsure.names:
        return None
    first, *others = more.findings
    left = [each for each in unsure.members if each not in first.members]
    first = replace(first, members=(*first.members, *left))
    more = replace(more, findings=(first, *others))
    return place, _together(replace(result, findings=before), more)


def _furthered(
    search: Search, ask: Ask, place: Place, result: Diagnosis
) -> tuple[Place, Diagnosis]:
    """Return an answer with what whole fits find beside it, one after the other."""
    fits: dict[str, BaseFit] = {}
    while len(result.findings) < MOST_EXTRAS:
        beside = search.further([each.name for each in result.findings], fits)
        if beside is None:
            break
        more = _with_the_first(search, beside, ask)
        found = [each.name for each in more.findings if each.name in beside.fits]
        if not found:
            break
        fitted = [each for each in result.findings if each.name in beside.base.extras]
        place, result = beside, _together(replace(result, findings=tuple(fitted)), more)
        fits = {name: beside.fits[name] for name in found}
    names = [each.name for each in result.findings]
    end = search.ended(names)
    return place if end is None else replace(place, fits=dict.fromkeys(names, end)), result


def _whole(place: Place | None, search: Search, ask: Ask) -> tuple[Place, Diagnosis] | None:
    """Return a place of whole fits and what it says; None without one."""
    return None if place is None else (place, _with_the_first(search, place, ask))


def _with_the_first(search: Search, place: Place, ask: Ask) -> Diagnosis:
    """Return what a place of whole fits says, asked again beside the first that it names."""
    found = ask(place)
    whole = [each.name for each in found.findings if each.name in place.fits]
    if not whole:
        return found
    return _confirmed(found, whole[0], ask(search.beside(place.fits[whole[0]])))


def _confirmed(found: Diagnosis, name: str, beside: Diagnosis) -> Diagnosis:
    """Return an answer with one finding, and of the others what is found beside it as well.

    Slopes about the base alone say little of a second effect: flanges stand otherwise there.
    """
    (first,) = (each for each in found.findings if each.name == name)
    if not beside.findings and len(found.findings) == 1:
        return found
    return _together(replace(found, findings=(first,)), beside)


def _settled(
    result: Diagnosis,
    search: Search,
    final: BaseFit,
    ask: Ask,
    limit: float,
    by_laws: Callable[[Diagnosis], Diagnosis],
) -> Diagnosis:
    """Return an answer that says what the laws leave, fitted whole, instead of their slopes.

    Then its errors are told `by_laws` too: a bushing that is many times as soft has other slopes.
    """
    left = ask(search.after(final))
    if left.findings:
        return result
    share = left.unexplained.energy_share * min(final.cost / search.first_cost, 1.0)
    verdict = "unknown" if share >= limit else "effect"
    unexplained = replace(left.unexplained, energy_share=share)
    return by_laws(replace(result, verdict=verdict, unexplained=unexplained))


def _together(found: Diagnosis, beside: Diagnosis) -> Diagnosis:
    """Return an answer with what was found and what was found beside it."""
    return replace(
        found,
        verdict="unknown" if beside.verdict == "unknown" else "effect",
        after=beside.after,
        findings=(*found.findings, *beside.findings),
        unexplained=beside.unexplained,
    )


def _begun(place: Place, result: Diagnosis) -> tuple[BaseFit, list[Effect]]:
    """Return the base and the effects from which the fit of what was named begins."""
    names = [each.name for each in result.findings]
    whole = [place.fits[name] for name in names if name in place.fits]
    base = whole[0] if whole else place.base
    known = {each.name: each for each in place.candidates}
    found = {name: fit.beyond()[name] for name, fit in place.fits.items()} | base.beyond()
    return base, [
        found.get(each.name) or _started(known[each.name], each.parameters)
        for each in result.findings
    ]


def _leaves_much(result: Diagnosis) -> bool:
    """Tell whether an answer leaves so much unknown that a thorough search is worth its time."""
    named_most = result.findings and result.unexplained.energy_share < MUCH
    return result.verdict == "unknown" and not named_most


def _says_more(one: Diagnosis, other: Diagnosis) -> bool:
    """Tell whether an answer names something and leaves less unexplained than another."""
    if not one.findings:
        return False
    return one.verdict == "effect" or (
        one.unexplained.energy_share < other.unexplained.energy_share or not other.findings
    )


def _with_all(fitter: Fitter, base: BaseFit, named: Sequence[Effect], final: BaseFit) -> BaseFit:
    """Return the base fitted along with what the search found and what was named.

    Where that is what was named alone, or where more effects end in a higher minimum, it is the fit
    of what was named.
    """
    more = [each for each in named if each.name not in base.extras]
    if {*base.extras, *(each.name for each in more)} == set(final.extras):
        return final
    whole = fitter(base.problem.sessions, [*base.beyond().values(), *more], base) if more else base
    return min(final, whole, key=lambda each: each.cost)


def _started(candidate: WristCandidate, parameters: dict[str, tuple[float, float]]) -> Effect:
    shape = tuple(parameters[each.name][0] for each in candidate.recipe.shape)
    return candidate.effect({name: value for name, (value, _) in parameters.items()}, shape)
