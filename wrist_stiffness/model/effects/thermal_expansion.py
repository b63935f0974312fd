"""Growth of a part against the reference temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.columns import Recipe, tangents
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.places import bushing_centre
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.warmth import WARMTH, unused, warmth


class ThermalExpansion(Law):
    """The part grows alike in all directions, so its far side is shifted and not turned.

    A link grows from its motor-side bore to the other; the frame from O to both motors' bushings;
    the plate with tool and target from O, where the joints hold the platform, to its centre.
    """

    id = "thermal_expansion"
    stage = "geometry"
    places = ("link_1", "link_2", "frame", "platform")
    sentence = "{place} grows as it warms"
    check = "measure one unloaded pose cold and after warm-up; feel or measure the part's warmth"
    signals = ("temperature of the part, or ambient, or its motor",)
    excited_by = "unloaded returns to one pose from cold to warm"
    inexactness = 0.03

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the coefficient of expansion and how the part warms."""
        mean = {"platform": 23.0}.get(place, 11.5)
        return (Parameter("expansion_ppm_per_K", 0.0, 30000.0, 5.0, mean=mean), *WARMTH)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return tangents, on a grid of how the part warms where no thermometer says it."""
        return tangents(self.parameters(place), unused(place, signals))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the shift of the far side."""
        warm, state = warmth(at, place, values, state)
        growth = values["expansion_ppm_per_K"] * warm
        if place == "frame":
            limbs = {
                limb: np.outer(growth, _shift(bushing_centre(at.table.geometry, joint)))
                for limb, joint in (("limb_1", "joint_1"), ("limb_2", "joint_5"))
            }
            return Contribution(**limbs), state
        reach = _reach(at.table.geometry, place)
        return at.screw(place, np.outer(growth, _shift(reach))), state


def _reach(geometry: Geometry, place: str) -> Array:
    if place == "platform":
        return geometry.platform.centre
    motor_side, platform_side = geometry.link_ends(place)
    return geometry.links[place].arc_radius * (platform_side - motor_side)


def _shift(vector: Array) -> Array:
    return np.concatenate([vector, np.zeros(3)])
