import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, PoseWithCovarianceStamped
from scipy.spatial.transform import Rotation
from std_msgs.msg import Bool

from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import save_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.ros.conversions import nanoseconds, pose_message_stamped, time_message
from wrist_stiffness.ros.model_monitor import ModelMonitor

SECOND = 1_000_000_000
THETA = np.array([0.1, -0.2])
DOWN = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
NAME = "model_monitor"
TOPIC = "/platform_pose_measured"
BASELINE = 50


def add_monitor(graph, model_path, **parameters):
    node = graph.add(
        ModelMonitor, model_file=str(model_path), baseline_samples=BASELINE, **parameters
    )
    for message_type, topic in (
        (PoseWithCovarianceStamped, "/model_residual"),
        (Bool, "/model_alarm"),
    ):
        graph.listen(message_type, topic)
        graph.connected(topic)
    graph.load(SECOND, DOWN)
    graph.joints("/joint_states", SECOND, THETA)
    graph.until(lambda: node.stream.loads.newest_ns == SECOND, "load")
    return node


@pytest.fixture
def monitor(graph, model_path):
    return add_monitor(graph, model_path)


def true_pose(model, move=0.0):
    prediction = model.predict(THETA, Load(DOWN))
    rotation, shift = prediction.motion
    return rotation @ prediction.configuration.platform, shift + move


def residuals(graph):
    return graph.heard["/model_residual"]


def send(graph, pose, count, start_ns=SECOND):
    wanted = len(residuals(graph)) + count
    for i in range(count):
        graph.publish(TOPIC, pose_message_stamped(start_ns + i, *pose))
    graph.until(lambda: len(residuals(graph)) >= wanted, f"{count} residuals")


def test_the_residual_is_measured_minus_predicted(graph, monitor, model):
    send(graph, true_pose(model, np.array([0.0, 0.0, 7e-6])), 1)
    message = residuals(graph)[0]
    assert nanoseconds(message.header.stamp) == SECOND
    assert message.header.frame_id == "wrist_base"
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    assert [place.x, place.y, place.z] == pytest.approx([0.0, 0.0, 7e-6], abs=1e-12)
    assert [turn.x, turn.y, turn.z] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_a_change_raises_the_alarm_and_a_warning(graph, monitor, model):
    send(graph, true_pose(model), BASELINE + 50)
    assert not any(message.data for message in graph.heard["/model_alarm"])
    send(graph, true_pose(model, np.array([0.0, 5e-6, 0.0])), 50, SECOND + SECOND // 100)
    graph.until(lambda: graph.heard["/model_alarm"][-1].data, "alarm")
    status, values = graph.status(NAME, lambda status, values: values["alarm"] == "true")
    assert status.level == status.WARN
    assert "residuals have changed" in status.message
    assert values["baseline"] == "learned"


def test_a_pose_with_covariance_says_what_is_not_measured(graph, model_path, model):
    add_monitor(graph, model_path, pose_type="PoseWithCovarianceStamped")
    rotation, position = true_pose(model)
    stamped = pose_message_stamped(SECOND, np.eye(3), position)
    message = PoseWithCovarianceStamped(header=stamped.header)
    message.pose.pose = stamped.pose
    message.pose.covariance = np.diag([1e-12] * 3 + [1e9] * 3).ravel()
    graph.publish(TOPIC, message)
    graph.until(lambda: residuals(graph), "residual")
    found = residuals(graph)[0].pose
    assert found.pose.orientation.w == 1.0
    assert found.covariance[35] > 1e8
    assert found.covariance[0] < 1e-9


def markers(model, pose, stamp_ns=SECOND, lost=()):
    rotation, position = pose
    points = model.table.geometry.platform.readout_points @ rotation.T + position
    points[list(lost)] = np.nan
    message = PoseArray(poses=[Pose(position=Point(x=x, y=y, z=z)) for x, y, z in points.tolist()])
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = "wrist_base"
    return message


def test_markers_give_a_residual_and_too_few_a_reason(graph, monitor, model):
    pose = true_pose(model, np.array([0.0, 0.0, 7e-6]))
    topic = "/platform_markers_measured"
    graph.publish(topic, markers(model, pose, lost=(0,)))
    graph.until(lambda: residuals(graph), "residual")
    place = residuals(graph)[0].pose.pose.position
    assert [place.x, place.y, place.z] == pytest.approx([0.0, 0.0, 7e-6], abs=1e-12)
    graph.publish(topic, markers(model, pose, lost=range(5)))
    _, values = graph.status(NAME, lambda status, values: "refused InputError" in values)
    assert "2 given; at least 3 needed" in values["last fault"]


def test_the_motion_of_the_frame_is_no_residual(graph, monitor, model):
    rotation, position = true_pose(model)
    far = np.array([0.2, 0.1, 0.0])
    turn, shift = Rotation.from_rotvec([0.0, 1e-3, 0.0]).as_matrix(), np.array([0.0, 3e-5, 0.0])
    for moved_turn, moved_shift in ((np.eye(3), np.zeros(3)), (turn, shift)):
        frame = pose_message_stamped(SECOND, moved_turn, moved_turn @ far + moved_shift)
        count = monitor.stream.frame.count
        graph.publish("/frame_pose_measured", frame)
        graph.until(lambda count=count: monitor.stream.frame.count > count, "frame pose")
        send(graph, (moved_turn @ rotation, moved_turn @ position + moved_shift), 1)
    for message in residuals(graph):
        place, turned = message.pose.pose.position, message.pose.pose.orientation
        assert [place.x, place.y, place.z] == pytest.approx([0.0] * 3, abs=1e-12)
        assert [turned.x, turned.y, turned.z] == pytest.approx([0.0] * 3, abs=1e-12)


@pytest.mark.parametrize(
    ("frame", "place", "stamp", "reason"),
    [
        ("tracker", 0.0, SECOND, "FrameError"),
        ("wrist_base", float("nan"), SECOND, "InputError"),
        ("wrist_base", 0.0, SECOND - 1, "InputError"),
        ("wrist_base", 0.0, 2 * SECOND, "InputError"),
    ],
    ids=["frame", "nan", "before any joint state", "long after"],
)
def test_a_bad_pose_gives_no_residual_and_a_reason(
    graph, monitor, model, frame, place, stamp, reason
):
    rotation, position = true_pose(model)
    message = pose_message_stamped(stamp, rotation, position + place)
    message.header.frame_id = frame
    graph.publish(TOPIC, message)
    _, values = graph.status(NAME, lambda status, values: f"refused {reason}" in values)
    assert values["samples"] == "0"


def test_a_quaternion_of_zeros_is_refused(graph, monitor):
    message = PoseStamped()
    message.header.frame_id = "wrist_base"
    message.header.stamp.sec = 1
    message.pose.orientation.w = 0.0
    graph.publish(TOPIC, message)
    _, values = graph.status(NAME, lambda status, values: values["last fault"])
    assert "norm 0" in values["last fault"]


def test_turning_is_seen_as_turning(graph, monitor, model):
    rotation, position = true_pose(model)
    turn = Rotation.from_rotvec([0.0, 2e-4, 0.0]).as_matrix()
    send(graph, (turn @ rotation, turn @ position), 1)
    assert residuals(graph)[0].pose.pose.orientation.y == pytest.approx(1e-4, rel=1e-6)


def test_an_effect_that_is_left_out_is_reported(graph, model, tmp_path):
    path = tmp_path / "warm.yaml"
    save_model(model.with_effects(Effect(find_law("thermal_expansion"), "link_1", {})), path)
    add_monitor(graph, path)
    send(graph, true_pose(model), 1)
    status, _ = graph.status(NAME, lambda status, values: "temperature" in status.message)
    assert status.level == status.WARN
