"""Where the wrist turned back, and the load with it, between measured poses that are far apart.

Friction, backlash and creep remember the way to a pose.  Between the poses of a machine that
measures at rest, or where the tracker was blind, the measured stamps alone do not tell it.
"""

from __future__ import annotations

import numpy as np

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.reading.signals import Signal, Stamps

GAP_S = 0.2
"""Poses that are nearer to each other tell the path themselves [s]."""


def turning_stamps(signal: Signal, time_ns: Stamps, least: Array) -> Stamps:
    """Return the stamps of the extremes of a signal inside the gaps between poses.

    Of each gap only the outermost extremes count: smaller swings inside them are forgotten by play
    and friction as well.

    `signal`: values (m, k); `time_ns` (n,) int64: stamps of the poses, rising [ns]; `least` (k,):
    an extreme stands out by more than this from the values at both ends of its gap.  Gives (p,)
    int64: rising [ns].
    """
    ends = signal.interpolated(np.clip(time_ns, signal.time_ns[0], signal.time_ns[-1]))
    after = np.searchsorted(signal.time_ns, time_ns, side="right")
    found = [
        signal.time_ns[rows][np.argmax(sign * signal.values[rows, column])]
        for gap in np.flatnonzero(np.diff(time_ns) > round(GAP_S * NANOSECONDS))
        if after[gap] < after[gap + 1]
        for rows in [slice(after[gap], after[gap + 1])]
        for sign in (1.0, -1.0)
        for column in np.flatnonzero(
            np.max(sign * signal.values[rows], axis=0)
            > np.max(sign * ends[gap : gap + 2], axis=0) + least
        )
    ]
    return np.unique(np.array(found, dtype=np.int64))
