"""Names of the wrist's parts, and what an elastic part is to the mechanism.

The finite-element room makes `ElasticComponents` once; the mechanism only turns and assembles it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LINKS = ("link_1", "link_2", "link_3")
JOINTS = ("joint_1", "joint_2", "joint_3", "joint_4", "joint_5")
PASSIVE_JOINTS = ("joint_2", "joint_3", "joint_4")
MOTORS = ("motor_1", "motor_2")

ELASTIC = (*LINKS, *JOINTS)
"""The elastic components, in the order of every array with a component axis."""

CARRIER = {
    "link_1": "link_1",
    "link_2": "link_2",
    "link_3": "link_3",
    "joint_1": "frame",
    "joint_2": "link_1",
    "joint_3": "link_3",
    "joint_4": "link_2",
    "joint_5": "frame",
}
"""The body that a component turns with: a bushing sits on its pin, a motor's in the frame."""

ENDS = {
    "link_1": ("joint_1", "joint_2"),
    "link_2": ("joint_5", "joint_4"),
    "link_3": ("joint_4", "joint_3"),
}
"""The joints at the motor-side and at the platform-side bore of each link."""


@dataclass(frozen=True)
class FlangeContact:
    """Condensed one-sided contact of the flanges of one passive joint's bushing.

    A unit contact force of sector i pushes the hub away from the flange.  With W the wrench
    through the bushing (at O) and x the slide of the joint along its axis,

        delta = C W + screw @ force        gap = gap0 + sign * x + screw.T @ W + approach @ force

    Everything is at O in F with the wrist at home; it turns with the bushing's carrier.
    """

    # (m,), +1 where a positive slide opens the gap (flange on the motor side of the hub face along
    # the joint axis), -1 where it closes it
    sign: Array
    # (6, m), screw of the bushing for a unit contact force of each sector [m/N, rad/N]
    screw: Array
    # (m, m), opening of each gap by the unit forces, without the slide [m/N]; symmetric
    approach: Array
    # (m, 3), opening of each gap by a unit acceleration field on the bushing itself [m/(m/s^2)]
    weight_approach: Array
    gap: Array  # (m,), gap of the unloaded bushing with the slide at zero [m]


@dataclass(frozen=True)
class ContactSectors:
    """The sectors of all flanges in one row of m, joint after joint as in `PASSIVE_JOINTS`."""

    component: NDArray[np.intp]  # (m,), number in `ELASTIC` of the bushing that a sector belongs to
    slide: Array  # (m, 3), opening of each gap for a unit slide of joint_2, joint_3 and joint_4
    # (m, 6), screw of the bushing for a unit contact force of each sector [m/N, rad/N]
    screw: Array
    # (m, m), opening of the gaps by unit forces without the slides, zero between joints [m/N]
    approach: Array
    # (m, 3), opening by a unit acceleration field on the bushing itself [m/(m/s^2)]
    weight_approach: Array
    gap: Array  # (m,), gap of the unloaded bushings with the slides at zero [m]


@dataclass(frozen=True)
class ElasticComponents:
    """All elastic parts, condensed onto rigid interface frames, at O in F, the wrist at home."""

    # (8, 6, 6), screw of the platform side against the motor side for a unit wrench at O, in the
    # order of `ELASTIC`; symmetric positive definite [m/N, rad/N, rad/(N m)]
    flexibility: Array
    # `weight_motor_side`, `weight_platform_side`: (8, 6, 3), wrench at O for a unit acceleration
    # field along x, y, z of the body, condensed consistently onto the two interface frames
    # [N/(m/s^2), N m/(m/s^2)]; their sum is the part's weight
    weight_motor_side: Array
    weight_platform_side: Array
    platform_weight: Array  # (6, 3), the same for the rigid platform
    # flange contact by passive joint; a joint without flanges is absent
    contact: dict[str, FlangeContact]
    # (8, 12, 12), of each part, condensed onto its motor-side and its platform-side frame; only the
    # natural modes need it, a table of an older version has none [kg, kg m, kg m^2]
    mass: Array | None = None

    @cached_property
    def sectors(self) -> ContactSectors:
        """All flange sectors stacked."""
        joints = [joint for joint in PASSIVE_JOINTS if joint in self.contact]
        sizes = [len(self.contact[joint].gap) for joint in joints]
        m = sum(sizes)
        slide, screw, weight = np.zeros((m, 3)), np.zeros((m, 6)), np.zeros((m, 3))
        component, approach, gap = np.zeros(m, dtype=np.intp), np.zeros((m, m)), np.zeros(m)
        start = 0
        for joint, size in zip(joints, sizes, strict=True):
            part, rows = self.contact[joint], slice(start, start + size)
            component[rows] = ELASTIC.index(joint)
            slide[rows, PASSIVE_JOINTS.index(joint)] = part.sign
            screw[rows], weight[rows], gap[rows] = part.screw.T, part.weight_approach, part.gap
            approach[rows, rows] = part.approach
            start += size
        return ContactSectors(component, slide, screw, approach, weight, gap)
