"""Motors: the shaft follows what is sent, the encoder counts steps."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array


class Drive:
    """Both motors with their position loops and encoders.

    A loop is satisfied as soon as the shaft lies within half a count of what was sent: where it
    stops there differs from move to move, and no encoder shows it.

    `step`: encoder step [rad]; `rng`: belongs to the drive alone.
    """

    SETTLING_S = 0.1
    """Time constant with which the shaft goes to another place within the count."""

    SPEED_UNIT = float(np.radians(0.01))
    """In which a drive tells its speed [rad/s]."""

    def __init__(self, step: float, rng: np.random.Generator) -> None:
        self._step = step
        self._rng = rng
        self._time_s: float | None = None
        self._sent = np.zeros(2)
        self._moving = np.zeros(2, dtype=bool)
        self._goal = self._draw()
        self._rest = self._goal

    def shaft(self, time_s: Array, sent: Array) -> Array:
        """Return the shaft angles (n, 2) for the next n times (n,) [s] and angles sent [rad]."""
        out = np.empty_like(sent)
        for i, angles in enumerate(sent):
            if self._time_s is not None:
                moving = angles != self._sent
                started = moving & ~self._moving
                if started.any():
                    self._goal = np.where(started, self._draw(), self._goal)
                stay = np.exp(-max(time_s[i] - self._time_s, 0.0) / self.SETTLING_S)
                self._rest = self._goal + stay * (self._rest - self._goal)
                self._moving = moving
            self._time_s, self._sent = float(time_s[i]), angles
            out[i] = angles + self._rest
        return out

    def read(self, shaft: Array) -> Array:
        """Return what the encoders show for shaft angles (n, 2) [rad]."""
        return self._step * np.round(shaft / self._step)

    def tell(self, speed: Array) -> Array:
        """Return the speeds that the drives tell for those (n, 2) that they see [rad/s]."""
        return self.SPEED_UNIT * np.round(speed / self.SPEED_UNIT)

    def _draw(self) -> Array:
        return self._step * self._rng.uniform(-0.5, 0.5, 2)
