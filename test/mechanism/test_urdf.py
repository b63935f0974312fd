"""The URDF, read as a viewer reads it, against the wrist's own kinematics."""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.configuration import BODIES
from wrist_stiffness.mechanism.urdf import FRAMES, urdf

DIGITS = 1e-8  # of the text


def numbers(text):
    return np.array([float(part) for part in text.split()])


def axes_and_parents(root):
    """Return joint name, parent and axis by child link."""
    return {
        joint.find("child").get("link"): (
            joint.get("name"),
            joint.find("parent").get("link"),
            numbers(joint.find("axis").get("xyz")),
        )
        for joint in root.iter("joint")
    }


@pytest.mark.parametrize("theta", [(0.0, 0.0), (0.4, -0.3), (-0.5, 0.6)])
def test_bodies_are_where_the_joints_of_the_urdf_put_them(table, theta):
    """Motors turn by their angles; each passive joint by some angle about its axis alone."""
    root = ElementTree.fromstring(urdf(table.geometry, ("left_1", "left_2")))
    joints = axes_and_parents(root)
    configuration = table.mechanism.forward(np.array(theta))
    turned = zip(BODIES, configuration.bodies, strict=True)
    rotations = {FRAMES[body]: Rotation.from_matrix(matrix) for body, matrix in turned}
    assert set(joints) | {"wrist_base"} == {link.get("name") for link in root.iter("link")}
    for child, (name, parent, axis) in joints.items():
        turn = (rotations[parent].inv() * rotations[child]).as_rotvec()
        assert np.linalg.norm(np.cross(turn, axis)) < DIGITS
        if name.startswith("left_"):
            assert turn @ axis == pytest.approx(theta[int(name[-1]) - 1], abs=DIGITS)
    # The joint that is left out closes the loop: both bodies carry its axis.
    home = table.geometry.axes["joint_3"]
    ends = [rotations[FRAMES[body]].apply(home) for body in ("link_3", "platform")]
    assert ends[0] == pytest.approx(ends[1], abs=DIGITS)


def test_links_are_drawn_from_joint_to_joint_and_motors_have_their_limits(table):
    root = ElementTree.fromstring(urdf(table.geometry, ("m1", "m2")))
    for link in ("link_1", "link_2", "link_3"):
        (element,) = (each for each in root.iter("link") if each.get("name") == FRAMES[link])
        radius = table.geometry.links[link].arc_radius
        ends = []
        for visual in element.iter("visual"):
            origin, shape = visual.find("origin"), visual.find("geometry/cylinder")
            along = Rotation.from_euler("xyz", numbers(origin.get("rpy"))).as_matrix()[:, 2]
            half = 0.5 * float(shape.get("length")) * along
            ends += [numbers(origin.get("xyz")) + half, numbers(origin.get("xyz")) - half]
        assert np.linalg.norm(ends, axis=1) == pytest.approx(radius, abs=DIGITS)
        for bore in table.geometry.link_ends(link):
            assert np.linalg.norm(ends - radius * bore, axis=1).min() < DIGITS
    limits = table.geometry.limits
    motors = {joint.get("name"): joint.find("limit") for joint in root.iter("joint")}
    for i, name in enumerate(("m1", "m2")):
        assert float(motors[name].get("lower")) == pytest.approx(limits.joint_lower[i], abs=DIGITS)
        assert float(motors[name].get("upper")) == pytest.approx(limits.joint_upper[i], abs=DIGITS)
