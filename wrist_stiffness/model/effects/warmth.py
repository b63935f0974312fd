"""What warmth does: parts grow and bushings soften.

A part's temperature is measured, or a first-order lag behind ambient and motor heat.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.influence import LIMB_1
from wrist_stiffness.model.columns import Recipe, tangents
from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.memory import lagged
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.places import bushing_centre

LAG = Parameter("lag_s", 0.0, 1e5, 600.0, 600.0, linear=False, grid=(0.0, 200.0, 1200.0))
SHARE = Parameter("motor_share_percent", 0.0, 100.0, 30.0, linear=False, grid=(0.0, 100.0))
WARMTH = (LAG, SHARE)
"""Time constant of a part without a thermometer, 0 for none; and how far its limb's motor (for the
frame and the platform motor 1) rather than ambient decides where its temperature goes."""


def unused(place: str, signals: frozenset[str]) -> tuple[str, ...]:
    """Return those of `WARMTH` that do nothing: all where the part has its own thermometer."""
    return tuple(each.key for each in WARMTH) if place in signals else ()


def warmth(at: Situation, place: str, values: SIValues, state: Any) -> tuple[Array, Any]:
    """Return the temperature of a part above reference.

    `at`: n samples.  `place`: the part; its own thermometer is believed as it is.  `values`: with
    `WARMTH`, in SI units.  `state`: what the call before returned.  Gives (n,) [K].  Raises
    `MissingSignalError` if neither the part nor what it follows has a thermometer.
    """
    if place in at.block.temperatures:
        return at.temperature(place), None
    share = values[SHARE.key]
    source = np.zeros(len(at.block))
    if share < 1.0:
        source += (1.0 - share) * at.temperature("ambient")
    if share > 0.0:
        first = place in (*LIMB_1, "frame", "platform")
        source += share * at.temperature("motor_1" if first else "motor_2")
    slow, state = lagged(at.block.time, source[:, None], values[LAG.key], state)
    return slow[:, 0], state


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

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
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


class ThermalSoftening(Law):
    """Flexibility grows with the temperature above reference."""

    id = "thermal_softening"
    stage = "reaction"
    places = JOINTS
    sentence = "the bushing of {place} softens as it warms"
    check = "repeat one loaded pose cold and warm"
    signals = ("temperature of the joint, or ambient, or its motor",)
    excited_by = "the same loads at temperatures at least 5 K apart"
    own = (Parameter("softening_percent_per_K", -5.0, 100.0, 1.0), *WARMTH)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return tangents, on a grid of how the part warms where no thermometer says it."""
        return tangents(self.own, unused(place, signals))

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the further screw."""
        warm, state = warmth(at, place, values, state)
        return at.elastic_share(place, values["softening_percent_per_K"] * warm), state
