"""`axis_misalignment`: a joint axis was made or mounted beside its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law, at_component


@dataclass(frozen=True)
class AxisMisalignment(Law):
    """A constant small screw in the body on the motor's side of a joint."""

    joint: str  # which one
    screw: Array  # (6,), at O with the wrist at home [m, rad]

    def screws(self, block: Block) -> Array:
        """Turn it with its body."""
        turned = block_diagonal(block.rotation(self.joint)) @ self.screw
        return at_component(block, self.joint, np.asarray(turned))
