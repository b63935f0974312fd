"""Joint states that repeat angles: stamped anew, but read less often than they are sent."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.campaign.reading.signals import Signal
from wrist_stiffness.compensation.load_history import NANOSECONDS

LEAST_CHANGE_RAD = float(np.radians(0.05))
"""Some counts: a motor that moves by so much at once moves on in the next reading [rad]."""

LEAST_CHANGES = 20


def without_held(angles: Signal) -> tuple[Signal, float]:
    """Leave out the repetitions of angles that are read less often than they are sent.

    Parameters
    ----------
    angles : Signal
        Motor angles (m, 2) [rad].

    Returns
    -------
    kept : Signal
        Angles at the stamps at which they first appear, and at rest as often as they are read.
    held_s : float
        How long an angle in motion is repeated, zero where none is [s].
    """
    change = np.max(np.abs(np.diff(angles.values, axis=0)), axis=1, initial=0.0)
    changed = 1 + np.flatnonzero(change > 0.0)
    large = change[changed - 1] > LEAST_CHANGE_RAD
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
