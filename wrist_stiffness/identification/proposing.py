"""Search a law for what nothing on the list explains: forms of the signals as screws at components.

Every error of the wrist is a small screw at a component, and the influence carries it to the
platform.  So a law is a form of the recorded signals, at a component, in a direction.  All of them
are asked at once, to first order; the leaders are judged by their evidence beside everything else
that the fit knows, so their probabilities are on the scale of the effects that have a name.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import logsumexp

from wrist_stiffness.errors import WristError
from wrist_stiffness.identification.law_library import (
    PLACES,
    PRICES,
    USUAL,
    Asked,
    Beyond,
    Library,
    key_of,
)
from wrist_stiffness.identification.proposal import Proposal, Proposals
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.evidence import Evidence
from wrist_stiffness.inference.point import EXPECTED, Point
from wrist_stiffness.inference.reading import MEMBER, NAMING, stands_in
from wrist_stiffness.inference.search import NEGLIGIBLE
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.parameters import si_factor

UNLIKE = 2.0
"""Times by which a fit may reach further beyond its first order than another one (assumed)."""

MOST_TERMS = 2

PROPOSED = "proposed_law"
"""Name of a law while it is asked."""

RIVALS = 3
"""Laws that are told beside the first."""


@dataclass(frozen=True, eq=False)
class _Judged:
    """A law judged by its evidence."""

    law: Asked
    change: Array
    state: Evidence
    z: Array  # (r, k)
    log: float
    price: float

    def stands_in(self, before: Evidence) -> float:
        """Return the probability that it only looks like what is missing beside a fit."""
        had = before.unexplained
        # Beside it, an effect of the catalogue may be missing too.
        return stands_in(self.state.unexplained / had, EXPECTED) if had else 0.0


def propose(
    problem: WristProblem,
    fit: WristFit,
    naming: float = NAMING,
    tell: Callable[[str], None] = lambda text: None,
    seconds: float = np.inf,
) -> Proposals:
    """Search the laws that explain what a fit leaves.

    Parameters
    ----------
    problem : WristProblem
        The wrist and its sessions.
    fit : WristFit
        What is known, with set-up and tolerances.
    naming : float
        Probability from which there is a law at all.
    tell : callable, optional
        Told what is being done.
    seconds : float, optional
        Time after which no further law is judged.

    Returns
    -------
    Proposals
        At most two laws together, and what else may stand in place of the first.
    """
    terms: list[Proposal] = []
    first: tuple[list[_Judged], Array, Evidence] | None = None
    search = _Search(problem, fit, seconds)
    for number in range(MOST_TERMS):
        tell("asking for a law" if number == 0 else "asking for a second law beside it")
        base, found = fit.evidence, search.judged(fit)
        if not found:
            break
        logs = np.array([each.log - base.log for each in found])
        chances = np.exp(logs - np.logaddexp(0.0, logsumexp(logs)))
        something = float(chances.sum())
        # Among so many laws one always comes near; what is not the truth leaves some of it.
        chances *= [1.0 - each.stands_in(base) for each in found]
        if first is None:
            first = found, chances, base
        if something < naming:
            break
        # A second one is no surer than the first, beside which it was found.
        before = terms[0].probability if terms else 1.0
        law = _proposal(found[0], before * float(chances[0]), base)
        if law.explains <= 0.0:
            break
        terms.append(law)
        if len(terms) < MOST_TERMS:
            # Tolerances that had given way to the first law find back.
            try:
                fit = problem.extended(fit, terms[-1].effect("first_law"))
            except WristError:
                break
    asked = search.library.count, search.in_time
    if first is None:
        return Proposals((), (), 0.0, {}, *asked)
    judged, chances, base = first
    sure = float(chances.sum())
    if not terms:
        return Proposals((), (), sure, {}, *asked)
    rivals = [
        _proposal(each, float(chance), base)
        for each, chance in zip(judged[1:], chances[1:], strict=True)
        if chance >= MEMBER * chances.sum()
    ]
    places: dict[str, float] = {}
    for each, chance in zip(judged, (chances / chances.sum()).tolist(), strict=True):
        name = PLACES[each.law.place]
        places[name] = places.get(name, 0.0) + chance
    kept = {name: p for name, p in places.items() if p >= MEMBER}
    ordered = dict(sorted(kept.items(), key=lambda pair: -pair[1]))
    return Proposals(tuple(terms), tuple(rivals[:RIVALS]), sure, ordered, *asked)


def _log(judged: _Judged) -> float:
    return judged.log


def _distinct(found: Sequence[_Judged]) -> list[_Judged]:
    """Return laws once, in their best direction; with the chances of all."""
    best: dict[tuple[str, int], _Judged] = {}
    for each in found:
        key = each.law.form.name, each.law.place
        known = best.setdefault(key, each)
        if known is not each:
            best[key] = replace(known, log=float(np.logaddexp(known.log, each.log)))
    return sorted(best.values(), key=_log, reverse=True)


def _proposal(found: _Judged, chance: float, before: Evidence) -> Proposal:
    law, state = found.law, found.state
    place, free = PLACES[law.place], list(law.free)
    at, z = state.point.effects[PROPOSED], found.z.ravel()
    wide = float(np.sqrt(z @ state.covariance[np.ix_(at, at)] @ z)) / float(z @ z)
    keys = [key_of(place, axis) for axis in range(6)]
    sizes = np.zeros((len(found.z), 6))
    sizes[:, free] = found.z
    screw = sizes * [USUAL[key] * si_factor(key) for key in keys]
    screw /= np.array([[form.usual] for form in law.form.each])
    # Its size is that of the shift or of the turn, whichever is less usual.
    turns = np.linalg.norm(sizes[:, 3:]) > np.linalg.norm(sizes[:, :3])
    size = float(np.linalg.norm(screw[:, 3:] if turns else screw[:, :3]))
    key = keys[5 if turns else 0]
    value = size / si_factor(key)
    had, left = (each.without_discrepancy().square for each in (before, state))
    # With everything that follows no law taken for noise.
    explains = (had - left) / max(had - state.point.count * state.excess, had - left)
    return Proposal(
        law.form,
        law.shape,
        place,
        screw / size,
        value,
        wide * value,
        key,
        chance,
        found.log - before.log,
        explains,
        found.change,
    )


class _Search:
    """Judges the laws of a library beside fits of a wrist."""

    def __init__(self, problem: WristProblem, fit: WristFit, seconds: float) -> None:
        self._end, self.in_time = time.monotonic() + seconds, True
        self._problem, self._table, self.library = problem, fit.table, Library(fit)

    def _over(self) -> bool:
        self.in_time = self.in_time and time.monotonic() <= self._end
        return not self.in_time

    def _carriers(self, fit: WristFit, asked: Sequence[tuple[int, int]]) -> Array:
        """Return what typical screws do to each unit, (t, u, m), by places and axes."""
        trials = []
        for place, axis in asked:
            name = PLACES[place]
            key = key_of(name, axis)
            law = FormulaLaw("unit", name, np.eye(6)[axis], key, (), (key,))
            trials.append((law, name, {key: USUAL[key]}))
        return self._problem.about(fit).changes(trials)

    def judged(self, fit: WristFit) -> list[_Judged]:
        """Return the leading laws beside a fit, the most probable first."""
        every = [(place, axis) for place in range(len(PLACES)) for axis in range(6)]
        carried = self._carriers(fit, every)
        carried = carried.reshape(len(PLACES), 6, *carried.shape[1:])
        state = fit.evidence
        beyond = Beyond(state.without_discrepancy(), self.library.white, carried)
        found = []
        for law in self.library.leaders(beyond):
            if self._over():
                break
            best = self.library.refined(law, partial(beyond.gain, law.place, law.free))
            parts = carried[law.place, list(law.free)]
            found.append(self._judged(*best, parts, state.point, state))
        return _distinct(self._settled(sorted(found, key=_log, reverse=True), fit))

    def _settled(self, found: list[_Judged], near: WristFit) -> list[_Judged]:
        """Return laws, the most probable first, fitted where that may change which it is.

        Fits reach further than their first order, and the next one the less far the less the last
        one gained; of a law that was not fitted yet, the first fits of others tell.
        """
        found, last, usual = list(found), dict[int, float](), 0.0
        while True:
            best = max([near.evidence.log, *map(_log, found)])
            further = {
                n: UNLIKE * last.get(n, usual if last else np.inf) for n in range(len(found))
            }
            worth = [
                n
                for n, more in further.items()
                if more > NEGLIGIBLE and found[n].log + more > best - NEGLIGIBLE
            ]
            if not worth or self._over():
                return sorted(found, key=_log, reverse=True)
            n = max(worth, key=lambda n: found[n].log + further[n])
            again = self._fitted(found[n], near)
            gain = again.log - found[n].log
            if n not in last:
                usual = max(usual, gain)
            found[n], last[n] = again, gain

    def _fitted(self, first: _Judged, near: WristFit) -> _Judged:
        """Return a law judged where a fit ends with it, if that is more probable.

        Set-up and tolerances have given way to what is missing: beside the right law they find
        back, beside another one they cannot.
        """
        state, law = near.evidence, first.law
        proposal = _proposal(first, 0.0, state)
        effect = proposal.effect(PROPOSED)
        try:
            fit = self._problem.beside(near, effect)
        except WristError:
            return first
        value = fit.base.beyond()[effect.name].estimates[proposal.key].value
        z = first.z * value / proposal.value
        parts = self._carriers(fit, [(law.place, axis) for axis in law.free])
        law = replace(law, z=z)
        bare = fit.without_numbers(effect.name)
        change = np.einsum("i,iua->ua", z.ravel(), self.library.moved(law, parts))
        bare = replace(bare, left=bare.left + self._table.whiten(change))
        here = replace(first.state, point=bare)

        beyond = Beyond(here, self.library.white, parts[None])
        gain = partial(beyond.gain, 0, range(len(parts)))
        refined = self._judged(*self.library.refined(law, gain), parts, bare, first.state)
        return max(first, refined, key=_log)

    def _judged(
        self, law: Asked, price: float, parts: Array, point: Point, state: Evidence
    ) -> _Judged:
        """Return a law beside a point where it is absent, with amplitudes near those of a state."""
        moved, table, z = self.library.moved(law, parts), self._table, law.z.ravel()
        change = np.einsum("i,iua->ua", z, moved)
        left = point.left - table.whiten(change)
        columns = -table.whiten(np.moveaxis(moved, 0, -1))
        varied = table.varied(change)
        grown = point.with_effect(PROPOSED, left, columns, z, varied, FormulaLaw.inexactness)
        found = evidence(grown, state.background, state)
        places = grown.effects[PROPOSED]
        z = found.point.z[places] + found.step[places]
        log = found.log + price + self.library.price - PRICES[len(law.free)]
        change = np.einsum("i,iua->ua", z, moved)
        return _Judged(law, change, found, z.reshape(law.z.shape), log, price)
