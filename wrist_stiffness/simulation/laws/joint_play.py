"""`joint_clearance`, `flange_contact`: the play of a joint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Bending, Law
from wrist_stiffness.simulation.seat import Seat


@dataclass(frozen=True)
class FlangeGap(Law):
    """Another axial gap at the flanges of a passive joint."""

    joint: str  # passive joint with flanges
    change: float  # of the gap [m]; negative presses the flange on

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Move the flange.

        Raises `InputError` if the joint has no flange in this table.
        """
        if self.joint not in parts.contact:
            raise InputError(f"flange_contact: {self.joint} has no flange in this table")
        flange = parts.contact[self.joint]
        contact = dict(parts.contact)
        contact[self.joint] = replace(flange, gap=flange.gap + self.change)
        return replace(parts, contact=contact)


@dataclass(frozen=True)
class JointClearance(Bending):
    """Play of a pin in its bore: it leans on it at both ends as the reactions there push it.

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
