"""What a bushing does besides being elastic: its play, its polymer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import JOINED, Bending, Flowing
from wrist_stiffness.simulation.seat import Seat


def play(component: str, seat: Seat, clearance: float, squeeze: float, form: str) -> Bending:
    """Let a pin lean on its bore at both ends as the reactions there push it.

    An end at which the reaction F pushes lies at the radial distance (c/2) g(|F|/F0): it has
    crossed the gap when F is well above the little force F0 that squeezes the contact shut.

    `clearance`: c, diametral [m]; `squeeze`: F0, the force that takes up the rough contact [N];
    `form`: `algebraic`, g = x/sqrt(1+x^2), or `exponential`, g = 1-exp(-x) with a rounded tip.
    """
    rings, half = seat.rings, clearance / 2.0

    def bend(block: Block, wrench: Array) -> tuple[Array, Array]:
        to_origin = seat.to_origin(block.rotation(component))
        local = wrench[:, None] @ to_origin
        push = (local[:, None] @ np.swapaxes(rings, -1, -2))[..., 0, :]
        size = np.sqrt(np.sum(push * push, axis=-1) + (1e-3 * squeeze) ** 2)[..., None]
        x = size / squeeze
        if form == "algebraic":
            over = half / squeeze / np.sqrt(1.0 + x * x)
            fall = -half / squeeze**3 / (1.0 + x * x) ** 1.5 * size
        else:
            over = half * (1.0 - np.exp(-x)) / size
            fall = half * np.exp(-x) / (squeeze * size) - over / size
        slope = over[..., None] * np.eye(3) + (fall / size)[..., None] * (
            push[..., :, None] * push[..., None, :]
        )
        # Sums over both ends; stacks of products, einsum of three is ten times as slow.
        screw = ((over * push)[..., None, :] @ rings).sum(axis=1)
        tangent = (np.swapaxes(rings, -1, -2) @ slope @ rings).sum(axis=1)
        return (
            (to_origin @ screw[:, 0, :, None])[..., 0],
            to_origin @ tangent @ np.swapaxes(to_origin, -1, -2),
        )

    return Bending(component, bend=bend)


def hardening(component: str, fall: float, energy: float, form: str) -> Bending:
    """Stiffen with load: the complementary energy grows slower than the square of the load.

    `fall`: how much of the flexibility is gone at high load (`saturating`, up to 0.65), or the
    power by which it falls (`power`, up to 0.5) [-]; `energy`: complementary energy at which the
    fall sets in [J]; `form`: `saturating` or `power`.
    """

    def bend(block: Block, wrench: Array) -> tuple[Array, Array]:
        # Takes back a part of the elastic screw; the tangent follows from the energy.
        flexibility = block.flexibility[:, ELASTIC.index(component)]
        screw = (flexibility @ wrench[..., None])[..., 0]
        x = 0.5 * np.sum(screw * wrench, axis=-1) / energy
        if form == "saturating":
            factor, slope = -fall * (1.0 - np.exp(-x)), -fall * np.exp(-x) / energy
        else:
            factor = (1.0 + x) ** -fall - 1.0
            slope = -fall * (1.0 + x) ** (-fall - 1.0) / energy
        tangent = factor[:, None, None] * flexibility + slope[:, None, None] * (
            screw[:, :, None] * screw[:, None, :]
        )
        return factor[:, None] * screw, tangent

    return Bending(component, bend=bend)


def softening(component: str, rate: float, form: str) -> Bending:
    """Soften as the bodies that the bushing joins warm up: it has their mean temperature.

    `rate`: fall of the modulus [1/K]; `form`: `exponential`, or `glassy`: little at first, then a
    drop around 10 K above the reference.
    """

    def bend(block: Block, wrench: Array) -> tuple[Array, Array]:
        kelvin = np.mean([block.temperature_of(body) for body in JOINED[component]], axis=0)
        if form == "exponential":
            extra = np.expm1(np.clip(rate * kelvin, -5.0, 5.0))
        else:
            extra = 20.0 * rate * (np.tanh((kelvin - 10.0) / 6.0) + np.tanh(10.0 / 6.0))
        tangent = extra[:, None, None] * block.flexibility[:, ELASTIC.index(component)]
        return (tangent @ wrench[..., None])[..., 0], tangent

    return Bending(component, bend=bend)


@dataclass
class Creep(Flowing):
    """Kelvin-Voigt elements in series with the bushing, in its own axes (a Prony series).

        dx_i/dt = (share_i C w - x_i) / tau_i        screw = sum_i x_i

    One element is the standard linear solid, a geometric row of them is nearly the power law.
    """

    component: str  # joint whose bushing creeps
    shares: Array  # (k,), flexibility of each element over the elastic one [-]
    times_s: Array  # (k,), time constants [s]
    past: tuple[float, Array, Array] | None = None  # time [s], drive and strains

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Integrate exactly for a wrench that changes linearly between samples."""
        joint = self.component
        turn = block_diagonal(block.rotation(joint))
        k = ELASTIC.index(joint)
        elastic = (block.flexibility[:, k] @ wrench[..., None])[..., 0]
        drive = np.einsum("nji,nj->ni", turn, elastic)
        shares, times_s = self.shares[:, None], self.times_s[:, None]
        # The wrist has stood as it stands at the start for long.
        start = block.time_s[0], drive[0], shares * drive[0]
        before, past, strain = self.past or start
        out = np.empty_like(drive)
        for i, now in enumerate(block.time_s):
            x = (now - before) / times_s
            decay = np.exp(-x)
            # Mean of the exponential over the step: the weight of the linear part.
            ramp = np.where(x > 1e-8, -np.expm1(-x) / np.maximum(x, 1e-8), 1.0)
            target = drive[i] * (1.0 - ramp) + past * (ramp - decay)
            strain = decay * strain + shares * target
            out[i] = strain.sum(axis=0)
            before, past = now, drive[i]
        if remember:
            self.past = float(before), past.copy(), strain
        return np.einsum("nij,nj->ni", turn, out)
