"""The wrist as a URDF, for viewers: what moves with what, and about which axes.

All axes pass through O, so every link's frame is F at home and all joints lie at the origin.  A
URDF is a tree: joint_3, which closes the loop between link_3 and the platform, is left out.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from wrist_stiffness.mechanism.components import LINKS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.vectors import frame_about, triad
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME

FRAMES = {
    "frame": BASE_FRAME,
    "link_1": "wrist_link_1",
    "link_2": "wrist_link_2",
    "link_3": "wrist_link_3",
    "platform": PLATFORM_FRAME,
}
"""Name of the link and of its frame, by body."""

TREE = (
    ("motor_1", "frame", "link_1", "joint_1"),
    ("joint_2", "link_1", "platform", "joint_2"),
    ("motor_2", "frame", "link_2", "joint_5"),
    ("joint_4", "link_2", "link_3", "joint_4"),
)
"""Joint, parent, child, and the home axis about which it turns."""

SEGMENTS = 8
"""Cylinders that a link's arc is drawn with."""


def urdf(geometry: Geometry, motors: tuple[str, str]) -> str:
    """Return the URDF of a wrist.

    `motors`: names of the motors' joints.  Gives XML; lengths in m.  Effort and speed of the
    motors, which a URDF must state, are not known and zero.
    """
    robot = ElementTree.Element("robot", name=geometry.name)
    for body, frame in FRAMES.items():
        link = ElementTree.SubElement(robot, "link", name=frame)
        if body in LINKS:
            _draw_arc(link, geometry, body)
        elif body == "platform":
            plate = geometry.platform
            _cylinder(link, plate.centre, plate.normal, 0.5 * plate.diameter, plate.thickness)
    names = dict(zip(("motor_1", "motor_2"), motors, strict=True))
    for joint, parent, child, axis in TREE:
        kind = "revolute" if joint in names else "continuous"
        name = names.get(joint, f"wrist_{joint}")
        element = ElementTree.SubElement(robot, "joint", name=name, type=kind)
        ElementTree.SubElement(element, "parent", link=FRAMES[parent])
        ElementTree.SubElement(element, "child", link=FRAMES[child])
        ElementTree.SubElement(element, "axis", xyz=_text(geometry.axes[axis]))
        if joint in names:
            at = int(joint[-1]) - 1
            lower, upper = geometry.limits.joint_lower[at], geometry.limits.joint_upper[at]
            limits = {"lower": f"{lower:.9g}", "upper": f"{upper:.9g}"}
            ElementTree.SubElement(element, "limit", limits, effort="0", velocity="0")
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True)


def _draw_arc(element: ElementTree.Element, geometry: Geometry, link: str) -> None:
    start, end = geometry.link_ends(link)
    turns = Slerp([0.0, 1.0], Rotation.from_matrix([triad(start, end), triad(end, -start)]))
    dimensions = geometry.links[link]
    arc = turns(np.linspace(0.0, 1.0, SEGMENTS + 1)).as_matrix()[:, :, 0]
    points = dimensions.arc_radius * arc
    for first, second in zip(points[:-1], points[1:], strict=True):
        along = second - first
        length = float(np.linalg.norm(along))
        radius = 0.5 * dimensions.section_radial
        _cylinder(element, 0.5 * (first + second), along / length, radius, length)


def _cylinder(
    element: ElementTree.Element, centre: Array, axis: Array, radius: float, length: float
) -> None:
    visual = ElementTree.SubElement(element, "visual")
    # It stands along its own z.
    upright = np.roll(frame_about(axis), -1, axis=1)
    turn = Rotation.from_matrix(upright).as_euler("xyz")
    ElementTree.SubElement(visual, "origin", xyz=_text(centre), rpy=_text(turn))
    shape = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(shape, "cylinder", radius=f"{radius:.9g}", length=f"{length:.9g}")


def _text(vector: Array) -> str:
    return " ".join(f"{number:.9g}" for number in vector)
