"""`measurement_frame`, `target_mounting`, `drift`: the pose is seen in another place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class MeasurementFrame(Law):
    """The sensor's frame is not F: T_seen = X T."""

    motion: Array  # (6,), X = exp(motion) [m, rad]

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move everything by X."""
        turn, move = exp_twist(self.motion)
        return turn @ rotation, shift @ turn.T + move


@dataclass(frozen=True)
class TargetMounting(Law):
    """The target is not at its place on the platform: T_seen = T Y."""

    motion: Array  # (6,), Y = exp(motion), in U [m, rad]

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move the target by Y on the platform."""
        turn, move = exp_twist(self.motion)
        return rotation @ turn, shift + rotation @ move


@dataclass(frozen=True)
class Drift(Law):
    """The sensor's frame wanders slowly."""

    motion: Array  # (6,), after the time `reach_s` [m, rad]
    reach_s: float  # [s]
    form: str  # `linear`, `settling` (exponential) or `daily` (a wave of four times the reach)

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move everything by the drift so far."""
        x = block.time_s / self.reach_s
        shape = {
            "linear": x,
            "settling": -np.expm1(-3.0 * x) / -np.expm1(-3.0),
            "daily": np.sin(0.5 * np.pi * x),
        }[self.form]
        turn, move = exp_twist(shape[:, None] * self.motion)
        return turn @ rotation, (turn @ shift[..., None])[..., 0] + move
