"""Lost beams: poses that neither a registration nor a late stamp explains."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from wrist_stiffness.inference.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import rotation_vector
from wrist_stiffness.sessions.in_pieces import in_pieces
from wrist_stiffness.sessions.reading.registration import place_left, turn_left

DENSE_S = 0.21
"""Median time between poses up to which single ones are compared with their neighbours [s]: five a
second, with room for what clocks and rounding add."""

LEAST_SPIKE_M = 30e-6

LEAST_SPIKE_STEPS = 4.0
"""In encoder steps: in motion the measured rotation leaves the encoders' by counts."""

TELLING_STEPS = 3.0
"""In encoder steps: a larger turn from the pose before to the one after tells its direction."""

LATE_S = 0.1
"""So late a stamp may be: what turns meanwhile is no spike."""

MOVING_RAD = float(np.radians(1.0))
"""Turn in that time from which on a pose tells what the stamps do in motion [rad]."""

WINDOW = 5
"""Neighbours, itself included, whose median a measurement is held against; steps pass it."""

LIMIT = 15.0
"""Robust standard deviations from the median of its neighbours that make a spike."""

NOISE = 3.0
"""Robust standard deviations that are not yet due to the motion."""

MOVING_SHARE = 0.9
"""Share of the moving measurements that are taken for sound."""

MOVING_LIMIT = 4.0
"""Times what these keep to that a measurement in motion may be away."""

LEAST_MOVING = 30
"""Moving measurements that tell what motion does; of fewer all is put down to it that may be."""


def lost_beams(
    time: Array, shift: Array, rotation: Array, rigid: Array, step: float
) -> NDArray[np.bool_]:
    """Tell which poses stand out from their neighbours.

    `time` (n,): rising [s].  `shift` (n, 3): measured positions [m]; NaN = not measured.  Of a
    target that is not at O they swing with the rotation.  `rotation`, `rigid` (n, 3, 3): measured
    rotations, and those of the rigid wrist when they were measured.  `step`: of the encoders [rad].
    Gives (n,): True = lost; none where poses are far apart.
    """
    if len(time) < 2 or np.median(np.diff(time)) > DENSE_S:
        return np.zeros(len(time), dtype=bool)
    way = in_pieces(
        lambda first, second: rotation_vector(second @ np.swapaxes(first, 1, 2)),
        rigid[:-1],
        rigid[1:],
    )
    swing = _swing(time, way)
    moving = swing > MOVING_RAD
    turn = turn_left(rotation, rigid)
    place, lever = place_left(shift, rigid)
    # Stamps that jitter hide much along the motion and nothing across it.
    lost = spikes(place, LEAST_SPIKE_M, lever * swing, moving)
    for each in (turn, _across(turn, way, step)):
        lost |= spikes(each, LEAST_SPIKE_STEPS * step, swing, moving)
    return lost


def _swing(time: Array, way: Array) -> Array:
    """Return how far the wrist turns beside each pose while a stamp may be late, (n,) [rad].

    Its way from pose to pose is (n - 1, 3) rotation vectors.
    """
    # Neighbours differ by half a window's turn at most: a count that flickers at 1 kHz is no speed.
    share = LATE_S / np.maximum(np.diff(time), LATE_S / (WINDOW // 2))
    swing = share * np.linalg.norm(way, axis=1)
    near = sliding_window_view(np.pad(swing, WINDOW // 2), WINDOW - 1)
    return np.asarray(np.max(near, axis=1))


def _across(turn: Array, way: Array, step: float) -> Array:
    """Return the parts of turns (n, 3) across the way (n - 1, 3); all of them where it is short."""
    beside = sliding_window_view(np.pad(way, ((1, 1), (0, 0))), 2, axis=0).sum(axis=2)
    size = np.linalg.norm(beside, axis=1, keepdims=True)
    told = size > TELLING_STEPS * step
    along = np.divide(beside, size, out=np.zeros_like(beside), where=told)
    return turn - np.sum(turn * along, axis=1, keepdims=True) * along


def spikes(
    values: Array, least: float, swing: Array, moving: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Find the rows that stand out from their neighbours and from what neighbours usually do.

    What the wrist itself does lasts longer than two samples, or is as large everywhere.  What a
    stamp that is not quite right does grows with the motion, in all motions alike.

    `values` (n, m): in the order of time; NaN = not measured.  `least`: smaller spikes are none.
    `swing` (n,): largest difference from its neighbours that motion can make of a value.  `moving`
    (n,): rows whose swing tells how much of it motion does make.  Gives (n,): True = spike.
    """
    apart = np.stack([_apart(column) for column in values.T], axis=1)
    scale = np.array([_usual(column) for column in apart.T])
    limit = np.maximum(
        LIMIT * scale, least + (_share(apart, scale, swing, moving) * swing)[:, None]
    )
    return np.asarray((apart > limit).any(axis=1))


def _apart(column: Array) -> Array:
    """Return how far values (n,) are from the median of their neighbours, zero where too few."""
    apart = np.zeros(len(column))
    known = np.flatnonzero(np.isfinite(column))
    if len(known) >= WINDOW:
        apart[known] = np.abs(column[known] - median_filter(column[known], WINDOW, mode="nearest"))
    return apart


def _usual(apart: Array) -> float:
    differing = apart[apart > 0.0]
    return MAD_TO_SIGMA * float(np.median(differing)) if differing.size else 0.0


def _share(apart: Array, scale: Array, swing: Array, moving: NDArray[np.bool_]) -> float:
    """Return the share of the largest swing that motion makes of values at most."""
    moving = moving & (apart > 0.0).any(axis=1)
    if moving.sum() < LEAST_MOVING:
        return 1.0
    beyond = np.max(np.maximum(apart[moving] - NOISE * scale, 0.0), axis=1)
    return min(1.0, MOVING_LIMIT * float(np.quantile(beyond / swing[moving], MOVING_SHARE)))
