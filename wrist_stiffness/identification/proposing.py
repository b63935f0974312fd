"""Search a law for what nothing on the list explains: forms of the signals as screws at components.

Every error of the wrist is a small screw at a component, and the influence carries it to the
platform.  So a law is a form of the recorded signals, at a component, in a direction.  All of them
are asked at once, to first order; the leaders are judged by their evidence beside everything else
that the fit knows, so their probabilities are on the scale of the effects that have a name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln, logsumexp

from wrist_stiffness.errors import WristError
from wrist_stiffness.identification.forms import Form, Shape, Span, evaluated, forms
from wrist_stiffness.identification.proposal import Proposal, Proposals, twins
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.answer import MEMBER, NAMING, stands_in
from wrist_stiffness.inference.evidence import TAIL, Evidence
from wrist_stiffness.inference.point import OUTSIDE, Point
from wrist_stiffness.inference.search import NEGLIGIBLE, UNLIKE
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.batch import CHUNK
from wrist_stiffness.model.evaluation import evaluate
from wrist_stiffness.model.formula_law import (
    LOAD_SENSOR,
    MOTION,
    TEMPERATURE,
    TURNS,
    WRENCH,
    FormulaLaw,
)
from wrist_stiffness.model.parameters import si_factor
from wrist_stiffness.model.places import BODY, LIMB

PLACES = (
    *tuple({(LIMB[name], BODY[name]): name for name in reversed(LIMB)}.values())[::-1],
    LOAD_SENSOR,
)
"""One component of each set in which a screw does the very same, and the load sensor."""

USUAL = {"size_um": 5.0, "size_mdeg": 20.0, "size_N": 0.1, "size_Nmm": 2.0}
"""Usual size of a law over a recording, standard deviation (assumed): that of a gap in a fit, of a
gear's play, and of what a load sensor reads without load."""

DIRECTIONS = ((0,), (1,), (2,), (3,), (4,), (5,), (0, 1, 2), (3, 4, 5), (0, 1, 2, 3, 4, 5))
"""Coordinates of the screw that are free: one axis, any direction of a shift or of a turn, or both
together, as of what turns about a point beside O."""

PRICES = {
    len(free): np.log(3.0 * sum(len(other) == len(free) for other in DIRECTIONS))
    for free in DIRECTIONS
}
"""Log prior odds against a direction, by the number of its coordinates."""

LEADERS, OF_ONE_FORM, AT_ONE_PLACE = 12, 4, 2
"""Forms at a place that are judged by their evidence, at how many places one form, and in how many
directions there.  While all that is left counts as noise, slopes rank places only roughly."""

WHOLE = 6
"""Of them, how many are fitted whole."""

MOST_TERMS = 2

PROPOSED = "proposed_law"
"""Name of a law while it is asked."""

WRENCHES = tuple(enumerate(WRENCH))

OWN_SIGNALS = frozenset((*WRENCH, *TURNS))
"""What is another signal, or none, at another place."""

RIVALS = 3
"""Laws that are told beside the first."""

STEPS = 40
"""Trials for each number inside a form that is sought between the points of its grid."""


@dataclass(frozen=True, eq=False)
class _Asked:
    """A form at a component in some directions, at its best shape so far."""

    form: Form
    place: int
    free: tuple[int, ...]
    shape: Shape
    gain: float
    z: Array


@dataclass(frozen=True, eq=False)
class _Judged:
    """A law judged by its evidence."""

    law: _Asked
    change: Array
    state: Evidence
    z: Array
    log: float
    price: float

    @property
    def stands_in(self) -> float:
        """Probability that it only looks like what is missing."""
        return stands_in(self.state.rest(PROPOSED)) if self.state.unexplained > 0.0 else 0.0


def propose(
    problem: WristProblem,
    fit: WristFit,
    naming: float = NAMING,
    tell: Callable[[str], None] = lambda text: None,
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

    Returns
    -------
    Proposals
        At most two laws together, and what else may stand in place of the first.
    """
    terms: list[Proposal] = []
    first: tuple[list[_Judged], Array, Evidence] | None = None
    asked = 0
    for number in range(MOST_TERMS):
        tell("asking for a law" if number == 0 else "asking for a second law beside it")
        library = _Library(problem, fit)
        base = fit.evidence
        found = library.judged(base)
        if not found:
            break
        logs = np.array([each.log - base.log for each in found])
        chances = np.exp(logs - np.logaddexp(0.0, logsumexp(logs)))
        something = float(chances.sum())
        # A law of another shape than the truth leaves some of itself.
        chances *= [1.0 - each.stands_in for each in found]
        if first is None:
            first, asked = (found, chances, base), library.count
        if something < naming:
            break
        terms.append(_proposal(found[0], float(chances[0]), base))
        if len(terms) < MOST_TERMS:
            # Tolerances that had given way to the first law find back.
            try:
                fit = problem.extended(fit, terms[-1].effect("first_law"))
            except WristError:
                break
    if first is None:
        return Proposals((), (), 0.0, {}, asked)
    judged, chances, base = first
    sure = float(chances.sum())
    if not terms:
        return Proposals((), (), sure, {}, asked)
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
    return Proposals(tuple(terms), tuple(rivals[:RIVALS]), sure, ordered, asked)


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
    return sorted(best.values(), key=lambda each: -each.log)


def _proposal(found: _Judged, chance: float, before: Evidence) -> Proposal:
    law, state = found.law, found.state
    place, free = PLACES[law.place], list(law.free)
    at, z = state.point.effects[PROPOSED], found.z
    spread = float(np.sqrt(z @ state.covariance[np.ix_(at, at)] @ z)) / float(z @ z)
    keys = [_key(place, axis) for axis in range(6)]
    usual = np.array([USUAL[key] * si_factor(key) for key in keys]) / law.form.usual
    screw, sizes = np.zeros(6), np.zeros(6)
    screw[free], sizes[free] = z * usual[free], z
    # Its size is that of the shift or of the turn, whichever is less usual.
    turns = np.linalg.norm(sizes[3:]) > np.linalg.norm(sizes[:3])
    size = float(np.linalg.norm(screw[3:] if turns else screw[:3]))
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
        spread * value,
        key,
        chance,
        found.log - before.log,
        explains,
        found.change,
    )


def _key(place: str, axis: int) -> str:
    if place == LOAD_SENSOR:
        return "size_N" if axis < 3 else "size_Nmm"
    return "size_um" if axis < 3 else "size_mdeg"


class _Library:
    """All laws in the recordings of a wrist."""

    def __init__(self, problem: WristProblem, fit: WristFit) -> None:
        self._problem, self._fit, self._table = problem, fit, fit.table
        self._sessions = fit.base.problem.sessions
        found = [_signals_at(fit, number) for number in range(len(self._sessions))]
        self._signals: list[list[dict[str, Array]]] = []
        for name in PLACES:
            sessions = [own[name] for own in found]
            known = [key for key in sessions[0] if all(key in own for own in sessions)]
            self._signals.append([{key: own[key] for key in known} for own in sessions])
        every = [(place, axis) for place in range(len(PLACES)) for axis in range(6)]
        carried = self._carriers(fit, every)
        self._carried = carried.reshape(len(PLACES), 6, *carried.shape[1:])
        numbers = fit.table.table.values.size
        self._white = fit.table.whiten(
            np.eye(numbers).reshape(-1, fit.table.table.n_components, numbers)
        )
        self._known: dict[str, Array | None] = {}
        self._points: list[list[tuple[Form, Shape]]] = []
        self._rows: list[Array] = []
        self._among: list[Array] = []
        kinds = 0
        for place, signals in enumerate(self._signals):
            points: list[tuple[Form, Shape]] = []
            rows: list[Array] = []
            for form in forms(signals):
                asked = [(shape, self._row(form, shape, place)) for shape in form.shapes]
                points += [(form, shape) for shape, row in asked if row is not None]
                rows += [row for _, row in asked if row is not None]
                kinds += any(row is not None for _, row in asked)
            self._points.append(points)
            self._rows.append(np.array(rows).reshape(len(rows), -1))
            self._among.append(np.log([len(form.shapes) for form, _ in points]))
        self._price = float(np.log(OUTSIDE / max(kinds, 1)))
        self.count = sum(map(len, self._points)) * len(DIRECTIONS)

    def _row(self, form: Form, shape: Shape, place: int) -> Array | None:
        """Return a form on the units of the table in usual sizes, (u,); None if it is constant."""
        text, signals = form.write(shape), self._signals[place]
        shared = OWN_SIGNALS.isdisjoint(form.of)
        if shared and text in self._known:
            return self._known[text]
        values = evaluated(text, signals)
        row = None
        if all(np.isfinite(each).all() for each in values):
            sessions = zip(self._sessions, values, strict=True)
            row = np.concatenate([s.mean(each)[s.measured] for s, each in sessions]) / form.usual
            row = row if row.std() > 1e-6 * (np.abs(row).max() + 1e-300) else None
        if shared:
            self._known[text] = row
        return row

    def _carriers(self, fit: WristFit, asked: Sequence[tuple[int, int]]) -> Array:
        """Return what typical screws do to each unit, (t, u, m), by places and axes."""
        trials = []
        for place, axis in asked:
            name = PLACES[place]
            key = _key(name, axis)
            law = FormulaLaw("unit", name, np.eye(6)[axis], key, (), (key,))
            trials.append((law, name, {key: USUAL[key]}))
        return self._problem.about(fit).changes(trials)

    def judged(self, state: Evidence) -> list[_Judged]:
        """Return the leading laws beside a state, the most probable first."""
        beyond = _Beyond(state.without_discrepancy(), self._white, self._carried)
        found = []
        for law in self._leaders(beyond):
            best = self._refined(law, partial(beyond.gain, law.place, law.free))
            parts = self._carried[law.place, list(law.free)]
            found.append(self._judged(*best, parts, state.point, state))
        return _distinct(self._settled(sorted(found, key=_log, reverse=True), state))

    def _settled(self, found: list[_Judged], state: Evidence) -> list[_Judged]:
        """Return laws, the most probable first, fitted whole where that may change which it is."""
        best, reach = state.log, 0.0
        for number, first in enumerate(found[:WHOLE]):
            # Whole fits reach further than their first order, some more than others.
            if first.log + UNLIKE * reach < best - NEGLIGIBLE:
                break
            while (again := self._whole(found[number], state)).log > found[number].log + NEGLIGIBLE:
                found[number] = again
            reach = max(reach, found[number].log - first.log)
            best = max(best, found[number].log)
        return sorted(found, key=_log, reverse=True)

    def _whole(self, first: _Judged, state: Evidence) -> _Judged:
        """Return a law judged where a whole fit ends with it, if that is more probable.

        Set-up and tolerances have given way to what is missing: beside the right law they find
        back, beside another one they cannot.
        """
        proposal, law = _proposal(first, 0.0, state), first.law
        effect = proposal.effect(PROPOSED)
        try:
            fit = self._problem.extended(self._fit, effect)
        except WristError:
            return first
        value = fit.base.beyond()[effect.name].estimates[proposal.key].value
        z = first.z * value / proposal.value
        parts = self._carriers(fit, [(law.place, axis) for axis in law.free])
        law = replace(law, z=z)
        bare = fit.without_numbers(effect.name)
        change = np.einsum("i,iua->ua", z, self._moved(law, parts))
        bare = replace(bare, left=bare.left + self._table.whiten(change))
        found = self._judged(law, first.price, parts, bare, state)
        here = replace(found.state, point=bare)

        def gain(row: Array) -> tuple[float, Array]:
            moved = parts * row[None, :, None]
            return here.gains([-self._table.whiten(np.moveaxis(moved, 0, -1))])[0]

        refined = self._judged(*self._refined(law, gain), parts, bare, found.state)
        return max((first, found, refined), key=_log)

    def _leaders(self, beyond: _Beyond) -> list[_Asked]:
        best: dict[tuple[str, int, int], _Asked] = {}
        for place in range(len(PLACES)):
            for number, free in enumerate(DIRECTIONS):
                gains, z = beyond.gains(self._rows[place], place, free)
                gains = gains - PRICES[len(free)] - self._among[place]
                for n, (form, shape) in enumerate(self._points[place]):
                    gain, key = float(gains[n]), (form.name, place, number)
                    if key not in best or best[key].gain < gain:
                        best[key] = _Asked(form, place, free, shape, gain, z[n])
        chosen: list[_Asked] = []
        seats: set[tuple[str, int]] = set()
        for each in sorted(best.values(), key=lambda own: -own.gain):
            here, seat = each.form.name, (each.form.name, each.place)
            if seat not in seats and sum(form == here for form, _ in seats) == OF_ONE_FORM:
                continue
            if seat not in seats and len(seats) == LEADERS:
                break
            seats.add(seat)
            if sum((own.form.name, own.place) == seat for own in chosen) < AT_ONE_PLACE:
                chosen.append(each)
        return chosen

    def _refined(
        self, law: _Asked, gain: Callable[[Array], tuple[float, Array]]
    ) -> tuple[_Asked, float]:
        """Return a law at its best numbers, and the log prior of these as far as they are known.

        `gain` tells what a form on the units gains, and its unknowns.
        """
        moving = [n for n, span in enumerate(law.form.spans) if not span.fixed]
        price = -sum(float(np.log(len(span.grid))) for span in law.form.spans if span.fixed)
        if not moving:
            return law, price
        spans = [law.form.spans[n] for n in moving]
        ranges = [_range(span) for span in spans]

        def shape(x: Array) -> Shape:
            own = list(law.shape)
            for n, span, (low, high), value in zip(moving, spans, ranges, x, strict=True):
                at = low + (high - low) * float(np.clip(value, 0.0, 1.0))
                own[n] = float(np.exp(at)) if span.positive else at
            return tuple(own)

        def cost(x: Array) -> float:
            row = self._row(law.form, shape(x), law.place)
            if row is None:
                return 1e9
            return -gain(row)[0]

        start = np.array(
            [
                ((np.log(law.shape[n]) if span.positive else law.shape[n]) - low) / (high - low)
                for n, span, (low, high) in zip(moving, spans, ranges, strict=True)
            ]
        )
        step = np.array([0.5 / len(span.grid) for span in spans])
        corners = np.vstack([start, start + np.diag(np.where(start > 0.5, -step, step))])
        options = {"initial_simplex": corners, "maxfev": STEPS * len(moving), "xatol": 1e-4}
        best = minimize(cost, start, method="Nelder-Mead", options=options | {"fatol": 1e-2})
        for n in range(len(moving)):
            aside = 0.05 * step[n] * np.eye(len(moving))[n]
            bow = (cost(best.x + aside) + cost(best.x - aside) - 2.0 * best.fun) / aside[n] ** 2
            width = np.sqrt(2.0 * np.pi / bow) if bow > 0.0 else 1.0
            price += float(np.log(min(width, 1.0)))
        row = self._row(law.form, shape(best.x), law.place)
        if row is None:
            return law, price
        return replace(law, shape=shape(best.x), z=gain(row)[1]), price

    def _moved(self, law: _Asked, parts: Array) -> Array:
        """Return what typical screws (k, u, m) do as large as a law says."""
        row = self._row(law.form, law.shape, law.place)
        if row is None:
            raise AssertionError(law.form.name)
        return np.asarray(parts * row[None, :, None])

    def _judged(
        self, law: _Asked, price: float, parts: Array, point: Point, state: Evidence
    ) -> _Judged:
        """Return a law beside a point where it is absent, with amplitudes near those of a state."""
        moved, table = self._moved(law, parts), self._table
        change = np.einsum("i,iua->ua", law.z, moved)
        left = point.left - table.whiten(change)
        columns = -table.whiten(np.moveaxis(moved, 0, -1))
        varied = table.varied(change)
        grown = point.with_effect(PROPOSED, left, columns, law.z, varied, FormulaLaw.inexactness)
        found = evidence(grown, state.background, state)
        places = grown.effects[PROPOSED]
        z = found.point.z[places] + found.step[places]
        log = found.log + price + self._price - PRICES[len(law.free)]
        return _Judged(law, np.einsum("i,iua->ua", z, moved), found, z, log, price)


def _range(span: Span) -> tuple[float, float]:
    ends = np.array([span.grid[0], span.grid[-1]])
    low, high = np.log(ends) if span.positive else ends
    return float(low), float(high)


class _Beyond:
    """What laws gain beside a state, to first order, from their forms on the units alone."""

    def __init__(self, at: Evidence, white: Array, carried: Array) -> None:
        mixed, gram = at.products(white), white.T @ white
        ((information, slope),) = at.scores(mixed, white.T @ at.point.left, [gram])
        shape = carried.shape[2:]
        self._information = information.reshape(*shape, *shape)
        self._slope, self._carried = -slope.reshape(shape), carried
        self._known: dict[tuple[int, int, int], Array] = {}

    def _pair(self, place: int, one: int, two: int) -> Array:
        """Return the information (u, u) between units about two axes."""
        key = place, one, two
        if key not in self._known:
            left = np.einsum("ua,uavb->uvb", self._carried[place, one], self._information)
            self._known[key] = np.einsum("uvb,vb->uv", left, self._carried[place, two])
        return self._known[key]

    def gain(self, place: int, free: Sequence[int], row: Array) -> tuple[float, Array]:
        """Return the gain of a form (u,), and its unknowns (k,)."""
        gains, z = self.gains(row[None], place, free)
        return float(gains[0]), z[0]

    def gains(self, rows: Array, place: int, free: Sequence[int]) -> tuple[Array, Array]:
        """Return gains (n,) of log evidence and unknowns (n, k) of forms (n, u)."""
        count = len(free)
        information = np.empty((len(rows), count, count))
        slope = np.empty((len(rows), count))
        for i, one in enumerate(free):
            own = np.einsum("ua,ua->u", self._carried[place, one], self._slope)
            slope[:, i] = rows @ own
            for j, two in enumerate(free[i:], i):
                both = np.einsum("nu,nu->n", rows @ self._pair(place, one, two), rows)
                information[:, i, j] = information[:, j, i] = both
        found = [_modes(information, slope, near) for near in (1.0, 1e-8)]
        better = found[0][0] >= found[1][0]
        gains = np.where(better, found[0][0], found[1][0])
        return gains, np.where(better[:, None], found[0][1], found[1][1])


def _modes(information: Array, slope: Array, near: float) -> tuple[Array, Array]:
    """Laplace's method for many effects at once: see `evidence`."""
    count = slope.shape[1]
    weight = np.full(len(slope), near)
    for _ in range(5):
        whole = information + weight[:, None, None] * np.eye(count)
        z = np.linalg.solve(whole, slope[..., None])[..., 0]
        square = np.sum(z**2, axis=1)
        weight = (TAIL + count) / (TAIL + square)
    fits = np.einsum("ni,ni->n", slope, z)
    fits -= 0.5 * np.einsum("ni,nij,nj->n", z, information, z)
    prior = gammaln(0.5 * (TAIL + count)) - gammaln(0.5 * TAIL) - 0.5 * count * np.log(TAIL / 2.0)
    prior = prior - 0.5 * (TAIL + count) * np.log1p(square / TAIL)
    return np.asarray(fits + prior - 0.5 * np.linalg.slogdet(whole)[1]), np.asarray(z)


def _signals_at(fit: WristFit, number: int) -> dict[str, dict[str, Array]]:
    """Return what a formula at each place may use, at the kept moments of a session, (k,) each.

    The load that goes through a place in its own frame, of a passive joint its turn; at the load
    sensor the load on the platform.
    """
    own = fit.base.model(number)
    block, model = own.session.block, own.model.with_effects(*own.effects)
    seen, memory = [], None
    for at in range(0, len(block), CHUNK):
        found = evaluate(model, block.take(slice(at, at + CHUNK)), memory)
        seen.append(found.situation)
        memory = found.memory
    speed = np.zeros_like(block.theta) if block.theta_dot is None else block.theta_dot
    common: dict[str, Array] = {"time": block.time}
    common |= dict(zip(MOTION, np.concatenate([block.theta, speed], axis=1).T, strict=True))
    common |= {f"{TEMPERATURE}{name}": each for name, each in block.temperatures.items()}
    common |= dict(block.covariates)
    signals = {}
    for place in PLACES:
        if place == LOAD_SENSOR:
            loads = {f"W_{axis}": [each.wrench[:, n] for each in seen] for n, axis in WRENCHES}
        else:
            through = [each.at_home(place, each.through_place(place)) for each in seen]
            loads = {axis: [each[:, n] for each in through] for n, axis in WRENCHES}
        for name, joint in TURNS.items():
            if joint in (place, *twins(place)):
                loads[name] = [each.turn(joint) for each in seen]
        signals[place] = common | {name: np.concatenate(each) for name, each in loads.items()}
    return signals
