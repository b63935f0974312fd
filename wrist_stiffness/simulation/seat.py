"""A bushing's own coordinates: wrenches and screws at its centre instead of at O."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.vectors import block_diagonal, screws_to_origin, skew


@dataclass(frozen=True)
class Seat:
    """Where a bushing sits in its carrier, with the wrist at home."""

    axis: Array  # (3,), joint axis, unit vector in F
    centre: Array  # (3,), bushing centre from O in F [m]
    # `length`, `radius`: of the sleeve's bore [m]
    length: float
    radius: float

    @classmethod
    def of(cls, geometry: Geometry, joint: str) -> Seat:
        """Return the seat of a joint's bushing."""
        bushing = geometry.bushings[joint]
        axis = geometry.axes[joint]
        return cls(axis, bushing.radius * axis, bushing.length, bushing.pin_diameter / 2.0)

    def to_origin(self, rotation: Array) -> Array:
        """Return T (n, 6, 6) of a carrier rotation (n, 3, 3).

        T maps a screw at the centre in home axes to O in F; its transpose maps a wrench back.
        """
        return block_diagonal(rotation) @ screws_to_origin(self.centre)

    @cached_property
    def rings(self) -> Array:
        """Radial force on the two ends of the bore, (2, 3, 6), for a wrench at the centre.

        By virtual work the transposes map the ends' radial displacements to the bushing's screw.
        """
        across = np.eye(3) - np.outer(self.axis, self.axis)
        half = self.length / 2.0
        tilt = -skew(self.axis)
        return np.stack(
            [np.hstack([across / 2.0, sign * tilt / (2.0 * half)]) for sign in (1.0, -1.0)]
        )
