"""Poses that only repeat the one before: an instrument lost its target and sends the last one.

Sound instruments repeat a pose as well, where their digits are coarser than their noise: at rest,
and in motion until the next digit.  So a repetition is held against what measured and rigid poses
usually differ by, digits, elasticity and play being in that, and against how often this instrument
repeats a pose at rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.mechanism.rigid_motion import rotation_vector
from wrist_stiffness.sessions.reading.lost_beams import (
    LATE_S,
    LEAST_MOVING,
    MOVING_LIMIT,
    MOVING_SHARE,
)
from wrist_stiffness.sessions.reading.registration import place_left, places_of, turn_left
from wrist_stiffness.sessions.unit_session import FINEST

Mask = NDArray[np.bool_]

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


def stood_still(
    time: Array, shift: Array, rotation: Array, rigid: Array, repeats: Mask, step: float
) -> Mask:
    """Tell which poses only repeat the one before, and are no measurements.

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
        left, lever = place_left(shift[first], rigid[first])
        way = (now - start) @ places_of(shift[first], rigid[first])[0]
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
