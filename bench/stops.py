"""Stops in the way of many true wrists: walls at the tool and holes that hold its direction.

Each wrist meets one stop, along one coordinate: how far the tool point has moved along a direction,
or the platform has turned about an axis, from where the command wants them.  Below `lowest` and
above `highest` a spring pushes back, along that coordinate and without friction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.simulation.equilibrium import Pose

PUSH_TOLERANCE = 1e-5
"""Error of the push relative to 1 N, or to 1/10 N m of a couple."""

MAX_STEPS = 12


@dataclass
class Stops:
    """One stop for each of n wrists.

    Parameters
    ----------
    along, about : (n, 3) float
        Unit direction in F of a wall and zero, or zero and the axis of a hole's couple.
    tool : (n, 3) float
        Tool point in U [m].
    wanted : (n, 3, 3) float
        Rotation U -> F from which the coordinate counts.
    lowest, highest : (n,) float
        Where the springs begin [m or rad]; infinite where there is none.
    stiffness : (n,) float
        [N/m or N m/rad].
    """

    along: Array
    about: Array
    tool: Array
    wanted: Array
    lowest: Array
    highest: Array
    stiffness: Array

    def __post_init__(self) -> None:
        """Begin without a push."""
        self._push = np.zeros(len(self.tool))
        # What a newton moves; learned from step to step.
        self._give = np.where(np.any(self.along, axis=1), 1e-5, 1e-2)

    def coordinate(self, rotation: Array, shift: Array) -> Array:
        """Return the coordinates (n,) of platforms at rotations U -> F (n, 3, 3), shifts (n, 3)."""
        moved = _apply(rotation - self.wanted, self.tool) + shift
        turned = log_motion(rotation @ np.swapaxes(self.wanted, -1, -2), shift)[:, 3:]
        return np.sum(self.along * moved, axis=1) + np.sum(self.about * turned, axis=1)

    def settle(
        self, table: Table, angles: Array, load: Array, there: NDArray[np.bool_]
    ) -> tuple[Array, Array, Array]:
        """Find wrists and stops in equilibrium.

        Parameters
        ----------
        table : Table
            The true wrist.
        angles : (n, 2) float
            True motor angles [rad].
        load : (n, 6) float
            At O in F beside the stop [N, N m].
        there : (n,) bool
            Whether the stop is in the way.

        Returns
        -------
        rotation, shift : (n, 3, 3), (n, 3) float
            Of the platforms, U -> F [m].
        wrench : (n, 6) float
            Of the stops on the platforms at O in F [N, N m].
        """
        configuration = table.mechanism.forward(angles)
        pose = Pose(configuration, table.components, table.geometry.gravity)
        screws = np.zeros((len(angles), len(ELASTIC), 6))
        arm = _apply(configuration.platform, self.tool)
        unit = np.concatenate([self.along, cross(arm, self.along) + self.about], axis=1)
        push, near = np.where(there, self._push, 0.0), None
        before: tuple[Array, Array] | None = None
        for _ in range(MAX_STEPS):
            near = pose.solve(load + push[:, None] * unit, screws, near=near)
            bent, shift = exp_twist(near.twist)
            rotation = bent @ configuration.platform
            place = self.coordinate(rotation, shift)
            if before is not None:
                step = push - before[0]
                clear = np.abs(step) > PUSH_TOLERANCE
                slope = (place - before[1]) / np.where(clear, step, 1.0)
                self._give = np.where(clear & (slope > 0.0), slope, self._give)
            wanted = np.where(there, self._answer(place - self._give * push), 0.0)
            if np.all(np.abs(wanted - push) <= PUSH_TOLERANCE):
                break
            before, push = (push, place), wanted
        self._push = push
        return rotation, shift, push[:, None] * unit

    def _answer(self, free: Array) -> Array:
        """Return the push at which springs and wrists meet, from the places without a push."""
        beyond = np.minimum(free - self.lowest, 0.0) + np.maximum(free - self.highest, 0.0)
        return -self.stiffness * beyond / (1.0 + self.stiffness * self._give)


def _apply(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])
