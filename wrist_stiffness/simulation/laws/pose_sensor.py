"""`measurement_frame`, `target_mounting`, `drift`: the pose is seen in another place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class SensorMotion(Law):
    """The sensor's frame is not F: T_seen = exp(share X) T."""

    motion: Array  # (6,), X [m, rad]
    # of samples and of what was to be seen (n, 3, 3), how much of X is there (n,); None for all
    share: Callable[[Block, Array], Array] | None = None

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move everything by it."""
        motion = self.motion
        if self.share is not None:
            motion = self.share(block, rotation)[:, None] * motion
        turn, move = exp_twist(motion)
        return turn @ rotation, (turn @ shift[..., None])[..., 0] + move


@dataclass(frozen=True)
class TargetMounting(Law):
    """The target is not at its place on the platform: T_seen = T Y."""

    motion: Array  # (6,), Y = exp(motion), in U [m, rad]

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move the target by Y on the platform."""
        turn, move = exp_twist(self.motion)
        return rotation @ turn, shift + rotation @ move
