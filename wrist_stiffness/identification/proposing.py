"""Search a law for what nothing on the list explains: forms of the signals as screws at components.

Every error of the wrist is a small screw at a component, and the influence carries it to the
platform.  So a law is a form of the recorded signals, at a component, in a direction.  All of them
are asked at once, to first order; the leaders are judged by their evidence beside everything else
that the fit knows, so their probabilities are on the scale of the effects that have a name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln, logsumexp

from wrist_stiffness.errors import WristError
from wrist_stiffness.identification.forms import Form, Shape, Span, evaluated, forms
from wrist_stiffness.identification.proposal import Proposal, Proposals, twins
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.answer import MEMBER, NAMING
from wrist_stiffness.inference.evidence import TAIL, Evidence
from wrist_stiffness.inference.point import OUTSIDE
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula_law import (
    LOAD_SENSOR,
    MOTION,
    TEMPERATURE,
    TURNS,
    WRENCH,
    FormulaLaw,
)
from wrist_stiffness.model.places import BODY, LIMB
from wrist_stiffness.sessions.unit_session import UnitSession

PLACES = (
    *tuple({(LIMB[name], BODY[name]): name for name in reversed(LIMB)}.values())[::-1],
    LOAD_SENSOR,
)
"""One component of each set in which a screw does the very same, and the load sensor."""

USUAL = {"size_um": 5.0, "size_mdeg": 20.0, "size_N": 0.1, "size_Nmm": 2.0}
"""Usual size of a law over a recording, standard deviation (assumed): that of a gap in a fit, of a
gear's play, and of what a load sensor reads without load."""

DIRECTIONS = ((0,), (1,), (2,), (3,), (4,), (5,), (0, 1, 2), (3, 4, 5))
"""Coordinates of the screw that are free: one axis, or any direction of a shift or of a turn."""

LEADERS, OF_ONE_FORM, AT_ONE_PLACE = 12, 4, 2
"""Forms at a place that are judged by their evidence, at how many places one form, and in how many
directions there.  While all that is left counts as noise, slopes rank places only roughly."""

MOST_TERMS = 2

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
    log: float
    size: float


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
    sure, asked = 0.0, 0
    for number in range(MOST_TERMS):
        tell("asking for a law" if number == 0 else "asking for a second law beside it")
        library = _Library(problem, fit)
        base = fit.evidence
        found = library.judged(base, "proposed")
        if not found:
            break
        logs = np.array([each.log - base.log for each in found])
        chances = np.exp(logs - np.logaddexp(0.0, logsumexp(logs)))
        if first is None:
            first, sure, asked = (found, chances, base), float(chances.sum()), library.count
        if chances.sum() < naming:
            break
        terms.append(_proposal(found[0], float(chances[0]), base))
        if len(terms) < MOST_TERMS:
            # Tolerances that had given way to the first law find back.
            try:
                fit = problem.extended(fit, terms[-1].effect("first_law"))
            except WristError:
                break
    if first is None or not terms:
        return Proposals((), (), sure, {}, asked)
    judged, chances, base = first
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


def _distinct(found: Sequence[_Judged]) -> list[_Judged]:
    """Return laws once, whether their direction is an axis or free; each with both chances."""
    best: dict[tuple[str, int, bool], _Judged] = {}
    for each in found:
        key = each.law.form.name, each.law.place, each.law.free[0] < 3
        known = best.setdefault(key, each)
        if known is not each:
            best[key] = replace(known, log=float(np.logaddexp(known.log, each.log)))
    return sorted(best.values(), key=lambda each: -each.log)


def _proposal(found: _Judged, chance: float, before: Evidence) -> Proposal:
    law = found.law
    state, count = found.state, len(law.free)
    at = np.arange(len(state.point.z))[-count:]
    z = state.point.z[at] + state.step[at]
    length = float(np.linalg.norm(z))
    own = z / length
    spread = float(np.sqrt(own @ state.covariance[np.ix_(at, at)] @ own))
    direction = np.zeros(6)
    direction[list(law.free)] = own
    key = _key(PLACES[law.place], law.free)
    had, left = (each.without_discrepancy().square for each in (before, state))
    # With everything that follows no law taken for noise.
    explains = (had - left) / max(had - state.point.count * state.excess, had - left)
    size = USUAL[key] / found.size
    return Proposal(
        law.form,
        law.shape,
        PLACES[law.place],
        direction,
        length * size,
        spread * size,
        key,
        chance,
        found.log - before.log,
        explains,
        found.change,
    )


def _key(place: str, free: Sequence[int]) -> str:
    if place == LOAD_SENSOR:
        return "size_N" if free[0] < 3 else "size_Nmm"
    return "size_um" if free[0] < 3 else "size_mdeg"


def _may_be_at(form: Form) -> list[bool]:
    """Return at which places a form is asked: what hangs on a passive joint's turn is in it."""
    joints = [TURNS[name] for name in form.of if name in TURNS]
    return [not joints or joints[0] in (name, *twins(name)) for name in PLACES]


class _Library:
    """All laws in the recordings of a wrist."""

    def __init__(self, problem: WristProblem, fit: WristFit) -> None:
        self._fit, self._table = fit, fit.table
        self._sessions = fit.base.problem.sessions
        self._signals = [signals_of(fit.base.problem.model, each) for each in self._sessions]
        common = set.intersection(*(set(own) for own in self._signals))
        self._signals = [{n: own[n] for n in own if n in common} for own in self._signals]
        self._forms = forms(self._signals)
        self._carried = self._carriers(problem)
        numbers = fit.table.table.values.size
        self._white = fit.table.whiten(
            np.eye(numbers).reshape(-1, fit.table.table.n_components, numbers)
        )
        self._points: list[tuple[Form, Shape]] = []
        rows, among = [], []
        for form in self._forms:
            shapes = form.shapes
            for shape in shapes:
                row = self._row(form, shape)
                if row is not None:
                    self._points.append((form, shape))
                    rows.append(row / row.std())
                    among.append(len(shapes))
        self._rows = np.array(rows).reshape(len(rows), -1)
        self._among = np.log(among)
        self._asked = np.array([_may_be_at(form) for form, _ in self._points]).reshape(
            -1, len(PLACES)
        )
        kinds = {
            form: int(at.sum()) for (form, _), at in zip(self._points, self._asked, strict=True)
        }
        self._price = float(np.log(OUTSIDE / max(sum(kinds.values()), 1)))
        self.count = int(self._asked.sum()) * len(DIRECTIONS)

    def _row(self, form: Form, shape: Shape) -> Array | None:
        """Return a form on the units of the table, (u,); None where it never changes."""
        values = evaluated(form.write(shape), self._signals)
        if not all(np.isfinite(each).all() for each in values):
            return None
        means = [
            own.mean(each)[own.measured] for own, each in zip(self._sessions, values, strict=True)
        ]
        row = np.concatenate(means)
        return row if row.std() > 1e-6 * (np.abs(row).max() + 1e-300) else None

    def _carriers(self, problem: WristProblem) -> Array:
        """Return what a typical screw does to each unit, by place and axis, (p, 6, u, m)."""
        trials = []
        for name in PLACES:
            for axis in range(6):
                key = _key(name, (axis,))
                law = FormulaLaw("unit", name, np.eye(6)[axis], key, (), (key,))
                trials.append((law, name, {key: USUAL[key]}))
        changes = problem.about(self._fit).changes(trials)
        return changes.reshape(len(PLACES), 6, *changes.shape[1:])

    def judged(self, state: Evidence, name: str) -> list[_Judged]:
        """Return the leading laws beside a state, the most probable first."""
        beyond = _Beyond(state.without_discrepancy(), self._white, self._carried)
        found = []
        for law in self._leaders(beyond):
            refined, price = self._refined(law, beyond)
            found.append(self._judged(refined, state, price, name))
        return _distinct(sorted(found, key=lambda each: -each.log))

    def _leaders(self, beyond: _Beyond) -> list[_Asked]:
        best: dict[tuple[int, int, int], _Asked] = {}
        for place in range(len(PLACES)):
            for number, free in enumerate(DIRECTIONS):
                gains, z = beyond.gains(self._rows, place, free)
                gains = gains - np.log(2.0 * (6.0 if len(free) == 1 else 2.0))
                gains = gains - self._among
                for n in np.flatnonzero(self._asked[:, place]).tolist():
                    (form, shape), gain = self._points[n], float(gains[n])
                    key = id(form), place, number
                    if key not in best or best[key].gain < gain:
                        best[key] = _Asked(form, place, free, shape, gain, z[n])
        chosen: list[_Asked] = []
        seats: set[tuple[int, int]] = set()
        for each in sorted(best.values(), key=lambda own: -own.gain):
            here, seat = id(each.form), (id(each.form), each.place)
            if seat not in seats and sum(form == here for form, _ in seats) == OF_ONE_FORM:
                continue
            if seat not in seats and len(seats) == LEADERS:
                break
            seats.add(seat)
            if sum((id(own.form), own.place) == seat for own in chosen) < AT_ONE_PLACE:
                chosen.append(each)
        return chosen

    def _refined(self, law: _Asked, beyond: _Beyond) -> tuple[_Asked, float]:
        """Return a law at its best numbers, and the log prior of these as far as they are known."""
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
            row = self._row(law.form, shape(x))
            if row is None:
                return 1e9
            gains, _ = beyond.gains(row[None] / row.std(), law.place, law.free)
            return -float(gains[0])

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
        row = self._row(law.form, shape(best.x))
        if row is None:
            return law, price
        _, z = beyond.gains(row[None] / row.std(), law.place, law.free)
        return replace(law, shape=shape(best.x), z=z[0]), price

    def _judged(self, law: _Asked, state: Evidence, price: float, name: str) -> _Judged:
        row = self._row(law.form, law.shape)
        if row is None:
            raise AssertionError(law.form.name)
        size, table, point = float(row.std()), self._table, state.point
        parts = self._carried[law.place, list(law.free)] * (row / size)[None, :, None]
        change = np.einsum("i,iua->ua", law.z, parts)
        left = point.left - table.whiten(change)
        columns = -table.whiten(np.moveaxis(parts, 0, -1))
        varied = table.varied(change)
        grown = point.with_effect(name, left, columns, law.z, varied, FormulaLaw.inexactness)
        places = grown.effects[name]
        found = evidence(grown, state.background, state)
        price += self._price - np.log(2.0 * (6.0 if len(law.free) == 1 else 2.0))
        z = found.point.z[places] + found.step[places]
        change = np.einsum("i,iua->ua", z, parts)
        return _Judged(law, change, found, found.log + price, size)


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


def signals_of(model: ErrorModel, session: UnitSession) -> dict[str, Array]:
    """Return what a formula may use, at the kept moments of a session, (k,) each."""
    block = session.block
    load = block.load
    pose, axes = model.table.mechanism.forward(block.theta), model.table.geometry.axes
    if block.load_on_platform:
        turned = np.swapaxes(pose.platform, -1, -2)
        load = (load.reshape(-1, 2, 3) @ turned).reshape(-1, 6)
    speed = np.zeros_like(block.theta) if block.theta_dot is None else block.theta_dot
    found: dict[str, Array] = {"time": block.time}
    found |= dict(zip(MOTION, np.concatenate([block.theta, speed], axis=1).T, strict=True))
    found |= {name: pose.turn(joint, axes[joint]) for name, joint in TURNS.items()}
    found |= {f"W_{name}": each for name, each in zip(WRENCH, load.T, strict=True)}
    found |= {f"{TEMPERATURE}{name}": each for name, each in block.temperatures.items()}
    return found | dict(block.covariates)
