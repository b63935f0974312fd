"""A joint's axis that is not where the drawing has it."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.law import Contribution, Law, Situation, SIValues
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.places import cross_axes

SHIFTS = {
    "joint_1": "uvw",
    "joint_2": "uv",
    "joint_3": "uv",
    "joint_4": "uv",
    "joint_5": "uvw",
}
"""Directions of a shift that reach the platform or a flange: a cylindrical joint takes up its own
axis.  joint_3's body on the motor's side, link_3, also slides along joint_4: its v is felt only
where a flange of joint_4 touches."""

TILTS = SHIFTS | {"joint_3": "u"}
"""Directions of a tilt that reach the platform: link_3 also turns about joint_4."""


class AxisMisalignment(Law):
    """Constant screw at O, fixed in the body on the motor's side of the joint.

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
            *(symmetric(f"shift_{axis}_um", 5000.0, 30.0) for axis in SHIFTS[place]),
            *(symmetric(f"tilt_{axis}_mdeg", 5000.0, 50.0) for axis in TILTS[place]),
        )

    def as_drawn(self, geometry: Geometry, place: str) -> Array:
        """Return the scatter at O of bores that are drawn where they are: a tilt shifts there."""
        shift, *_, tilt = (each.scale for each in self.parameters(place))
        lever = geometry.bushings[place].radius * np.radians(1e-3 * tilt) / (1e-6 * shift)
        at_o = np.eye(6)
        at_o[1, 3], at_o[0, 4] = lever, -lever
        felt = ["uvw".index(axis) for axis in SHIFTS[place]]
        felt += [3 + "uvw".index(axis) for axis in TILTS[place]]
        return (at_o @ at_o.T)[np.ix_(felt, felt)]

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the screw, turned with its body."""
        axes = cross_axes(at.table.geometry, place)
        shift, tilt = (
            np.array([values[f"{kind}_{axis}_{unit}"] for axis in felt]) @ axes[: len(felt)]
            for kind, felt, unit in (("shift", SHIFTS[place], "um"), ("tilt", TILTS[place], "mdeg"))
        )
        return at.screw(place, np.concatenate([shift, tilt]))
