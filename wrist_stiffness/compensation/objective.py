"""What the two motors shall make right: pointing, orientation or the place of a tool point.

Two motors cannot cancel six components.  An objective is a matrix that takes from the platform's
residual twist what counts; the motors cancel that part as far as J reaches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import Configuration
from wrist_stiffness.mechanism.vectors import skew, triad

ObjectiveName = Literal["pointing", "orientation", "tool_point"]
OBJECTIVES: tuple[ObjectiveName, ...] = ("pointing", "orientation", "tool_point")


@dataclass(frozen=True)
class Objective:
    """What to make right.

    Parameters
    ----------
    name : str
        `pointing` (the normal's direction, two components, both cancellable), `orientation` (three,
        in the least-squares sense) or `tool_point` (three, in the least-squares sense).
    normal : (3,) float
        Platform normal in U.
    tool_point : (3,) float
        In U [m].
    """

    name: ObjectiveName
    normal: Array
    tool_point: Array

    def matrix(self, configuration: Configuration) -> Array:
        """Return the matrix from a residual twist at O in F to the task error, (2 or 3, 6)."""
        if self.name == "tool_point":
            point = configuration.platform @ self.tool_point
            return np.hstack([np.eye(3), -skew(point)])
        rotation = np.eye(3)
        if self.name == "pointing":
            normal = configuration.platform @ self.normal
            start = np.eye(3)[np.argmin(np.abs(normal))]
            rotation = triad(normal, start)[:, 1:].T
        return np.hstack([np.zeros_like(rotation), rotation])
