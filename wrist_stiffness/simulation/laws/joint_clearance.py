"""`joint_clearance`: the pin leans on the bore at both ends as the reactions there push it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Bending
from wrist_stiffness.simulation.seat import Seat


@dataclass(frozen=True)
class JointClearance(Bending):
    """Play of a pin in its bore: contact equilibrium of the two ends, each on its own.

    An end at which the reaction F pushes lies at the radial distance (c/2) g(|F|/F0): it has
    crossed the gap when F is well above the little force F0 that squeezes the contact shut.
    """

    component: str
    seat: Seat
    clearance: float  # diametral [m]
    squeeze: float  # F0, the force that takes up the rough contact [N]
    form: str  # `algebraic`, g = x/sqrt(1+x^2), or `exponential`, g = 1-exp(-x) with a rounded tip

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Push both ends of the pin against the bore."""
        to_origin = self.seat.to_origin(block.rotation(self.component))
        local = wrench[:, None] @ to_origin
        rings = self.seat.rings
        push = (local[:, None] @ np.swapaxes(rings, -1, -2))[..., 0, :]
        size = np.sqrt(np.sum(push * push, axis=-1) + (1e-3 * self.squeeze) ** 2)[..., None]
        half, x = self.clearance / 2.0, size / self.squeeze
        if self.form == "algebraic":
            over = half / self.squeeze / np.sqrt(1.0 + x * x)
            fall = -half / self.squeeze**3 / (1.0 + x * x) ** 1.5 * size
        else:
            over = half * (1.0 - np.exp(-x)) / size
            fall = half * np.exp(-x) / (self.squeeze * size) - over / size
        displaced = over * push
        slope = over[..., None] * np.eye(3) + (fall / size)[..., None] * (
            push[..., :, None] * push[..., None, :]
        )
        # Sums over both ends; stacks of products, einsum of three is ten times as slow.
        screw = (displaced[..., None, :] @ rings).sum(axis=1)
        tangent = (np.swapaxes(rings, -1, -2) @ slope @ rings).sum(axis=1)
        return (
            (to_origin @ screw[:, 0, :, None])[..., 0],
            to_origin @ tangent @ np.swapaxes(to_origin, -1, -2),
        )
