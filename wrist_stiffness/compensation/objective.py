"""What the two motors shall make right: pointing, orientation or the place of a tool point.

Two motors cannot cancel six components.  An objective is a matrix that takes from the platform's
residual twist what counts; the motors cancel that part as far as J reaches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.vectors import IDENTITY, skew

DEPENDENT = 1e-6
"""The motors' columns of the task are dependent below this ratio of their singular values."""

ObjectiveName = Literal["pointing", "orientation", "tool_point"]
OBJECTIVES: tuple[ObjectiveName, ...] = ("pointing", "orientation", "tool_point")


@dataclass(frozen=True)
class Objective:
    """What to make right."""

    # `pointing` (the normal's direction, two components, both cancellable), `orientation` (three,
    # in the least-squares sense) or `tool_point` (three, in the least-squares sense)
    name: ObjectiveName
    normal: Array  # (3,), platform normal in U
    tool_point: Array  # (3,), in U [m]

    def matrix(self, configuration: Configuration) -> Array:
        """Return the matrix from a residual twist at O in F to the task error, (3, 6)."""
        matrix = np.zeros((3, 6))
        if self.name == "tool_point":
            matrix[:, :3] = IDENTITY
            matrix[:, 3:] = skew(-configuration.platform.dot(self.tool_point))
        else:
            matrix[:, 3:] = IDENTITY
        if self.name == "pointing":
            # Turns about the normal do not count.
            normal = configuration.platform.dot(self.normal)
            matrix[:, 3:] -= normal[:, None] * normal
        return matrix

    def cancelling(self, configuration: Configuration, jacobian: Array) -> Array:
        """Return the matrix from a residual twist at O in F to the motor angles that cancel it.

        `jacobian` (3, 2): of the platform's angular velocity there.  Gives (2, 6): (M J)^+ M with
        the task's `matrix` M and the twists J of the motors, for the least squares; no motion where
        the motors do not reach the task.
        """
        matrix = self.matrix(configuration)
        return pseudo_inverse(matrix[:, 3:].dot(jacobian)).dot(matrix)


def pseudo_inverse(columns: Array) -> Array:
    """Return the pseudo-inverse (2, n) of two columns (n, 2)."""
    (first, product), (_, second) = columns.T.dot(columns).tolist()
    determinant = first * second - product * product
    if determinant <= (DEPENDENT * max(first, second)) ** 2:
        return np.asarray(np.linalg.pinv(columns), dtype=float)
    inverse = np.array([[second, -product], [-product, first]])
    inverse /= determinant
    result: Array = inverse.dot(columns.T)
    return result
