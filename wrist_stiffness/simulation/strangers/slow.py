"""Strangers that take their time: a bowing frame, a swaying carrier, swelling bushings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.law import Law, at_component


@dataclass(frozen=True)
class ThermalBow(Law):
    """The frame bows by the square of the difference in temperature between its two motors.

    Parameters
    ----------
    twist_per_kelvin : (6,) float
        Of the platform at a difference of 1 K [m, rad].
    """

    twist_per_kelvin: Array

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Move the platform with the frame."""
        kelvin = block.temperature_of("motor_1") - block.temperature_of("motor_2")
        return (kelvin * np.abs(kelvin))[:, None] * self.twist_per_kelvin


@dataclass(frozen=True)
class FloorTilt(Law):
    """The carrier sways: the platform's weight has a direction that wanders.

    Parameters
    ----------
    weight : float
        Of platform and tool [N].
    place : (3,) float
        Centre of gravity in U [m].
    sway : (2, 3) float
        Two rotation vectors of the sway [rad].
    periods_s : (2,) float
        [s].
    """

    weight: float
    place: Array
    sway: Array
    periods_s: Array

    def wrench(self, block: Block) -> Array:
        """Return the change of the weight."""
        waves = np.sin(2.0 * np.pi * block.time_s[:, None] / self.periods_s)
        down = np.array([0.0, 0.0, -self.weight])
        force = cross(waves @ self.sway, np.broadcast_to(down, (len(waves), 3)))
        at = block.configuration.platform @ self.place
        return np.concatenate([force, cross(at, force)], axis=-1)


@dataclass(frozen=True)
class Swelling(Law):
    """A bushing swells and dries with a humidity that nobody records.

    Parameters
    ----------
    joint : str
        Which one.
    screw : (6,) float
        At O with the wrist at home at 1 [m, rad].
    periods_s, phases : (k,) float
        Of the humidity's waves [s], [rad].
    """

    joint: str
    screw: Array
    periods_s: Array
    phases: Array

    def screws(self, block: Block) -> Array:
        """Follow the humidity."""
        angle = 2.0 * np.pi * block.time_s[:, None] / self.periods_s + self.phases
        wet = np.sin(angle).mean(axis=-1)
        turned = block_diagonal(block.rotation(self.joint)) @ self.screw
        return at_component(block, self.joint, wet[:, None] * turned)
