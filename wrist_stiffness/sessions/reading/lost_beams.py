"""Poses of an instrument that lost its target: wild ones, and the last one sent again and again."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from wrist_stiffness.inference.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.mechanism.rigid_motion import rotation_vector
from wrist_stiffness.sessions.in_pieces import in_pieces
from wrist_stiffness.sessions.reading.registration import place_left, turn_left
from wrist_stiffness.sessions.unit_session import FINEST

Mask = NDArray[np.bool_]

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

LOST_MOTION_RAD = float(np.radians(0.3))
"""So much of a motor's way its gear may lose before the platform follows; more is felt by hand
[rad]."""

REST_STEPS = 2.0
"""In encoder steps: a wrist that turns less around a pose is at rest, its counts flicker."""

SELDOM = 0.1
"""An instrument that repeats a smaller share of its poses at rest shows its noise."""

NO_CHANCE = 20
"""So often in a row such noise repeats nothing: at digits that repeat one pose in ten at rest it is
a chance of 2e-8 of six numbers, of 1e-13 of three."""


def lost_beams(time: Array, shift: Array, rotation: Array, rigid: Array, step: float) -> Mask:
    """Tell which poses neither a registration nor a late stamp explains: they stand out.

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
    place, target = place_left(shift, rigid)
    # Stamps that jitter hide much along the motion and nothing across it.
    lost = spikes(place, LEAST_SPIKE_M, np.linalg.norm(target) * swing, moving)
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


def spikes(values: Array, least: float, swing: Array, moving: Mask) -> Mask:
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


def _share(apart: Array, scale: Array, swing: Array, moving: Mask) -> float:
    """Return the share of the largest swing that motion makes of values at most."""
    moving = moving & (apart > 0.0).any(axis=1)
    if moving.sum() < LEAST_MOVING:
        return 1.0
    beyond = np.max(np.maximum(apart[moving] - NOISE * scale, 0.0), axis=1)
    return min(1.0, MOVING_LIMIT * float(np.quantile(beyond / swing[moving], MOVING_SHARE)))


def stood_still(
    time: Array, shift: Array, rotation: Array, rigid: Array, repeats: Mask, step: float
) -> Mask:
    """Tell which poses only repeat the one before, and are no measurements.

    Sound instruments repeat a pose as well, where their digits are coarser than their noise: at
    rest, and in motion until the next digit.  So a repetition is held against what measured and
    rigid poses usually differ by, digits, elasticity and play being in that, and against how often
    this instrument repeats a pose at rest.

    `time` (n,): rising [s].  `shift` (n, 3): measured positions [m]; `rotation` (n, 3, 3): measured
    rotations; NaN = not measured.  `rigid` (n, 3, 3): those of the rigid wrist when they were
    measured.  `repeats` (n,): poses that are the one before to the bit.  `step`: of the encoders
    [rad].  Gives (n,): all repetitions of a pose in whose time the wrist went farther, or noise
    should have shown more often, than chance explains.
    """
    run = np.cumsum(~repeats)
    gone = _moved(time, shift, rotation, rigid, repeats)
    seen = np.hstack([shift, rotation.reshape(-1, 9)])
    gone |= _noiseless(seen, _at_rest(time, rigid, step), repeats)
    return np.asarray(repeats & np.isin(run, run[gone]))


def _moved(time: Array, shift: Array, rotation: Array, rigid: Array, repeats: Mask) -> Mask:
    """Tell which repetitions are farther from where the pose was measured than is usual, (n,)."""
    first, gone = np.flatnonzero(~repeats), np.zeros(len(time), dtype=bool)
    if len(first) < LEAST_MOVING:
        return gone
    begun = first[np.maximum(np.cumsum(~repeats) - 1, 0)]
    ended = np.append(time[first], 2.0 * time[-1] - time[-2])[np.cumsum(~repeats)]
    # A stamp may be late: until then the wrist may still have come, and gone on before.
    here = np.searchsorted(time, time[begun] + LATE_S, side="right") - 1
    told = np.flatnonzero(repeats & (time <= ended - LATE_S))
    start, now = rigid[np.minimum(here, np.arange(len(time)))[told]], rigid[told]
    if np.isfinite(rotation[first]).all(axis=(1, 2)).any():
        left, lever = turn_left(rotation[first], rigid[first]), 1.0
        way = rotation_vector(now @ np.swapaxes(start, 1, 2))
    else:
        left, target = place_left(shift[first], rigid[first])
        way, lever = (now - start) @ target, float(np.linalg.norm(target))
    left = np.nan_to_num(left[np.isfinite(left).any(axis=1)])
    usual = float(np.quantile(np.linalg.norm(left, axis=1), MOVING_SHARE))
    limit = lever * len(MOTORS) * LOST_MOTION_RAD + MOVING_LIMIT * usual
    gone[told] = np.linalg.norm(way, axis=1) > limit
    return gone


def _at_rest(time: Array, rigid: Array, step: float) -> Mask:
    """Tell around which poses others were measured and the wrist did not move, (n,)."""
    before = np.searchsorted(time, time - LATE_S)
    after = np.searchsorted(time, time + LATE_S, side="right") - 1
    way = rotation_vector(rigid[after] @ np.swapaxes(rigid[before], 1, 2))
    still = np.linalg.norm(way, axis=1) <= REST_STEPS * step
    return np.asarray(still & (time[after] - time[before] >= LATE_S))


def _noiseless(seen: Array, rest: Mask, repeats: Mask) -> Mask:
    """Tell which repetitions are too many in a row for how seldom there are others, (n,).

    `seen` (n, 12): measured positions [m] and rotations; NaN = not measured.  `rest` (n,): poses at
    rest.
    """
    same = np.append(True, np.nan_to_num(np.abs(np.diff(seen, axis=0))).max(axis=1) <= FINEST)
    run = np.cumsum(~repeats)
    own = np.bincount(run, rest & same)
    # As a share of one more, that repeats, and one that does not: none tells little of few.
    share = (np.sum(own) - own + 1.0) / (np.sum(rest) - own + 2.0)
    return np.asarray(repeats & ((share < SELDOM) & (np.bincount(run, repeats) >= NO_CHANCE))[run])
