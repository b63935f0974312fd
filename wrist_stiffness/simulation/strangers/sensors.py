"""Strangers in the sensors: an overload ring that touches, a prism met at an angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross, dot
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class OverloadRing(Law):
    """The load sensor reads too little of a side force beyond a limit: its overload ring touches.

    Chips fill most of the gap; what then goes through the ring goes past the strain gauges.
    """

    share: float  # of the side force beyond the limit that goes through the ring [-]
    normal: Array  # (3,), platform's normal in U; side forces are across it
    centre: Array  # (3,), of the ring, in U [m]
    limit: float  # side force at which it touches [N]

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Take away what goes through the ring."""
        platform = block.configuration.platform
        normal, at = platform @ self.normal, platform @ self.centre
        force = wrench[:, :3]
        side = force - dot(force, normal)[:, None] * normal
        size = np.maximum(np.sqrt(dot(side, side)), self.limit)
        past = (self.share * (1.0 - self.limit / size))[:, None] * side
        return wrench - np.concatenate([past, cross(at, past)], axis=-1)


@dataclass(frozen=True)
class PrismIncidence(Law):
    """The tracker's position is off along its beam, by the angle at which that meets the prism.

    Light that enters the glass at an angle takes another way than its distance constant says:
    depth * (n - sqrt(n^2 - sin^2 angle)) too short, as the prism turns with the platform.
    """

    depth: float  # of the glass that the sensor's settings leave out [m]
    beam: Array  # (3,), direction in F from target to sensor, unit vector
    face: Array  # (3,), normal of the prism's face in U, unit vector

    GLASS = 1.52
    """Refractive index of the prism, n."""

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move the target towards the sensor."""
        sine_2 = 1.0 - ((rotation @ self.face) @ self.beam) ** 2
        short = self.depth * (self.GLASS - np.sqrt(self.GLASS**2 - sine_2))
        return rotation, shift + short[:, None] * self.beam
