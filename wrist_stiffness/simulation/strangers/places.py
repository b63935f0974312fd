"""Strangers that are somewhere: a cable that meets a stop, a dent in a bearing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.joint_friction import BODIES_JOINED
from wrist_stiffness.simulation.laws.law import Law, at_component
from wrist_stiffness.simulation.seat import Seat


@dataclass(frozen=True)
class CableStop(Law):
    """Beyond a tilt to one side something soft touches the platform's rim.

    Parameters
    ----------
    stiffness : float
        [N/m].
    rim : (3,) float
        Point of the rim in U that is touched [m].
    side : (3,) float
        Direction in F out of the stop, unit vector.
    depth : float
        Coordinate of the rim along `side` below which it is touched [m].
    """

    stiffness: float
    rim: Array
    side: Array
    depth: float

    def wrench(self, block: Block) -> Array:
        """Push along `side`, more and more as the cable bunches."""
        at = block.configuration.platform @ self.rim
        dip = np.maximum(self.depth - at @ self.side, 0.0)
        force = (self.stiffness * dip**1.5 / np.sqrt(1e-3))[:, None] * self.side
        return np.concatenate([force, cross(at, force)], axis=-1)


@dataclass(frozen=True)
class Dent(Law):
    """A dent or a chip lifts the pin over a few degrees of a passive joint's turn.

    Parameters
    ----------
    joint : str
        Passive joint.
    seat : Seat
        Of its bushing.
    lift : (3,) float
        Radial and tilting motion, as a translation at the outer ring [m].
    at, width : float
        Place and width on the turn from home [rad].
    """

    joint: str
    seat: Seat
    lift: Array
    at: float
    width: float

    def screws(self, block: Block) -> Array:
        """Lift where the dent passes."""
        inner, outer = BODIES_JOINED[self.joint]
        bodies = block.configuration.rotations
        relative = np.swapaxes(bodies[inner], -1, -2) @ bodies[outer]
        across = np.linalg.svd(self.seat.axis[None])[2][1]
        turned = relative @ across
        turn = np.arctan2(turned @ np.cross(self.seat.axis, across), turned @ across)
        shape = np.exp(-0.5 * ((turn - self.at) / self.width) ** 2)
        home = self.lift @ self.seat.rings[0]
        screw = shape[:, None] * (self.seat.to_origin(block.rotation(self.joint)) @ home)
        return at_component(block, self.joint, screw)
