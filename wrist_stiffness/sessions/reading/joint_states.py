"""What may be wrong with joint states: angles that are held, wild ones, speeds in another unit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.sessions.reading.signals import Signal, Twice

LEAST_CHANGE_RAD = float(np.radians(0.05))
"""Held for a while, a smaller change does little harm [rad]."""

LEAST_CHANGE_COUNTS = 1.5
"""A motor that moves by two counts at once moves on in the next reading."""

SAME_RAD = 1e-9
"""Angles that differ by less are one count, rounded in two ways [rad]."""

LEAST_CHANGES = 20

LONGEST_HELD_S = 1.0
"""Every driver reads its encoders more often; what repeats for longer is a pose that was measured
again before the next one, as in the table of a measuring machine [s]."""

DENSE_S = 0.025
"""Median time between joint states below which out and back is no motion [s]."""

LEAST_WILD_RAD = float(np.radians(0.2))
"""Some counts: smaller ones are chatter [rad]."""

ALONE = 4.0
"""Times what its neighbours are off the line without it that a wild one is off the line."""

LEAST_MIXED = 10
"""Readings one after the other that are out and back: single wild ones are rarer."""

ONE_MOTION = 1.5
"""Of one motion every second reading is two periods from the last but one, of two it is one."""

WINDOW_S = 0.1
"""Over which speeds are summed up and compared with the way [s]."""

LONGEST_WINDOW_S = 0.2

LEAST_WAY_RAD = float(np.radians(0.2))
"""Many counts: a shorter way tells no speed [rad]."""

LEAST_WINDOWS = 10

OTHER = 2.0
"""By so much told speeds may differ from those of the angles, half of them being larger still."""


def without_held(angles: Signal) -> tuple[Signal, float]:
    """Leave out the repetitions of angles that are read less often than they are sent.

    `angles`: motor angles (m, 2) [rad].  Gives `kept`: angles at the stamps at which they first
    appear, and at rest as often as they are read, and `held_s`: how long an angle in motion is
    repeated, zero where none is [s].
    """
    change = np.abs(np.diff(angles.values, axis=0))
    changed = 1 + np.flatnonzero((change > 0.0).any(axis=1))
    least = np.maximum(LEAST_CHANGE_RAD, LEAST_CHANGE_COUNTS * _steps(angles.values))
    large = np.any(change[changed - 1] > least, axis=1)
    in_motion = large[1:] & large[:-1]
    if in_motion.sum() < LEAST_CHANGES:
        return angles, 0.0
    every = round(float(np.median(np.diff(changed)[in_motion])))
    held_s = float(np.median(np.diff(angles.time_ns[changed])[in_motion])) / NANOSECONDS
    if every == 1 or held_s > LONGEST_HELD_S:
        return angles, 0.0
    # At rest a reading is as new as in motion, and looks like a repetition.
    rows = np.arange(len(angles))
    appeared = np.concatenate([[0], changed])
    newest = np.searchsorted(appeared, rows, side="right") - 1
    since = rows - appeared[newest]
    # A driver out of step with its encoders repeats once more or less: what repeats until the next
    # reading is due is no reading.
    left = np.append(changed, len(angles))[newest] - rows
    kept = (since % every == 0) & ((since == 0) | (left > every // 2))
    # A first angle that is sent less often than others appeared before the recording began.
    kept[0] = changed[0] >= every
    return Signal(angles.time_ns[kept], angles.values[kept]), held_s


def _steps(values: Array) -> Array:
    """Return the smallest difference between any two angles (m, 2) of each motor, (2,) [rad].

    Of angles in counts it is one count; the geometry's may be that of another encoder.
    """
    apart = (np.diff(np.unique(column)) for column in values.T)
    return np.array([np.min(each[each > SAME_RAD], initial=np.inf) for each in apart])


def mixed(angles: Signal) -> tuple[Twice, ...]:
    """Find where the angles of two motions alternate: a clock was set back, and all were sorted.

    `angles`: motor angles (m, 2) in the order of their stamps [rad].
    """
    time, step = angles.time_ns, np.diff(angles.values, axis=0)
    # Out by much, back by as much, and that again and again: no motor does so between two readings.
    there, back = np.abs(step[:-1]), np.abs(step[1:])
    off = np.abs(angles.values[2:] - angles.values[:-2])
    out = np.any(np.minimum(there, back) > np.maximum(LEAST_WILD_RAD, ALONE * off), axis=1)
    if len(out) < LEAST_MIXED or not (often := _in_a_row(out, LEAST_MIXED)).any():
        return ()
    rows = 1 + np.flatnonzero(often)
    # There each motion has its own readings, so that they are twice as dense as elsewhere.
    apart = time[2:] - time[:-2]
    period = float(np.median(apart[rows - 1]))
    if period > 2.0 * DENSE_S * NANOSECONDS:
        return ()
    single = np.append(0, 1 + np.flatnonzero(apart > ONE_MOTION * period))
    edges = np.append(single, len(time) - 1)
    parts = np.unique(np.searchsorted(single, rows))
    spans = [(int(time[edges[part - 1]]), int(time[edges[part]])) for part in parts]
    return tuple(Twice(begin, end, end - begin) for begin, end in spans)


def _in_a_row(found: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:
    """Tell which of these belong to so many in a row."""
    run = np.cumsum(~found)
    return np.asarray(found & (np.bincount(run, found) >= least)[run])


def without_wild(angles: Signal) -> tuple[Signal, int]:
    """Leave out single angles that are far from those before and after.

    `angles`: motor angles (m, 2) [rad].  Gives `kept`: the others; all of them where they are too
    sparse to tell.
    """
    if len(angles) < 5 or np.median(np.diff(angles.time_ns)) > DENSE_S * NANOSECONDS:
        return angles, 0
    # A stamp that is not quite right puts a sound angle off the line as well; angles that are read
    # regularly are on it by their number.
    stamped = (angles.time_ns - angles.time_ns[0]) / NANOSECONDS
    numbered = np.arange(len(angles), dtype=float)
    alone = _alone(stamped, angles.values) & _alone(numbered, angles.values)
    # Far apart in time nobody knows what the motor did between.
    own = np.diff(angles.time_ns)[1:-1]
    near = np.maximum(own[:-1], own[1:]) <= 2 * DENSE_S * NANOSECONDS
    kept = np.ones(len(angles), dtype=bool)
    kept[2:-2] = ~(alone.any(axis=1) & near)
    return Signal(angles.time_ns[kept], angles.values[kept]), int(np.sum(~kept))


def _alone(time: Array, values: Array) -> NDArray[np.bool_]:
    """Tell which values (n, 2), the outer ones aside, are alone off the line, (n - 4, 2)."""
    # Rows of each value with those around it, and of its neighbours with those without it.
    off, before, after = (
        _off_the_line(time, values, *(slice(2 + k, len(time) - 2 + k) for k in ks))
        for ks in ((-1, 0, 1), (-2, -1, 1), (-1, 1, 2))
    )
    return np.asarray(off > np.maximum(LEAST_WILD_RAD, ALONE * np.maximum(before, after)))


def _off_the_line(time: Array, values: Array, first: slice, middle: slice, last: slice) -> Array:
    """Return how far middle values (k, 2) are from the straight line between two others."""
    share = ((time[middle] - time[first]) / (time[last] - time[first]))[:, None]
    return np.asarray(np.abs(values[middle] - (1.0 - share) * values[first] - share * values[last]))


def fault_of(told: Signal, angles: Signal) -> str:
    """Say what is wrong with told speeds; nothing where the angles agree or do not move.

    `told`: motor speeds (m, 2) [rad/s]; `angles`: motor angles (k, 2) [rad].  Gives which motor's,
    and how many times the true ones they are; empty if none.
    """
    for motor, gain in zip(MOTORS, gains(told, angles).tolist(), strict=True):
        if not (np.isnan(gain) or 1.0 / OTHER < gain < OTHER):
            return (
                f"the speeds of {motor} in the joint states are {gain:.3g} times what its angles "
                "say (sign? deg/s?): speeds are taken from the angles"
            )
    return ""


def gains(told: Signal, angles: Signal) -> Array:
    """Return the median ratio of told ways to those of the angles, (2,); NaN without motion."""
    found = np.full(len(MOTORS), np.nan)
    if len(angles) < 2:
        return found
    time_s = (angles.time_ns - angles.time_ns[0]) / NANOSECONDS
    every = max(1, round(WINDOW_S / max(float(np.median(np.diff(time_s))), 1e-9)))
    speed = told.interpolated(angles.time_ns)
    rise = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time_s)[:, None]
    summed = np.concatenate([np.zeros((1, 2)), np.cumsum(rise, axis=0)])[::every]
    short = np.diff(time_s[::every]) <= LONGEST_WINDOW_S
    way, said = np.diff(angles.values[::every], axis=0), np.diff(summed, axis=0)
    for motor in range(len(MOTORS)):
        used = short & (np.abs(way[:, motor]) > LEAST_WAY_RAD)
        if used.sum() >= LEAST_WINDOWS:
            found[motor] = np.median(said[used, motor] / way[used, motor])
    return found
