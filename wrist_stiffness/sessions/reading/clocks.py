"""How far the pose sensor's clock is from the joint states', told by the motion that both saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.in_pieces import rigid_rotation
from wrist_stiffness.sessions.reading.signals import Signal, Stamps

Rows = NDArray[np.intp] | slice

SEARCHED_S = 30.0
"""Largest offset that is looked for [s]."""

STEPS = 1200
"""Offsets tried on either side before the best one is refined."""

STAMPS_USED = 1000

ANGLES_USED = 20_000
"""Joint states that are enough to tell the offset of the clocks."""

SCANNED, LIKELY = 200, 100
"""Of these stamps, evenly spread, so many try every offset; the offsets that suit them best are
tried with all."""

SPAN_S = 0.3
"""Time over which the turned angle is taken; long enough to stand out of a tracker's noise [s]."""

HOLE = 5.0
"""Times the usual time between joint states from which on some are missing."""

LEAST_MOTION = np.radians(0.1)
"""Root mean square of the angle turned in that time below which nothing moves [rad]."""

BLOCKS = 8
"""Parts of the session that estimate the offset each on its own; their scatter is its error."""

LEAST_IN_BLOCK = 4

LEAST_OVERLAP = 0.5
"""Share of the stamps that an offset must leave inside the range of the joint states."""


@dataclass(frozen=True)
class ClockOffset:
    """Stamps of the pose sensor minus stamps of the joint states for the same moment."""

    # `seconds`, `sigma`: estimate and one standard uncertainty [s]
    seconds: float
    sigma: float
    gain: float  # unexplained share of the motion without the offset over that with it
    misfit: float  # root mean square of the latter [rad]

    @property
    def fits(self) -> bool:
        """Whether one offset leaves no motion unexplained."""
        return self.misfit <= LEAST_MOTION


@dataclass(frozen=True)
class ClockStep:
    """A change of the offset between two clocks."""

    # `begin_ns`, `end_ns`: stamps of the pose sensor between which it was [ns]
    begin_ns: int
    end_ns: int
    # `seconds`, `sigma`: later offset minus earlier one, and one standard uncertainty [s]
    seconds: float
    sigma: float


@dataclass(frozen=True, eq=False)
class _Motion:
    """Angles turned in a short time, measured and by the joint states."""

    # `start`, `end`: (p,), stamps of the pose sensor from the first joint state on [s]
    start: Array
    end: Array
    turned: Array  # (p,), measured angle between them [rad]
    own: Array  # (m,), stamps of the joint states from the first one on [s]
    quaternion: Array  # (m, 4), of the rigid wrist, without jumps of sign
    slope: Array  # (m - 1, 4), its change in a second
    hole: NDArray[np.bool_]  # (m - 1,), where joint states are missing

    @classmethod
    def of(cls, time_ns: Stamps, measured: Array, rigid: Signal) -> _Motion | None:
        """Return the motion that both saw; None where nothing moves."""
        known = np.isfinite(measured).all(axis=(1, 2))
        time_ns, measured = time_ns[known], measured[known]
        if len(rigid) < 2 or len(time_ns) == 0:
            return None
        first = np.unique(np.linspace(0, len(time_ns) - 1, STAMPS_USED).astype(int))
        second = np.searchsorted(time_ns, time_ns[first] + round(SPAN_S * NANOSECONDS))
        first, second = first[second < len(time_ns)], second[second < len(time_ns)]
        start, end = (1e-9 * (time_ns[rows] - rigid.time_ns[0]) for rows in (first, second))
        own = 1e-9 * (rigid.time_ns - rigid.time_ns[0])
        continuous = _continuous(Rotation.from_matrix(rigid.values).as_quat())
        slope = np.diff(continuous, axis=0) / np.diff(own)[:, None]
        began, ended = (Rotation.from_matrix(measured[rows]) for rows in (first, second))
        turned = (ended * began.inv()).magnitude()
        if len(first) < BLOCKS * LEAST_IN_BLOCK or np.sqrt(np.mean(turned**2)) < LEAST_MOTION:
            return None
        hole = np.diff(own) > max(SPAN_S, HOLE * float(np.median(np.diff(own))))
        return cls(start, end, turned, own, continuous, slope, hole)

    def squares(self, offset: float, rows: Rows = slice(None)) -> tuple[NDArray[np.bool_], Array]:
        """Return which pairs the joint states know the motion of, and their squared misfit."""
        start, end = self.start[rows] - offset, self.end[rows] - offset
        inside = (start >= 0.0) & (end <= self.own[-1])
        # The four numbers share their neighbours in time; `numpy.interp` would look for each anew.
        last = len(self.slope)
        first, second = (
            np.clip(np.searchsorted(self.own, each, side="right"), 1, last) - 1
            for each in (start, end)
        )
        inside &= ~(self.hole[first] | self.hole[second])
        at = [
            self.quaternion[row] + (each - self.own[row])[:, None] * self.slope[row]
            for each, row in ((start[inside], first[inside]), (end[inside], second[inside]))
        ]
        return inside, (self.turned[rows][inside] - _angle(*at)) ** 2

    def unexplained(self, offset: float, rows: Rows = slice(None)) -> float:
        """Return the share of the squared motion left, infinite where too few are inside.

        Of the same pairs: an offset that moves all motion into holes has explained nothing.
        """
        inside, squares = self.squares(offset, rows)
        if inside.sum() < LEAST_OVERLAP * len(inside):
            return np.inf
        moved = float(np.sum(self.turned[rows][inside] ** 2))
        return float(np.sum(squares)) / max(moved, np.finfo(float).tiny)


TRIED_S = np.linspace(-SEARCHED_S, SEARCHED_S, 2 * STEPS + 1)


def rigid_motion(angles: Signal, table: Table) -> Signal:
    """Return the rotations of the rigid wrist, of as many joint states as tell clocks apart."""
    every = max(1, len(angles) // ANGLES_USED)
    theta, time_ns = angles.values[::every], angles.time_ns[::every]
    reachable = table.mechanism.reachable(theta)
    return Signal(time_ns[reachable], rigid_rotation(table, theta[reachable]))


def clock_offset(time_ns: Stamps, measured: Array, rigid: Signal) -> ClockOffset | None:
    """Estimate the offset of the clocks by the best agreement of measured and rigid motion.

    What is compared is the angle turned in a short time: it does not depend on where the instrument
    stands and how the target sits.

    `time_ns` (n,) int64: stamps of the measured rotations [ns]; `measured` (n, 3, 3): rotations U
    -> F, NaN = not measured; `rigid`: those of the rigid wrist (m, 3, 3) by the stamps of the joint
    states.  Gives None where nothing moves, or too few stamps overlap.
    """
    motion = _Motion.of(time_ns, measured, rigid)
    if motion is None:
        return None
    unexplained, pairs = motion.unexplained, len(motion.turned)
    scan = slice(None, None, -(-pairs // SCANNED))
    likely = TRIED_S[np.argsort([unexplained(offset, scan) for offset in TRIED_S])[:LIKELY]]
    best = float(likely[np.argmin([unexplained(offset) for offset in likely])])
    if not np.isfinite(unexplained(best)):
        return None
    step = SEARCHED_S / STEPS

    def refined(rows: Rows, near: float) -> float:
        bounds = (near - step, near + step)
        with np.errstate(invalid="ignore"):  # at the end of the overlap it is infinite
            found = minimize_scalar(unexplained, bounds=bounds, args=(rows,), method="bounded")
        return float(found.x)

    offset = refined(slice(None), best)
    # What the wrist bends has colour; the scatter between parts of the session tells the truth.
    each = [
        refined(rows, offset)
        for rows in np.array_split(np.arange(pairs), BLOCKS)
        if np.sqrt(np.mean(motion.turned[rows] ** 2)) > LEAST_MOTION
    ]
    sigma = float(np.std(each, ddof=1) / np.sqrt(len(each))) if len(each) > 1 else step
    left = max(unexplained(offset), np.finfo(float).tiny)
    _, squares = motion.squares(offset)
    misfit = float(np.sqrt(np.mean(squares)))
    return ClockOffset(offset, sigma, unexplained(0.0) / left, misfit)


def clock_step(
    time_ns: Stamps, measured: Array, rigid: Signal, least_gain: float
) -> ClockStep | None:
    """Find where the offset of the clocks changes, None where one offset is as good.

    Parameters as of `clock_offset`; `least_gain`: mean squared misfit of the motion with one offset
    over that with two, from which there are two.
    """
    motion = _Motion.of(time_ns, measured, rigid)
    if motion is None:
        return None
    pairs = len(motion.turned)
    scan = np.arange(0, pairs, -(-pairs // SCANNED))
    summed, counted = np.zeros((2, len(TRIED_S), len(scan) + 1))
    for row, offset in enumerate(TRIED_S):
        inside, squares = motion.squares(offset, scan)
        summed[row, 1:][inside], counted[row, 1:] = squares, inside
    summed, counted = np.cumsum(summed, axis=1), np.cumsum(counted, axis=1)

    def best(sums: Array, counts: Array, of: Array) -> tuple[Array, Array]:
        """Return the least sum of squares of so many pairs by the offset, and which it is."""
        enough = counts >= np.maximum(LEAST_OVERLAP * of, 1.0)
        each = np.where(enough, of * sums / np.maximum(counts, 1.0), np.inf)
        return each.min(axis=0), TRIED_S[each.argmin(axis=0)]

    count = np.arange(len(scan) + 1.0)
    early, before = best(summed, counted, count)
    late, after = best(summed[:, -1:] - summed, counted[:, -1:] - counted, count[::-1])
    # Between the two offsets are pairs that began with one and ended with the other.
    count = np.arange(LEAST_IN_BLOCK, len(scan) - LEAST_IN_BLOCK)
    rest = 1 + np.searchsorted(motion.start[scan][:-1], motion.end[scan[count - 1]])
    at = int(np.argmin(early[count] + late[rest]))
    both = early[count[at]] + late[rest[at]]
    if not early[-1] > least_gain * max(both, np.finfo(float).tiny):
        return None
    # All pairs tell nearer where it was.
    gain = np.zeros(pairs)
    for sign, offset in ((1.0, after[rest[at]]), (-1.0, before[count[at]])):
        inside, squares = motion.squares(offset)
        gain[inside] += sign * squares
    last = max(int(np.argmax(np.cumsum(gain))), 0)
    began, ended = motion.start[last], motion.end[min(last + 1, pairs - 1)]
    begin_ns, end_ns = (int(rigid.time_ns[0]) + round(t * NANOSECONDS) for t in (began, ended))
    parts = [
        clock_offset(time_ns[rows], measured[rows], rigid)
        for rows in (time_ns < begin_ns, time_ns > end_ns)
    ]
    if parts[0] is None or parts[1] is None:
        return None
    sigma = float(np.hypot(parts[0].sigma, parts[1].sigma))
    return ClockStep(begin_ns, end_ns, parts[1].seconds - parts[0].seconds, sigma)


def _angle(first: Array, second: Array) -> Array:
    """Return the angle between quaternions (n, 4) of like sign [rad]."""
    half_chord = 0.5 * np.linalg.norm(second - first, axis=1)
    return np.asarray(4.0 * np.arcsin(np.minimum(half_chord, 1.0)))


def _continuous(quaternion: Array) -> Array:
    """Return quaternions (n, 4) without jumps of sign."""
    flips = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0
    return np.where(np.append(False, np.cumsum(flips) % 2 == 1), -1.0, 1.0)[:, None] * quaternion
