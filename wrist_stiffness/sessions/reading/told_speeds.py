"""Motor speeds that joint states tell, and whether they are those of the angles beside them."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.sessions.reading.signals import Signal

WINDOW_S = 0.1
"""Over which speeds are summed up and compared with the way [s]."""

LONGEST_WINDOW_S = 0.2

LEAST_WAY_RAD = float(np.radians(0.2))
"""Many counts: a shorter way tells no speed [rad]."""

LEAST_WINDOWS = 10

OTHER = 2.0
"""By so much told speeds may differ from those of the angles, half of them being larger still."""


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
