"""Joint states that repeat angles: stamped anew, but read less often than they are sent."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.reading.signals import Signal

LEAST_CHANGE_RAD = float(np.radians(0.05))
"""Held for a while, a smaller change does little harm [rad]."""

LEAST_CHANGE_COUNTS = 1.5
"""A motor that moves by two counts at once moves on in the next reading."""

SAME_RAD = 1e-9
"""Angles that differ by less are one count, rounded in two ways [rad]."""

LEAST_CHANGES = 20


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
    messages = np.diff(changed)[large[1:] & large[:-1]]
    every = round(float(np.median(messages))) if len(messages) >= LEAST_CHANGES else 1
    if every == 1:
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
    period_s = float(np.median(np.diff(angles.time_ns))) / NANOSECONDS
    return Signal(angles.time_ns[kept], angles.values[kept]), every * period_s


def _steps(values: Array) -> Array:
    """Return the smallest difference between any two angles (m, 2) of each motor, (2,) [rad].

    Of angles in counts it is one count; the geometry's may be that of another encoder.
    """
    apart = (np.diff(np.unique(column)) for column in values.T)
    return np.array([np.min(each[each > SAME_RAD], initial=np.inf) for each in apart])
