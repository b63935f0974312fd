"""`drive_compliance`: gears and couplings that wind up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Bending


@dataclass(frozen=True)
class Drive(Bending):
    """Gears and coupling of a motor, which wind up about its axis by a law of their own."""

    component: str  # driven joint
    axis: Array  # (3,), motor axis in F
    # torque (n,) [N m] to turn (n,) [rad] and its slope (n,)
    wound: Callable[[Block, Array], tuple[Array, Array]]

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Turn about the motor axis."""
        about = np.concatenate([np.zeros(3), self.axis])
        turn, slope = self.wound(block, wrench @ about)
        return turn[:, None] * about, slope[:, None, None] * np.outer(about, about)


STIFFER = 0.01
"""Torque at which a stiffening drive has half of its softness left [N m]."""


def stiffening(softness: float, block: Block, torque: Array) -> tuple[Array, Array]:
    """Turn by a saturating logarithm: teeth touch more fully under torque."""
    turn = softness * STIFFER * np.arcsinh(torque / STIFFER)
    return turn, softness / np.sqrt(1.0 + (torque / STIFFER) ** 2)


def one_sided(softness: tuple[float, float], block: Block, torque: Array) -> tuple[Array, Array]:
    """Turn by the softness of the flank that is loaded: of torques above 0, or below."""
    own = np.where(torque > 0.0, *softness)
    return own * torque, own
