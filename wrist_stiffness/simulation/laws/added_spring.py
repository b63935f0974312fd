"""`drive_compliance`, `mount_compliance`, `frame_compliance`, `platform_compliance`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.law import DRIVEN, MOTOR, Bending, Law


@dataclass(frozen=True)
class MountSpring(Law):
    """A spring in the frame in series with a motor: its bracket, or its gears and coupling."""

    motor: str
    flexibility: Array  # (6, 6), at O in F, positive semi-definite

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Add it to the bushing of the driven joint, which sits in the frame as well."""
        flexibility = parts.flexibility.copy()
        flexibility[ELASTIC.index(DRIVEN[self.motor])] += self.flexibility
        return replace(parts, flexibility=flexibility)


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


@dataclass(frozen=True)
class OuterSpring(Law):
    """A spring under both limbs (frame), or between platform and tool (platform)."""

    flexibility: Array  # (6, 6), at O, in F or in U
    # whether it turns with the platform and carries the load alone; the frame's carries all weights
    # as well
    on_platform: bool

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Give way to the whole wrench."""
        if self.on_platform:
            turn = block_diagonal(block.configuration.platform)
            local = np.einsum("nji,nj->ni", turn, block.load)
            return np.einsum("nij,nj->ni", turn, local @ self.flexibility)
        whole = sum(state.through[:, ELASTIC.index(joint)] for joint in DRIVEN.values())
        return np.asarray(whole) @ self.flexibility


def drive_flexibility(motor: str, axes: tuple[Array, Array], softness: float) -> Array:
    """Return the flexibility of a turn about a motor's axis, (6, 6)."""
    column = np.concatenate([np.zeros(3), axes[MOTOR[motor]]])
    return softness * np.outer(column, column)
