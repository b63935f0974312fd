"""Wild joint states: one alone, farther off than a motor can go and come back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.reading.signals import Signal

DENSE_S = 0.025
"""Median time between joint states below which out and back is no motion [s]."""

LEAST_WILD_RAD = float(np.radians(0.2))
"""Some counts: smaller ones are chatter [rad]."""

ALONE = 4.0
"""Times what its neighbours are off the line without it that a wild one is off the line."""


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
