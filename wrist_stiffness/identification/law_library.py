"""All laws that might be asked of the recordings of a wrist, and what they gain to first order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from wrist_stiffness.identification.forms import Form, Shape, evaluated, forms
from wrist_stiffness.identification.proposal import twins
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.inference.evidence import Evidence, modes
from wrist_stiffness.inference.point import OUTSIDE
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.batch import CHUNK
from wrist_stiffness.model.evaluation import evaluate
from wrist_stiffness.model.formula_law import (
    LOAD_SENSOR,
    MOTION,
    TEMPERATURE,
    TOOL,
    TURNS,
    WRENCH,
    WRENCH_PLACES,
)
from wrist_stiffness.model.places import BODY, LIMB
from wrist_stiffness.model.situation import Situation

PLACES = (
    *tuple({(LIMB[name], BODY[name]): name for name in reversed(LIMB)}.values())[::-1],
    LOAD_SENSOR,
    TOOL,
)
"""One component of each set in which a screw does the very same, and where a wrench is."""

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

OWN_SIGNALS = frozenset((*WRENCH, *TURNS))
"""What is another signal, or none, at another place."""

STEPS = 40
"""Trials for each number inside a form that is sought between the points of its grid."""


@dataclass(frozen=True, eq=False)
class Asked:
    """A form of r signals at a component, its screws free in k coordinates, at its best shape."""

    form: Form
    place: int
    free: tuple[int, ...]
    shape: Shape
    gain: float
    z: Array  # (r, k)


def key_of(place: str, axis: int) -> str:
    """Return the parameter of a law's size along an axis of a screw, or of a wrench."""
    if place in WRENCH_PLACES:
        return "size_N" if axis < 3 else "size_Nmm"
    return "size_um" if axis < 3 else "size_mdeg"


@dataclass(frozen=True, eq=False)
class _Points:
    """Forms of r signals each, at all points of their grids, on the units."""

    forms: list[Form]
    first: NDArray[np.int64]  # (f,), number of the first point of each form
    shapes: list[Shape]  # n
    rows: Array  # (n, r, u)
    grids: Array  # (f,), how many points each form has

    @classmethod
    def of(cls, found: Sequence[tuple[Form, Sequence[tuple[Shape, Array]]]]) -> Self:
        """Return forms with the points that are kept of each."""
        points = [point for _, kept in found for point in kept]
        first = np.cumsum([0, *(len(kept) for _, kept in found[:-1])])
        rows = np.array([rows for _, rows in points])
        grids = np.array([len(form.shapes) for form, _ in found])
        return cls([form for form, _ in found], first, [shape for shape, _ in points], rows, grids)

    def best(
        self, scores: tuple[Array, Array], free: Sequence[int]
    ) -> tuple[Array, NDArray[np.int64], Array]:
        """Return gains (f,), points (f,) and unknowns (f, r, k) of the forms at their best."""
        (information, slope), own = scores, list(free)
        gains, z = best_of(information[:, :, own][..., own], slope[..., own])
        of = np.repeat(np.arange(len(self.forms)), np.diff([*self.first, len(gains)]))
        at = np.lexsort((-gains, of))[self.first]
        return gains[at] - PRICES[len(free)] - np.log(self.grids), at, z[at]


class Library:
    """All laws in the recordings of a wrist."""

    def __init__(self, fit: WristFit) -> None:
        self._sessions = fit.base.problem.sessions
        own_signals = [_signals_at(fit, number) for number in range(len(self._sessions))]
        self._signals: list[list[dict[str, Array]]] = []
        for name in PLACES:
            sessions = [own[name] for own in own_signals]
            known = [key for key in sessions[0] if all(key in own for own in sessions)]
            self._signals.append([{key: own[key] for key in known} for own in sessions])
        numbers = fit.table.observations.values.size
        self.white = fit.table.whiten(
            np.eye(numbers).reshape(-1, fit.table.observations.n_components, numbers)
        )
        self._known: dict[str, Array | None] = {}
        self._points: list[list[_Points]] = []
        for place, signals in enumerate(self._signals):
            found: dict[int, list[tuple[Form, list[tuple[Shape, Array]]]]] = {}
            for form in forms(signals):
                asked = [(shape, self._rows(form, shape, place)) for shape in form.shapes]
                kept = [(shape, rows) for shape, rows in asked if rows is not None]
                if kept:
                    found.setdefault(len(form.each), []).append((form, kept))
            self._points.append([_Points.of(own) for own in found.values()])
        every = [points for place in self._points for points in place]
        self.price = float(np.log(OUTSIDE / max(sum(len(own.forms) for own in every), 1)))
        self.count = sum(len(own.shapes) for own in every) * len(DIRECTIONS)

    def _rows(self, form: Form, shape: Shape, place: int) -> Array | None:
        """Return the numbers of a form (r, u), as `_row`; None if one is constant."""
        found = [self._row(each, shape, place) for each in form.each]
        rows = [row for row in found if row is not None]
        return np.array(rows) if len(rows) == len(found) else None

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

    def leaders(self, beyond: Beyond) -> list[Asked]:
        """Return the laws that are worth more than their first order."""
        asked: list[tuple[int, tuple[int, ...], _Points, Array, NDArray[np.int64], Array]] = []
        for place, every in enumerate(self._points):
            for points in every:
                scores = beyond.scores(points.rows, place, range(6))
                asked += [(place, own, points, *points.best(scores, own)) for own in DIRECTIONS]
        if not asked:
            return []
        whose = np.repeat(np.arange(len(asked)), [len(each[3]) for each in asked])
        which = np.concatenate([np.arange(len(each[3])) for each in asked])
        gains = np.concatenate([each[3] for each in asked])
        chosen: list[Asked] = []
        seats: dict[tuple[str, int], set[tuple[int, ...]]] = {}
        for best in np.argsort(-gains, kind="stable").tolist():
            place, free, points, _, at, z = asked[whose[best]]
            n = which[best]
            form = points.forms[n]
            seat = form.name, place
            if seat not in seats:
                if sum(name == form.name for name, _ in seats) == OF_ONE_FORM:
                    continue
                if len(seats) == LEADERS:
                    break
            known = seats.setdefault(seat, set())
            if free not in known and len(known) < AT_ONE_PLACE:
                known.add(free)
                shape = points.shapes[at[n]]
                chosen.append(Asked(form, place, free, shape, float(gains[best]), z[n]))
        return chosen

    def refined(
        self, law: Asked, gain: Callable[[Array], tuple[float, Array]]
    ) -> tuple[Asked, float]:
        """Return a law at its best numbers, and the log prior of these as far as they are known.

        `gain` tells what a form (r, u) on the units gains, and its unknowns (r, k).
        """
        moving = [n for n, span in enumerate(law.form.spans) if not span.fixed]
        price = -sum(float(np.log(len(span.grid))) for span in law.form.spans if span.fixed)
        if not moving:
            return law, price
        spans = [law.form.spans[n] for n in moving]
        ends = [np.array([span.grid[0], span.grid[-1]]) for span in spans]
        ranges = [np.log(e) if s.positive else e for s, e in zip(spans, ends, strict=True)]

        def shape(x: Array) -> Shape:
            own = list(law.shape)
            for n, span, (low, high), value in zip(moving, spans, ranges, x, strict=True):
                at = low + (high - low) * float(np.clip(value, 0.0, 1.0))
                own[n] = float(np.exp(at)) if span.positive else at
            return tuple(own)

        def cost(x: Array) -> float:
            rows = self._rows(law.form, shape(x), law.place)
            if rows is None:
                return 1e9
            return -gain(rows)[0]

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
        rows = self._rows(law.form, shape(best.x), law.place)
        if rows is None:
            return law, price
        return replace(law, shape=shape(best.x), z=gain(rows)[1]), price

    def moved(self, law: Asked, parts: Array) -> Array:
        """Return what typical screws (k, u, m) do as large as a law says, (r k, u, m)."""
        rows = self._rows(law.form, law.shape, law.place)
        if rows is None:
            raise AssertionError(law.form.name)
        return spread(rows, parts)


def spread(rows: Array, parts: Array) -> Array:
    """Return what typical screws (k, u, m) do as large as numbers (r, u) say, (r k, u, m)."""
    return (rows[:, None, :, None] * parts).reshape(-1, *parts.shape[1:])


class Beyond:
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

    def gain(self, place: int, free: Sequence[int], rows: Array) -> tuple[float, Array]:
        """Return the gain of a form (r, u), and its unknowns (r, k)."""
        gains, z = best_of(*self.scores(rows[None], place, free))
        return float(gains[0]), z[0]

    def scores(self, rows: Array, place: int, free: Sequence[int]) -> tuple[Array, Array]:
        """Return information (n, r, k, r, k), slope (n, r, k) of forms (n, r, u), k axes free."""
        (n, r, u), k = rows.shape, len(free)
        information, slope = np.empty((n, r, k, r, k)), np.empty((n, r, k))
        for i, one in enumerate(free):
            own = np.einsum("ua,ua->u", self._carried[place, one], self._slope)
            slope[..., i] = rows @ own
            for j, two in enumerate(free[i:], i):
                known = (rows.reshape(-1, u) @ self._pair(place, one, two)).reshape(n, r, u)
                both = known @ rows.swapaxes(1, 2)
                information[:, :, i, :, j] = both
                information[:, :, j, :, i] = both.swapaxes(1, 2)
        return information, slope


def best_of(information: Array, slope: Array) -> tuple[Array, Array]:
    """Return gains (n,) of log evidence and unknowns (n, r, k) of forms, by their scores."""
    n, r, k = slope.shape
    gains, z, _ = modes(information.reshape(n, r * k, r * k), slope.reshape(n, r * k))
    return gains, z.reshape(n, r, k)


def _signals_at(fit: WristFit, number: int) -> dict[str, dict[str, Array]]:
    """Return what a formula at each place may use, at the kept moments of a session, (k,) each.

    The load that goes through a place in its own frame, of a passive joint its turn; at the load
    sensor the load on the platform, and at the tool that in the platform's own frame.
    """
    own = fit.base.model(number)
    block, model = own.session.block, own.model.with_effects(*own.effects)
    parts: list[dict[str, dict[str, Array]]] = []
    memory = None
    for at in range(0, len(block), CHUNK):
        found = evaluate(model, block.take(slice(at, at + CHUNK)), memory)
        parts.append({place: _loads(found.situation, place) for place in PLACES})
        memory = found.memory
    speed = np.zeros_like(block.theta) if block.theta_dot is None else block.theta_dot
    common: dict[str, Array] = {"time": block.time}
    common |= dict(zip(MOTION, np.concatenate([block.theta, speed], axis=1).T, strict=True))
    common |= {f"{TEMPERATURE}{name}": each for name, each in block.temperatures.items()}
    common |= dict(block.covariates)
    return {
        place: common
        | {name: np.concatenate([part[place][name] for part in parts]) for name in parts[0][place]}
        for place in PLACES
    }


def _loads(at: Situation, place: str) -> dict[str, Array]:
    """Return what a place has for itself: the load through it, and its turn."""
    if place == LOAD_SENSOR:
        names, loads = [f"W_{axis}" for axis in WRENCH], at.wrench
    else:
        own = "platform" if place == TOOL else place
        names, loads = list(WRENCH), at.at_home(own, at.through_place(own))
    turns = {n: at.turn(joint) for n, joint in TURNS.items() if joint in (place, *twins(place))}
    return dict(zip(names, loads.T, strict=True)) | turns
