"""Motors: the shaft follows what is sent, the encoder counts steps."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array


class Drive:
    """Both motors with their position loops and encoders.

    A loop is satisfied as soon as the shaft lies within half a count of what was sent: where it
    stops there differs from move to move, and no encoder shows it.

    Parameters
    ----------
    step : float
        Encoder step [rad].
    rng : numpy.random.Generator
        Belongs to the drive alone.
    """

    def __init__(self, step: float, rng: np.random.Generator) -> None:
        self._step = step
        self._rng = rng
        self._sent = np.full(2, np.nan)
        self._moving = np.zeros(2, dtype=bool)
        self._rest = self._draw()

    def shaft(self, sent: Array) -> Array:
        """Return the shaft angles (n, 2) for the next n angles sent (n, 2) [rad]."""
        out = np.empty_like(sent)
        for i, angles in enumerate(sent):
            moving = (angles != self._sent) & np.isfinite(self._sent)
            started = moving & ~self._moving
            if started.any():
                self._rest = np.where(started, self._draw(), self._rest)
            self._sent, self._moving = angles, moving
            out[i] = angles + self._rest
        return out

    def read(self, shaft: Array) -> Array:
        """Return what the encoders show for shaft angles (n, 2) [rad]."""
        return self._step * np.round(shaft / self._step)

    def _draw(self) -> Array:
        return self._step * self._rng.uniform(-0.5, 0.5, 2)
