"""How far the pose sensor's clock is from the joint states', told by the motion that both saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.reading.signals import Signal, Stamps

Rows = NDArray[np.intp] | slice

SEARCHED_S = 30.0
"""Largest offset that is looked for [s]."""

STEPS = 1200
"""Offsets tried on either side before the best one is refined."""

STAMPS_USED = 1000

SCANNED, LIKELY = 200, 100
"""Of these stamps, evenly spread, so many try every offset; the offsets that suit them best are
tried with all."""

SPAN_S = 0.3
"""Time over which the turned angle is taken; long enough to stand out of a tracker's noise [s]."""

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
    gain: float  # mean squared misfit of the motion without the offset over that with it


def clock_offset(time_ns: Stamps, measured: Array, rigid: Signal) -> ClockOffset | None:
    """Estimate the offset of the clocks by the best agreement of measured and rigid motion.

    What is compared is the angle turned in a short time: it does not depend on where the instrument
    stands and how the target sits.

    `time_ns` (n,) int64: stamps of the measured rotations [ns]; `measured` (n, 3, 3): rotations U
    -> F; `rigid`: quaternions (m, 4) of the rigid wrist by the stamps of the joint states.  Gives
    None where nothing moves, or too few stamps overlap.
    """
    if len(rigid) < 2 or len(time_ns) == 0:
        return None
    first = np.unique(np.linspace(0, len(time_ns) - 1, STAMPS_USED).astype(int))
    second = np.searchsorted(time_ns, time_ns[first] + round(SPAN_S * NANOSECONDS))
    first, second = first[second < len(time_ns)], second[second < len(time_ns)]
    pairs = [1e-9 * (time_ns[rows] - rigid.time_ns[0]) for rows in (first, second)]
    own = 1e-9 * (rigid.time_ns - rigid.time_ns[0])
    continuous = _continuous(rigid.values)
    slope = np.diff(continuous, axis=0) / np.diff(own)[:, None]
    began, ended = (Rotation.from_matrix(measured[rows]) for rows in (first, second))
    turned = (ended * began.inv()).magnitude()
    if len(first) < BLOCKS * LEAST_IN_BLOCK or np.sqrt(np.mean(turned**2)) < LEAST_MOTION:
        return None

    def misfit(offset: float, rows: Rows = slice(None)) -> float:
        start, end = (each[rows] - offset for each in pairs)
        inside = (start >= 0.0) & (end <= own[-1])
        if inside.sum() < LEAST_OVERLAP * len(start):
            return np.inf
        # The four numbers share their neighbours in time; `numpy.interp` would look for each anew.
        at = []
        for each in (start[inside], end[inside]):
            before = np.minimum(np.searchsorted(own, each, side="right"), len(slope)) - 1
            at.append(continuous[before] + (each - own[before])[:, None] * slope[before])
        return float(np.mean((turned[rows][inside] - _angle(*at)) ** 2))

    tried = np.linspace(-SEARCHED_S, SEARCHED_S, 2 * STEPS + 1)
    scan = slice(None, None, -(-len(first) // SCANNED))
    likely = tried[np.argsort([misfit(offset, scan) for offset in tried])[:LIKELY]]
    best = float(likely[np.argmin([misfit(offset) for offset in likely])])
    if not np.isfinite(misfit(best)):
        return None
    step = SEARCHED_S / STEPS

    def refined(rows: Rows, near: float) -> float:
        bounds = (near - step, near + step)
        return float(minimize_scalar(misfit, bounds=bounds, args=(rows,), method="bounded").x)

    offset = refined(slice(None), best)
    # What the wrist bends has colour; the scatter between parts of the session tells the truth.
    each = [
        refined(rows, offset)
        for rows in np.array_split(np.arange(len(first)), BLOCKS)
        if np.sqrt(np.mean(turned[rows] ** 2)) > LEAST_MOTION
    ]
    sigma = float(np.std(each, ddof=1) / np.sqrt(len(each))) if len(each) > 1 else step
    return ClockOffset(offset, sigma, misfit(0.0) / max(misfit(offset), np.finfo(float).tiny))


def _angle(first: Array, second: Array) -> Array:
    """Return the angle between quaternions (n, 4) of like sign [rad]."""
    half_chord = 0.5 * np.linalg.norm(second - first, axis=1)
    return np.asarray(4.0 * np.arcsin(np.minimum(half_chord, 1.0)))


def _continuous(quaternion: Array) -> Array:
    """Return quaternions (n, 4) without jumps of sign."""
    flips = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0
    return np.where(np.append(False, np.cumsum(flips) % 2 == 1), -1.0, 1.0)[:, None] * quaternion
