"""`thermal_expansion`: bodies grow as they warm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law, no_screws

Spot = tuple[str, Array]
"""Component, and how far its platform side moves per unit strain, at home in F [m]."""


@dataclass(frozen=True)
class ThermalExpansion(Law):
    """Uniform growth of one body; its bores and bearings move apart."""

    body: str  # link_1, link_2, frame or platform
    expansion: float  # coefficient [1/K]
    spots: tuple[Spot, ...]  # where the growth enters the limbs
    # growth of the coefficient itself [1/K]; polymers and composites are not linear
    quadratic: float

    def screws(self, block: Block) -> Array:
        """Move the spots with the body's temperature."""
        kelvin = block.temperature_of(self.body)
        strain = self.expansion * kelvin * (1.0 + self.quadratic * kelvin)
        out = no_screws(block)
        turn = block.configuration.rotations[self.body]
        for component, lever in self.spots:
            out[:, ELASTIC.index(component), :3] += strain[:, None] * (turn @ lever)
        return out


def growing_spots(geometry: Geometry, body: str) -> tuple[Spot, ...]:
    """Return where the growth of a body enters the limbs.

    The frame carries the bearings of both motors away from O; a link's bores move apart; on the
    platform the two bearings move away from the plate's centre, which is what the tool keeps.
    """
    at = {joint: b.radius * geometry.axes[joint] for joint, b in geometry.bushings.items()}
    if body == "frame":
        return tuple((joint, at[joint]) for joint in ("joint_1", "joint_5"))
    if body == "platform":
        centre = np.asarray(geometry.platform.centre)
        return tuple((joint, centre - at[joint]) for joint in ("joint_2", "joint_3"))
    near, far = geometry.link_ends(body)
    return ((body, geometry.links[body].arc_radius * (far - near)),)
