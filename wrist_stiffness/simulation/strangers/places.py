"""Strangers that are somewhere: a cable meets a stop, a bearing has a dent, a gear is worn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import Bending, Law, at_component
from wrist_stiffness.simulation.seat import Seat


@dataclass(frozen=True)
class CableStop(Law):
    """Beyond a tilt to one side something soft touches the platform's rim."""

    stiffness: float  # [N/m]
    rim: Array  # (3,), point of the rim in U that is touched [m]
    side: Array  # (3,), direction in F out of the stop, unit vector
    depth: float  # coordinate of the rim along `side` below which it is touched [m]

    def wrench(self, block: Block) -> Array:
        """Push along `side`, more and more as the cable bunches."""
        at = block.configuration.platform @ self.rim
        dip = np.maximum(self.depth - at @ self.side, 0.0)
        force = (self.stiffness * dip**1.5 / np.sqrt(1e-3))[:, None] * self.side
        return np.concatenate([force, cross(at, force)], axis=-1)


@dataclass(frozen=True)
class Dent(Law):
    """A dent or a chip lifts the pin over a few degrees of a passive joint's turn."""

    joint: str  # passive joint
    seat: Seat
    lift: Array  # (3,), radial and tilting motion, as a translation at the outer ring [m]
    # `at`, `width`: place and width on the turn from home [rad]
    at: float
    width: float

    def screws(self, block: Block) -> Array:
        """Lift where the dent passes."""
        turn = joint_turn(block, self.joint, self.seat.axis)
        shape = np.exp(-0.5 * ((turn - self.at) / self.width) ** 2)
        home = self.lift @ self.seat.rings[0]
        screw = shape[:, None] * (self.seat.to_origin(block.rotation(self.joint)) @ home)
        return at_component(block, self.joint, screw)


@dataclass(frozen=True)
class WornSector(Bending):
    """Motor's gear: soft under torque only at the motor angles where its teeth are worn.

    Thinner teeth bend more; the link turns on with the torque through its driven joint.
    """

    component: str  # the driven joint
    column: int  # number of its motor
    axis: Array  # (3,), motor axis in F
    softness: float  # turn per torque in the middle of the worn sector [rad/(N m)]
    # `at`, `width`: place and width of the sector on the motor's angle [rad]
    at: float
    width: float

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Turn about the motor axis."""
        about = np.concatenate([np.zeros(3), self.axis])
        theta = block.configuration.theta[:, self.column]
        soft = self.softness * np.exp(-0.5 * ((theta - self.at) / self.width) ** 2)
        turn = (soft * (wrench @ about))[:, None] * about
        return turn, soft[:, None, None] * np.outer(about, about)
