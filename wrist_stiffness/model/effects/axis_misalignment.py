"""A joint's axis that is not where the drawing has it."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS
from wrist_stiffness.mechanism.vectors import screws_to_origin
from wrist_stiffness.model.law import Contribution, Law, Situation, SIValues
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.places import bushing_centre, cross_axes

FELT = {
    "joint_1": "uvw",
    "joint_2": "uv",
    "joint_3": "uv",
    "joint_4": "uv",
    "joint_5": "uvw",
}
"""Directions of shift and tilt that reach the platform or a flange: a cylindrical joint takes up
what is along and about its own axis.  joint_3's body on the motor's side, link_3, also slides along
and turns about joint_4: a shift along v is felt only where a flange of joint_4 touches."""


class AxisMisalignment(Law):
    """Constant screw at the bushing, fixed in the body on the motor's side of the joint.

    A drawing limits where a bore is and how it is tilted there: at O, a tilt is a shift as well.

    w is the joint's axis at home, u is perpendicular to it and to the other axis of its link (the
    frame-side joints: to the next axis), v = w x u.
    """

    id = "axis_misalignment"
    stage = "geometry"
    places = JOINTS
    sentence = "the axis of {place} misses the centre or is tilted"
    check = "indicate the pin against its neighbours' axes on a coordinate measuring machine"
    excited_by = "poses all over the workspace, without load"
    constant = True
    smooth = False
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return shifts and tilts along and about the felt directions."""
        return (
            *(symmetric(f"shift_{axis}_um", 5000.0, 30.0) for axis in FELT[place]),
            *(symmetric(f"tilt_{axis}_mdeg", 5000.0, 50.0) for axis in FELT[place]),
        )

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the screw, turned with its body."""
        geometry, felt = at.table.geometry, FELT[place]
        axes = cross_axes(geometry, place)[: len(felt)]
        shift, tilt = (
            np.array([values[f"{kind}_{axis}_{unit}"] for axis in felt]) @ axes
            for kind, unit in (("shift", "um"), ("tilt", "mdeg"))
        )
        at_bore = np.concatenate([shift, tilt])
        return at.screw(place, screws_to_origin(bushing_centre(geometry, place)) @ at_bore)
