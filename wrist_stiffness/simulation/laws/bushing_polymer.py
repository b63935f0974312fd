"""What a polymer bushing does besides being elastic.

`bushing_hardening`, `thermal_softening`, `creep`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Bending, Flowing


@dataclass(frozen=True)
class BushingHardening(Bending):
    """Stiffening with load: the complementary energy grows slower than the square of the load."""

    component: str
    # how much of the flexibility is gone at high load (`saturating`, up to 0.65), or the power by
    # which it falls (`power`, up to 0.5) [-]
    fall: float
    energy: float  # complementary energy at which the fall sets in [J]
    form: str  # `saturating` or `power`

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Take back a part of the elastic screw; the tangent follows from the energy."""
        flexibility = block.flexibility[:, ELASTIC.index(self.component)]
        screw = (flexibility @ wrench[..., None])[..., 0]
        x = 0.5 * np.sum(screw * wrench, axis=-1) / self.energy
        if self.form == "saturating":
            factor = -self.fall * (1.0 - np.exp(-x))
            slope = -self.fall * np.exp(-x) / self.energy
        else:
            factor = (1.0 + x) ** -self.fall - 1.0
            slope = -self.fall * (1.0 + x) ** (-self.fall - 1.0) / self.energy
        tangent = factor[:, None, None] * flexibility + slope[:, None, None] * (
            screw[:, :, None] * screw[:, None, :]
        )
        return factor[:, None] * screw, tangent


@dataclass(frozen=True)
class ThermalSoftening(Bending):
    """The modulus falls with the temperature of the bodies that the bushing joins."""

    component: str
    bodies: tuple[str, str]  # whose mean temperature the bushing has
    rate: float  # fall of the modulus [1/K]
    # `exponential`, or `glassy`: little at first, then a drop around 10 K above the reference
    form: str

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Add flexibility in proportion to the lost modulus."""
        kelvin = np.mean([block.temperature_of(body) for body in self.bodies], axis=0)
        if self.form == "exponential":
            extra = np.expm1(np.clip(self.rate * kelvin, -5.0, 5.0))
        else:
            extra = 20.0 * self.rate * (np.tanh((kelvin - 10.0) / 6.0) + np.tanh(10.0 / 6.0))
        tangent = extra[:, None, None] * block.flexibility[:, ELASTIC.index(self.component)]
        return (tangent @ wrench[..., None])[..., 0], tangent


class Creep(Flowing):
    """Kelvin-Voigt elements in series with the bushing, in its own axes (a Prony series).

        dx_i/dt = (share_i C w - x_i) / tau_i        screw = sum_i x_i

    `joint`: whose bushing.  `shares`: flexibility of each element over the elastic one [-].
    `times_s`: time constants [s]; one is the standard linear solid, a geometric row of them is
    nearly the power law of creep.
    """

    def __init__(self, joint: str, shares: Array, times_s: Array) -> None:
        self.component = joint
        self._shares = np.asarray(shares)[:, None]
        self._times_s = np.asarray(times_s)[:, None]
        self._state: tuple[float, Array, Array] | None = None

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Integrate exactly for a wrench that changes linearly between samples."""
        joint = self.component
        turn = block_diagonal(block.rotation(joint))
        k = ELASTIC.index(joint)
        elastic = (block.flexibility[:, k] @ wrench[..., None])[..., 0]
        drive = np.einsum("nji,nj->ni", turn, elastic)
        if self._state is None:
            # The wrist has stood as it stands at the start for long.
            before, past, strain = block.time_s[0], drive[0], self._shares * drive[0]
        else:
            before, past, strain = self._state
        out = np.empty_like(drive)
        for i, now in enumerate(block.time_s):
            x = (now - before) / self._times_s
            decay = np.exp(-x)
            # Mean of the exponential over the step: the weight of the linear part.
            ramp = np.where(x > 1e-8, -np.expm1(-x) / np.maximum(x, 1e-8), 1.0)
            target = drive[i] * (1.0 - ramp) + past * (ramp - decay)
            strain = decay * strain + self._shares * target
            out[i] = strain.sum(axis=0)
            before, past = now, drive[i]
        if remember:
            self._state = float(before), past.copy(), strain
        return np.einsum("nij,nj->ni", turn, out)
