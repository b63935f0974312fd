"""Load sensors that read another wrench.

`load_bias`, `load_scale`, `load_cross_talk`, `load_misalignment`, `load_point`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class LoadBias(Law):
    """A zero that is wrong, or that settles after switching on."""

    bias: Array  # (6,), at O in F [N, N m]
    warm_up_s: float  # time constant with which it appears [s]; 0 = it is there from the start

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Add it."""
        grown = -np.expm1(-block.time_s / self.warm_up_s) if self.warm_up_s > 0.0 else 1.0
        return wrench + np.multiply.outer(np.broadcast_to(grown, block.time_s.shape), self.bias)


@dataclass(frozen=True)
class LoadMatrix(Law):
    """A wrong calibration matrix."""

    matrix: Array  # (6, 6), reading per wrench: a scale, cross-talk or a turned sensor

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Apply it."""
        return wrench @ self.matrix.T


def turned_sensor(turn: Array) -> Array:
    """Return the matrix (6, 6) of a sensor that was mounted turned by a rotation vector (3,)."""
    return block_diagonal(Rotation.from_rotvec(turn).as_matrix().T)


@dataclass(frozen=True)
class LoadPoint(Law):
    """The moment is reported about a point beside O."""

    point: Array  # (3,), from O, in F or in U [m]
    on_platform: bool  # whether the point turns with the platform

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Change the moment by lever arm times force."""
        point = block.configuration.platform @ self.point if self.on_platform else self.point
        out = wrench.copy()
        out[:, 3:] -= cross(np.broadcast_to(point, out[:, :3].shape), out[:, :3])
        return out
