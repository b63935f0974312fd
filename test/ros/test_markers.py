from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from wrist_stiffness.commands.wrist_drawing import WristDrawing
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.messages import MarkerArray as Drawn
from wrist_stiffness.ros.conversions import body_transforms
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor
from wrist_stiffness.ros.qos import STATE_QOS

SECOND = 1_000_000_000
DOWN = Load(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))


def place(point):
    return np.array([point.x, point.y, point.z])


@pytest.fixture
def drawn(model):
    prediction = model.predict(np.array([0.4, -0.3]), DOWN)
    drawing = WristDrawing(model.table.geometry, 500.0)
    one = np.array([SECOND]), prediction.configuration.as_block, prediction.twist[None]
    (payload,) = drawing.payloads(*one)
    return prediction, {marker.ns: marker for marker in decode(Drawn, payload).markers}


def test_links_run_from_joint_to_joint(drawn, model):
    prediction, markers = drawn
    mechanism, at = model.table.mechanism, prediction.configuration
    ends = {"link_1": (mechanism.a1, at.b), "link_2": (mechanism.a2, at.d), "link_3": (at.d, at.c)}
    for link, (start, end) in ends.items():
        radius = model.table.geometry.links[link].arc_radius
        points = np.array([place(point) for point in markers[link].points])
        assert np.allclose(np.linalg.norm(points, axis=1), radius)
        assert np.allclose(np.abs(points[0] @ start), radius)
        assert np.allclose(np.abs(points[-1] @ end), radius)


def test_the_platform_lies_below_o_and_is_moved_by_the_exaggerated_error(drawn, model):
    prediction, markers = drawn
    centre, normal = model.table.geometry.platform.centre, model.table.geometry.platform.normal
    rigid, actual = markers["platform rigid"], markers["platform"]
    assert np.allclose(place(rigid.pose.position), prediction.configuration.platform @ centre)
    q = rigid.pose.orientation
    stands = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()[:, 2]
    assert np.allclose(stands, prediction.configuration.platform @ normal)
    moved = place(actual.pose.position) - place(rigid.pose.position)
    arm = prediction.configuration.platform @ centre
    wanted = 500.0 * (prediction.twist[:3] + np.cross(prediction.twist[3:], arm))
    # A drawn angle of 0.1 rad leaves first order by a twentieth.
    assert np.linalg.norm(moved - wanted) < 0.1 * np.linalg.norm(wanted)


def test_arrow_and_legend_show_the_shift(drawn):
    prediction, markers = drawn
    tip = place(markers["shift of O"].points[1])
    shift = prediction.twist[:3]
    assert np.linalg.norm(tip - 500.0 * shift) < 0.1 * np.linalg.norm(500.0 * shift)
    assert "x 500" in markers["legend"].text
    assert f"{1e6 * prediction.shift_norm:.2f} um" in markers["legend"].text


def test_the_predictor_draws_at_its_rate(graph, model_path):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path), marker_rate_hz=10.0)
    graph.listen(MarkerArray, "/wrist_markers")
    graph.connected("/wrist_markers")
    graph.load(SECOND)
    graph.until(lambda: node.stream.loads.newest_ns == SECOND, "load")
    for i in range(50):
        graph.joints("/joint_states", SECOND + i * SECOND // 100)
    graph.until(lambda: len(graph.heard["/wrist_markers"]) == 5, "five pictures")
    marker = graph.heard["/wrist_markers"][0].markers[0]
    assert marker.header.frame_id == "wrist_base"
    assert marker.action == Marker.ADD


def test_transforms_and_description_name_the_same_bodies(graph, model, model_path):
    """A viewer draws each link of the URDF where its transform says."""
    heard = []
    graph.probe.create_subscription(String, "/robot_description", heard.append, STATE_QOS)
    graph.add(PoseErrorPredictor, model_file=str(model_path))
    graph.until(lambda: heard, "description")
    links = {link.get("name") for link in ElementTree.fromstring(heard[0].data).iter("link")}
    configuration = model.predict(np.array([0.2, -0.4]), Load(np.zeros(6))).configuration
    transforms = body_transforms(7, configuration)
    assert {each.child_frame_id for each in transforms} | {"wrist_base"} == links
    prefixed = body_transforms(7, configuration, "left/")
    children = {each.child_frame_id for each in prefixed}
    assert children | {"left/wrist_base"} == {f"left/{link}" for link in links}
    assert {each.header.frame_id for each in prefixed} == {"left/wrist_base"}
    (platform,) = (each for each in transforms if each.child_frame_id == "wrist_platform")
    turn = platform.transform.rotation
    found = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    assert found == pytest.approx(configuration.platform, abs=1e-12)
