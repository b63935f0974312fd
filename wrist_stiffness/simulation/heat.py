"""Temperatures of the cell: a lumped network of bodies, warmed by the motors and by the room.

    C_i dT_i/dt = sum_j g_ij (T_j - T_i) + h_i (T_room - T_i) + P_i

Each motor turns a share of its motion into heat; bodies conduct along the limbs and give heat to
the room.  The constants are assumed, of the size of a 150 mm aluminium and steel wrist.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from wrist_stiffness.mechanism.components import Array

HEATED = ("motor_1", "motor_2", "frame", "link_1", "link_2", "link_3", "platform")

CAPACITY = np.array([40.0, 40.0, 180.0, 12.0, 14.0, 11.0, 16.0])
"""[J/K]."""

TO_ROOM = np.array([0.10, 0.10, 0.60, 0.05, 0.05, 0.05, 0.08])
"""[W/K]."""

CONTACTS = {
    ("motor_1", "frame"): 0.30,
    ("motor_2", "frame"): 0.30,
    ("motor_1", "link_1"): 0.06,
    ("motor_2", "link_2"): 0.06,
    ("link_1", "platform"): 0.02,
    ("link_2", "link_3"): 0.02,
    ("link_3", "platform"): 0.02,
}
"""Conductance between two bodies [W/K]."""

STANDBY_W, RUNNING_W = 0.4, 6.0
"""Heat of a motor at rest [W], and more of it at the speed of `FULL_SPEED`."""

FULL_SPEED = 1.0
"""[rad/s]."""


def _conductance() -> Array:
    matrix = np.diag(TO_ROOM)
    for (one, other), g in CONTACTS.items():
        i, j = HEATED.index(one), HEATED.index(other)
        matrix[i, i] += g
        matrix[j, j] += g
        matrix[i, j] -= g
        matrix[j, i] -= g
    return matrix


CONDUCTANCE = _conductance()


class HeatNetwork:
    """Temperatures sample after sample, by the implicit Euler method."""

    def __init__(self) -> None:
        self._kelvin = np.zeros(len(HEATED))
        self._time_s: float | None = None
        self._angles = np.zeros(2)

    def run(self, time_s: Array, angles: Array, room: Array) -> Array:
        """Return the temperatures above the reference at the next n times.

        `time_s` (n,): increasing [s]; `angles` (n, 2): motor angles [rad]; `room` (n,): temperature
        of the room above the reference [K].  Gives (n, 7): in the order of `HEATED` [K].
        """
        out = np.empty((len(time_s), len(HEATED)))
        for i, now in enumerate(time_s):
            if self._time_s is not None and now > self._time_s:
                # Rounded, so that a steady rate is one step and its inverse is kept.
                dt = round(float(now) - self._time_s, 9)
                heat = np.zeros(len(HEATED))
                speed = np.abs(angles[i] - self._angles) / dt
                heat[:2] = STANDBY_W + RUNNING_W * (speed / FULL_SPEED) ** 2
                driven = CAPACITY * self._kelvin + dt * (heat + TO_ROOM * room[i])
                self._kelvin = _step(dt) @ driven
            self._time_s, self._angles = float(now), angles[i]
            out[i] = self._kelvin
        return out


@lru_cache(maxsize=64)
def _step(dt: float) -> Array:
    return np.asarray(np.linalg.inv(np.diag(CAPACITY) + dt * CONDUCTANCE))
