"""A planned experiment in time: visits of poses, the path between them, what is measured when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.workspace import Workspace
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.planning.loads_file import NO_LOAD, AppliedLoad
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.sessions.units import COUNTS

HOME = np.zeros(2)
"""The reference pose, which is measured again and again [rad]."""

LEAD_S = 5.0
"""Time to come to the reference pose from wherever the motors stand [s]."""

APPROACH = np.radians(4.0)
"""From so far aside a pose is approached, on both motors [rad]."""

LOAD_RAMP_S = 0.6
"""Shortest time in which a load goes on or off [s]."""

PEAK = 1.875
"""Peak over mean speed of a minimum-jerk move (Flash and Hogan 1985)."""

SEEN_IN_MOVES = (0.25, 0.5, 0.75)
"""Parts of a move's time at which the platform is observed in motion."""

BEFORE_S = 0.01
"""A sample so long before shows the laws the acceleration [s]."""

BEFORE_SHARE = 0.1
"""Of a fast move's time that is the longest: it lies between two that are observed."""

LONG_HOLD = (0.03, 0.1, 0.3, 1.0)
"""Parts of a hold of `LONG_S` or more at which it counts as measured."""

LONG_S = 10.0

SPEEDS = (1.0, 0.5)
"""Shares of the allowed speed at which the two sides of a pose are visited."""


@dataclass(frozen=True, eq=False)
class Visit:
    """One approach to a pose."""

    theta: Array  # (2,), motor angles [rad]
    approach: Array  # (2,), sense in which each motor moves at last, +1 or -1
    load: AppliedLoad = NO_LOAD  # what is put on
    # whether the load is put on before the approach instead of at rest in the pose
    carried: bool = False
    speed: float = 1.0  # share of the allowed speed
    hold_s: float = 2.0  # how long the load is held and measured [s]
    purpose: str = "setting"  # for the user

    @property
    def before(self) -> Array:
        """Where the last move begins, (2,) [rad]."""
        return self.theta - APPROACH * self.approach

    @property
    def from_other_side(self) -> Visit:
        """The same from the other side, at the other one of `SPEEDS`."""
        return replace(self, approach=-self.approach, speed=sum(SPEEDS) - self.speed)


@dataclass(frozen=True, eq=False)
class Dwell:
    """One rest in a pose: a row of the plan's table."""

    time_s: float  # when it begins [s]
    visit: Visit  # which it belongs to
    load: AppliedLoad  # what is on
    wrench: Array  # (6,), at O in F [N, N m]
    hold_s: float  # [s]
    purpose: str  # for the user


@dataclass(frozen=True, eq=False)
class Experiment:
    """What is measured along a path."""

    block: Block  # n samples of the path that laws with memory need, the observed ones among them
    rows: NDArray[np.intp]  # (r,), observed samples
    visit: NDArray[np.intp]  # (r,), approach to a pose that each belongs to
    moving: NDArray[np.bool_]  # (r,), whether it is observed in motion


@dataclass(frozen=True, eq=False)
class Timeline(Experiment):
    """A planned experiment."""

    dwells: tuple[Dwell, ...]  # in the order of time
    # time [s], motor angles [rad] and wrench at O in F [N, N m] between which motors move and loads
    # change by minimum jerk
    knots: tuple[tuple[float, Array, Array], ...]
    ends: Array  # (v,), when each visit is over [s]

    @property
    def duration_s(self) -> float:
        """Of the whole experiment [s]."""
        return self.knots[-1][0]


@dataclass(frozen=True)
class Pace:
    """How fast the experiment may go."""

    speed: float  # largest speed of a motor [rad/s]
    dwell_s: float  # what one measurement at rest takes, settling included [s]
    in_motion: bool  # whether the pose sensor measures in motion too

    def move_s(self, start: Array, end: Array, share: float = 1.0) -> float:
        """Duration of a minimum-jerk move at a share of the allowed speed [s]."""
        return PEAK * float(np.max(np.abs(end - start))) / (share * self.speed)


def straight(workspace: Workspace, start: Array, end: Array) -> bool:
    """Tell whether a straight move stays in the map's domain and between the joint limits."""
    limits = workspace.limits
    path = start + np.linspace(0.0, 1.0, 25)[:, None] * (end - start)
    inside = (path >= limits.joint_lower) & (path <= limits.joint_upper)
    return bool(inside.all() and workspace.domain(path).all())


def run_through(
    visits: Sequence[Visit], workspace: Workspace, pace: Pace, warm_up: Sequence[Array] = ()
) -> Timeline:
    """Perform visits in their order, from rest without load at home and back to it.

    Where a straight move would not stay in the workspace, it goes by way of home.  `warm_up`: poses
    (2,) to move through first without measuring [rad].
    """
    clock = _Clock(workspace, pace)
    for theta in warm_up:
        clock.travel(theta)
    for number, visit in enumerate(visits):
        clock.visit(number, visit)
    clock.travel(HOME)
    return clock.timeline()


class _Clock:
    """Performs one thing after the other."""

    def __init__(self, workspace: Workspace, pace: Pace) -> None:
        self._workspace, self._pace = workspace, pace
        self._time_s, self._theta, self._load = 0.0, HOME, NO_LOAD
        self._samples: list[tuple[float, Array, Array, AppliedLoad]] = []
        self._observed: list[tuple[int, int, bool]] = []
        self._dwells: list[tuple[float, Visit, AppliedLoad, int, float, str]] = []
        self._knots: list[int] = []
        self._ends: list[float] = []
        self._knot()
        self._time_s = LEAD_S
        self._knot()

    def travel(self, theta: Array) -> None:
        direct = straight(self._workspace, self._theta, theta)
        for target in (theta,) if direct else (HOME, theta):
            self._move(target, 1.0)

    def visit(self, number: int, visit: Visit) -> None:
        self.travel(visit.before)
        if visit.carried:
            self._change(visit.load)
        self._move(visit.theta, visit.speed, number)
        if visit.load is NO_LOAD:
            self._rest(number, visit, visit.hold_s, visit.purpose)
        elif visit.carried:
            self._rest(number, visit, visit.hold_s, f"{visit.purpose}, load carried along")
            self._change(NO_LOAD)
            self._rest(number, visit, self._pace.dwell_s, "zero-load return")
        else:
            self._rest(number, visit, self._pace.dwell_s, "zero load")
            self._change(visit.load)
            self._rest(number, visit, visit.hold_s, f"{visit.purpose}, load put on at rest")
            self._change(NO_LOAD)
        self._ends.append(self._time_s)

    def timeline(self) -> Timeline:
        time, theta, speed, loads = (list(column) for column in zip(*self._samples, strict=True))
        angles = np.array(theta)
        platform = self._workspace.mechanism.platform_rotation(angles)
        wrench = np.array([load.wrench(turn) for load, turn in zip(loads, platform, strict=True)])
        block = Block(np.array(time), angles, wrench, np.array(speed))
        rows, visit, moving = np.array(self._observed, dtype=np.intp).T
        dwells = tuple(
            Dwell(begin, each, load, wrench[at], hold_s, purpose)
            for begin, each, load, at, hold_s, purpose in self._dwells
        )
        knots = tuple((time[i], angles[i], wrench[i]) for i in self._knots)
        return Timeline(
            block, rows, visit, moving.astype(bool), dwells, knots, np.array(self._ends)
        )

    def _sample(self, theta: Array, speed: Array) -> int:
        self._samples.append((self._time_s, theta, speed, self._load))
        return len(self._samples) - 1

    def _knot(self) -> None:
        self._knots.append(self._sample(self._theta, np.zeros(2)))

    def _move(self, target: Array, share: float, number: int | None = None) -> None:
        duration = self._pace.move_s(self._theta, target, share)
        if duration == 0.0:
            return
        start, way, begin = self._theta, target - self._theta, self._time_s
        seen = number is not None and self._pace.in_motion
        before = min(BEFORE_S / duration, BEFORE_SHARE)
        for part in SEEN_IN_MOVES if seen else (0.5,):
            for back in (before, 0.0) if seen else (0.0,):
                u = part - back
                self._time_s = begin + u * duration
                blend = u**3 * (10.0 + u * (6.0 * u - 15.0))
                rate = 30.0 * u**2 * (1.0 - u) ** 2 / duration
                at = self._sample(start + blend * way, rate * way)
            if seen and number is not None:
                self._observed.append((at, number, True))
        self._time_s, self._theta = begin + duration, target
        self._knot()

    def _change(self, load: AppliedLoad) -> None:
        seconds = max(LOAD_RAMP_S, load.change_s, self._load.change_s)
        self._time_s += seconds
        self._load = load
        self._knot()

    def _rest(self, number: int, visit: Visit, hold_s: float, purpose: str) -> None:
        begin = self._time_s
        for part in LONG_HOLD if hold_s >= LONG_S else (1.0,):
            self._time_s = begin + part * hold_s
            at = self._sample(self._theta, np.zeros(2))
            self._observed.append((at, number, False))
        self._dwells.append((begin, visit, self._load, at, hold_s, purpose))
        self._time_s = begin + hold_s
        self._knot()


def as_experiment(model: ErrorModel, session: MeasuredSession) -> Experiment:
    """Return where and when a session measured, a row for each dwell and each moment in motion.

    Dwells between which no motor moved belong to one visit.  Raises `InputError` if no measurement
    lies in the table's domain and load range, or gauges measured.
    """
    if session.readings is not None:
        raise InputError(f"{session.name}: readings of gauges; plans are made for measured poses")
    parts = as_units(model, session).cut
    in_unit = np.flatnonzero(parts.unit >= 0)
    # The heaviest moment of each unit stands for its mean.
    order = in_unit[np.lexsort((parts.weight[in_unit], parts.unit[in_unit]))]
    last = np.append(np.diff(parts.unit[order]) != 0, True)
    rows = order[last]
    moving = ~parts.dwell[parts.unit[rows]]
    limit = COUNTS * model.table.geometry.limits.encoder_step
    turned = np.any(np.abs(np.diff(parts.block.theta, axis=0)) > limit, axis=1)
    motions = np.append(0, np.cumsum(turned))[rows]
    visit = np.unique(motions, return_inverse=True)[1]
    return Experiment(parts.block, rows, visit, moving)
