"""`backlash`, `encoder_offset`, `encoder_eccentricity`, `transmission_error`."""

from __future__ import annotations

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
class EncoderOffset(Law):
    """A zero that is wrong."""

    motor: str
    offset: float  # link ahead of the reading [rad]

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Turn by the offset."""
        out = np.zeros_like(shaft)
        out[:, MOTOR[self.motor]] = self.offset
        return out


@dataclass(frozen=True)
class EccentricEncoder(Law):
    """A graduated disc off its axis, read by one head: exact geometry, not its first harmonic."""

    motor: str
    eccentricity: float  # offset of the disc's centre over its radius [-]
    phase: float  # direction of the offset [rad]
    lobes: int  # 1, or 2 where the disc was pressed oval

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Return the true angle less the read one."""
        out = np.zeros_like(shaft)
        column = MOTOR[self.motor]
        at = self.lobes * shaft[:, column] + self.phase
        e = self.eccentricity
        out[:, column] = np.arctan2(e * np.sin(at), 1.0 + e * np.cos(at))
        return out


@dataclass(frozen=True)
class TransmissionError(Law):
    """Gear errors of high order, modulated once a turn by the gear's own run-out."""

    motor: str
    amplitude: float  # [rad]
    orders: Array  # (k,), waves per turn
    phases: Array  # (k,) [rad]
    modulation: float  # share by which the amplitude varies once a turn [-]

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Sum the waves; each is half as high as the one before."""
        out = np.zeros_like(shaft)
        column = MOTOR[self.motor]
        x = shaft[:, column, None]
        height = self.amplitude * 0.5 ** np.arange(len(self.orders))
        waves = (height * np.sin(self.orders * x + self.phases)).sum(axis=-1)
        out[:, column] = waves * (1.0 + self.modulation * np.cos(x[:, 0]))
        return out
