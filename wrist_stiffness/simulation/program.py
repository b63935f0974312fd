"""What the cell does: motor angles and platform load as smooth functions of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array

SPEED_SPAN_S = 4e-3
"""Over which drives take a speed [s]."""


@dataclass(frozen=True)
class Track:
    """Values at knots, joined by minimum-jerk transitions (Flash and Hogan 1985).

    Two equal values in a row are a rest.
    """

    time_s: Array  # (m,), increasing, beginning with 0 [s]
    values: Array  # (m, d), value at each knot

    def __call__(self, time_s: Array) -> Array:
        """Return the values (..., d) at times (...) [s]; beyond the ends they are held."""
        time_s = np.clip(time_s, 0.0, self.time_s[-1])
        before = np.clip(
            np.searchsorted(self.time_s, time_s, side="right") - 1, 0, len(self.time_s) - 2
        )
        span = self.time_s[before + 1] - self.time_s[before]
        u = (time_s - self.time_s[before]) / span
        blend = (u * u * u * (10.0 + u * (6.0 * u - 15.0)))[..., None]
        return self.values[before] + blend * (self.values[before + 1] - self.values[before])


@dataclass(frozen=True)
class Program:
    """Motor angles, load and ambient temperature of one experiment; repeats when it is over."""

    angles: Track  # nominal motor angles, d = 2 [rad]
    load: Track  # wrench on the platform at O in F, d = 6 [N, N m]
    ambient: Track  # temperature of the room above the reference temperature, d = 1 [K]
    duration_s: float  # after this time the program begins again [s]

    def phase(self, time_s: Array) -> Array:
        """Return the time since the current repetition began (...) [s]."""
        return np.mod(time_s, self.duration_s)

    def sent(self, time_s: Array) -> Array:
        """Return the nominal motor angles (..., 2) at times since the start (...) [s]."""
        return self.angles(self.phase(time_s))

    def speed(self, time_s: Array) -> Array:
        """Return their mean speeds (..., 2) over the last `SPEED_SPAN_S` [rad/s]."""
        before = self.sent(np.maximum(time_s - SPEED_SPAN_S, 0.0))
        return (self.sent(time_s) - before) / SPEED_SPAN_S


class Schedule:
    """Builds a program move by move.

    `theta` (2,): motor angles at the start [rad].
    """

    def __init__(self, theta: Array) -> None:
        self.time_s = 0.0
        self._angles = [(0.0, theta)]
        self._loads = [(0.0, np.zeros(6))]
        self._ambient = [(0.0, np.zeros(1))]

    @property
    def theta(self) -> Array:
        """Motor angles now, (2,) [rad]."""
        return self._angles[-1][1]

    def go_on(self, seconds: float, theta: Array | None = None, load: Array | None = None) -> None:
        """Move the motors to `theta` (2,) [rad] and change the load to `load` (6,) [N, N m].

        What is not given stays as it is.
        """
        self.time_s += seconds
        self._angles.append((self.time_s, self.theta if theta is None else theta))
        self._loads.append((self.time_s, self._loads[-1][1] if load is None else load))

    def ambient(self, kelvin: float) -> None:
        """Let the room drift to this temperature until now, from where it was said last [K]."""
        self._ambient.append((self.time_s, np.array([kelvin])))

    def program(self, return_s: float) -> Program:
        """Return the program, closed by an unloading and a move back to its start."""
        self.go_on(return_s, load=np.zeros(6))
        self.go_on(return_s, self._angles[0][1])
        self.ambient(float(self._ambient[0][1][0]))
        angles, load, ambient = (
            Track(np.array([time for time, _ in knots]), np.array([value for _, value in knots]))
            for knots in (self._angles, self._loads, self._ambient)
        )
        return Program(angles, load, ambient, self.time_s)
