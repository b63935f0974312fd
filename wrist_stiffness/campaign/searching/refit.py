"""What was named is fitted with its own law, and stays only if it foretells what it has not seen.

The search compares columns, which are tangents.  The values by which the nodes would compensate
come from the laws themselves, the base along with them; and nothing is added to a model that makes
the units put aside worse than the base alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from wrist_stiffness.campaign.searching.base_fit import LOOSE, BaseFit, Walls
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.from_afar import STICKING
from wrist_stiffness.campaign.searching.place import EXACT, INEXACT
from wrist_stiffness.campaign.unit_session import UnitSession
from wrist_stiffness.campaign.units import Mask
from wrist_stiffness.diagnosis.sealed import HeldOut, sealed_units
from wrist_stiffness.model.effect import Effect

Sessions = tuple[UnitSession, ...]


CHANCE = 0.01
"""That as many parameters of nothing explain as much: what explains no more does not stay."""


RUBBED = 0.2
"""Share of its size within which friction is taken to be right: what sticks before it slips differs
from wrist to wrist, and cables or axes of a sensor mop up what is left of it."""


@dataclass(frozen=True, eq=False)
class Refitted:
    """What held, and how well it foretold the units put aside.

    Parameters
    ----------
    base : BaseFit
        Fitted to all units along with what holds.
    stages : tuple of HeldOut
        Units put aside, foretold by fits to the others: by the base alone, then with one effect
        more each time.  Empty where the search had not seen them, so its own stages hold.
    """

    base: BaseFit
    stages: tuple[HeldOut, ...] = ()


def refit(
    fitter: Fitter,
    base: BaseFit,
    named: Sequence[Effect],
    sealed_share: float,
    first_cost: float,
    saw_all: bool = False,
) -> Refitted:
    """Fit the base along with as much of what was named as holds.

    What explains too little goes first: along with play that is none a base may find out of a
    wrong flange's hold.  Where the laws leave much more than noise, or more than the base alone,
    what entered last is taken out for as long as the units put aside come out worse with the
    effects than without.

    Parameters
    ----------
    fitter : Fitter
        Knows the model as it was.
    base : BaseFit
        From the search: where the fit begins.
    named : sequence of Effect
        In the order of entry, with the values from which they begin.
    sealed_share : float
        Part of a single session that is put aside; of several it is the last one.
    first_cost : float
        Weighted sum of squares that the base alone leaves.
    saw_all : bool
        Whether fits to all units chose what was named: then it is judged however little it leaves.
    """
    fitted, kept = _worth_it(fitter, base, _along(fitter, base, named), named, first_cost)
    exact = fitted.variance < INEXACT and fitted.cost < first_cost
    if not kept or (exact and not saw_all):
        return Refitted(fitted)
    sessions = fitted.problem.sessions
    aside = sealed_units(fitted.problem.table, sealed_share)
    seen = blanked(sessions, aside)
    alone = unseen(_alone(fitter, seen, fitted), sessions, aside, fitted)
    while kept:
        trial = unseen(fitter(seen, kept, fitted), sessions, aside, fitted)
        if trial.energy < alone.energy:
            break
        kept.pop()
        fitted = _along(fitter, base, kept)
    if not saw_all:
        return Refitted(fitted)
    stages = [alone]
    for count in range(1, len(kept)):
        part = fitter(seen, kept[:count], fitted)
        stages.append(unseen(part, sessions, aside, fitted))
    return Refitted(fitted, (*stages, trial) if kept else ())


def foretold(
    fitter: Fitter, fitted: BaseFit, named: Sequence[Effect], sealed_share: float
) -> tuple[HeldOut, ...]:
    """Return the stages of a fit that was not judged by them, as `Refitted` has them.

    Parameters
    ----------
    fitter : Fitter
        As fitted it.
    fitted : BaseFit
        To all units along with all that was named.
    named : sequence of Effect
        In the order of entry.
    sealed_share : float
        Part of a single session that is put aside.
    """
    sessions = fitted.problem.sessions
    aside = sealed_units(fitted.problem.table, sealed_share)
    seen = blanked(sessions, aside)
    fits = [
        _alone(fitter, seen, fitted),
        *(fitter(seen, named[: n + 1], fitted) for n in range(len(named))),
    ]
    return tuple(unseen(each, sessions, aside, fitted) for each in fits)


def _along(fitter: Fitter, base: BaseFit, named: Sequence[Effect]) -> BaseFit:
    sessions = base.problem.sessions
    if not named:
        return _alone(fitter, sessions, base) if base.extras else base
    same = {each.name for each in named} == set(base.extras)
    fitted = base if same else fitter(sessions, named, base)
    if fitted.variance >= INEXACT:
        # Flanges and play let a base that took up a large effect not find back: from the drawing.
        fitted = min(fitted, fitter(sessions, named), key=_cost)
    if any(each.law.id in LOOSE for each in named):
        # Where a pin is free, the base does something else than without play.
        fitted = min(fitted, _again(fitter, fitted, "sharp"), key=_cost)
        if fitted.variance >= INEXACT:
            # Each pin that turns over is a minimum: from another one, and the better end counts.
            fitted = min(fitted, _again(fitter, fitted, "rounded first"), key=_cost)
    return fitted


def _alone(fitter: Fitter, sessions: Sessions, start: BaseFit) -> BaseFit:
    """Fit the base alone, from the drawing and from where it stands along with effects.

    These may have drawn it along, or out of a wrong flange's hold.
    """
    return min((fitter(sessions, (), each) for each in (None, start)), key=_cost)


def _worth_it(
    fitter: Fitter, base: BaseFit, fitted: BaseFit, named: Sequence[Effect], first_cost: float
) -> tuple[BaseFit, list[Effect]]:
    """Take out effects that explain no more than chance or the others' laws leave, the last first.

    By the likelihood ratio (Wilks 1938).  What a law that is not exact leaves of an effect looks
    like more of the same law elsewhere, and where something rubs like anything.
    """
    kept = list(named)
    while kept:
        found = fitted.beyond()
        less = {
            each.name: _less(fitter, base, fitted, [found[o.name] for o in kept if o is not each])
            for each in kept
        }
        fall = {name: fit.cost - fitted.cost for name, fit in less.items()}
        if len(kept) == 1:
            # The base alone was fitted from the drawing already.
            fall[kept[0].name] = min(fall[kept[0].name], first_cost - fitted.cost)
        idle = [e for e in kept if fall[e.name] < _least(e, [o for o in kept if o is not e], fall)]
        if not idle:
            break
        last = idle[-1]
        kept = [each for each in kept if each is not last]
        fitted = less[last.name] if kept else _alone(fitter, fitted.problem.sessions, fitted)
    return fitted, kept


def _least(effect: Effect, others: Sequence[Effect], fall: Mapping[str, float]) -> float:
    """Return what an effect must explain beside others, each of which explains that much."""
    shares = {
        each.name: RUBBED if each.law.id in STICKING else EXACT * (each.law.id == effect.law.id)
        for each in others
    }
    inexact = sum(share**2 * fall[name] for name, share in shares.items())
    return max(float(chdtri(len(effect.parameters), CHANCE)), inexact)


def _less(fitter: Fitter, base: BaseFit, fitted: BaseFit, others: Sequence[Effect]) -> BaseFit:
    """Fit along with fewer effects from a fit with more; the search's own may have come further."""
    less = fitter(fitted.problem.sessions, others, fitted)
    same = {each.name for each in others} == set(base.extras)
    return min(less, base, key=_cost) if same else less


def _again(fitter: Fitter, fitted: BaseFit, walls: Walls) -> BaseFit:
    extras = list(fitted.beyond().values())
    return fitter(fitted.problem.sessions, extras, fitted, beside=True, walls=walls)


def _cost(fitted: BaseFit) -> float:
    return fitted.cost


def blanked(sessions: Sessions, aside: Mask) -> Sessions:
    """Return the sessions with nothing measured in units put aside, (u,) bool of the table."""
    parts, start = [], 0
    for each in sessions:
        rows = np.flatnonzero(each.measured)
        own = rows[aside[start : start + len(rows)]]
        start += len(rows)
        shift, turn = each.shift.copy(), each.turn.copy()
        shift[own], turn[own] = np.nan, np.nan
        parts.append(replace(each, shift=shift, turn=turn))
    return tuple(parts)


def unseen(fitted: BaseFit, sessions: Sessions, aside: Mask, whole: BaseFit) -> HeldOut:
    """Return what a fit leaves of units put aside.

    What is set up anew in a session of which the fit saw nothing is taken from the fit that saw
    all, and refitted to first order; everything else keeps its value.

    Parameters
    ----------
    fitted : BaseFit
        To the units that were left.
    sessions : tuple of UnitSession
        With all that was measured.
    aside : (u,) bool
        Units of the table that were put aside.
    whole : BaseFit
        A fit to all units.
    """
    problem = replace(fitted.problem, sessions=sessions)
    known = {_key(whole, n): z for n, z in enumerate(whole.z)}
    blank = {n for n, each in enumerate(fitted.problem.sessions) if not each.measured.any()}
    fresh = [n for n, unknown in enumerate(problem.unknowns) if unknown.session in blank]
    z = fitted.z.copy()
    z[fresh] = [known[_key(fitted, n)] for n in fresh]
    rows = np.repeat(aside, 6)
    residual = problem.residual(z)
    left = problem.whiten(residual)[rows]
    if fresh:
        columns = problem.columns(z, places=fresh)
        white = problem.whiten(columns)[rows]
        step = np.linalg.lstsq(white, -left, rcond=1e-9)[0]
        residual, left = residual + columns @ step, left + white @ step
    return HeldOut(residual[aside], left)


def _key(fitted: BaseFit, number: int) -> tuple[str, str, int | None]:
    unknown = fitted.problem.unknowns[number]
    return fitted.problem.free[unknown.free].effect.name, unknown.key, unknown.session
