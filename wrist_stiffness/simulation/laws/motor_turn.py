"""`backlash`, `encoder_offset`, `encoder_eccentricity`, `transmission_error`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.simulation.laws.law import MOTOR, Law


class Backlash(Law):
    """Lost motion: the link is dragged by the flanks of its gear or coupling.

    `widths` (k,): full widths of k play operators in parallel [rad]; one is a single pair of teeth,
    several (Prandtl-Ishlinskii) a train whose teeth take hold one after the other.
    """

    def __init__(self, motor: str, widths: Array) -> None:
        self._column = MOTOR[motor]
        self._half = np.asarray(widths) / 2.0
        self._link: Array | None = None

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Drag the link within the play."""
        x = shaft[:, self._column]
        link = np.full(len(self._half), x[0]) if self._link is None else self._link
        out = np.zeros_like(shaft)
        for i, angle in enumerate(x):
            link = np.clip(link, angle - self._half, angle + self._half)
            out[i, self._column] = link.mean() - angle
        self._link = link
        return out


@dataclass(frozen=True)
class AheadOfEncoder(Law):
    """A link that stands ahead of its motor's encoder, by what its angle says."""

    motor: str
    ahead: Callable[[Array], Array]  # encoder angles (n,) to link less encoder (n,) [rad]

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Turn the link of this motor."""
        out, column = np.zeros_like(shaft), MOTOR[self.motor]
        out[:, column] = self.ahead(shaft[:, column])
        return out
