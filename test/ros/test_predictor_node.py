import time
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, Vector3Stamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import save_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.ros.conversions import nanoseconds, three, time_message
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor

SECOND = 1_000_000_000
THETA = (0.1, -0.2)
DOWN = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
NAME = "pose_error_predictor"
NAMES = ("motor_1_joint", "motor_2_joint")


@pytest.fixture
def predictor(graph, model_path):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path))
    for message_type, topic in (
        (PoseWithCovarianceStamped, "/pose_error_predicted"),
        (Vector3Stamped, "/pose_error/s_um"),
        (Vector3Stamped, "/pose_error/phi_mdeg"),
    ):
        graph.listen(message_type, topic)
        graph.connected(topic)
    return node


def predictions(graph):
    return graph.heard["/pose_error_predicted"]


def wait_for_predictions(graph, count):
    graph.until(lambda: len(predictions(graph)) >= count, f"prediction {count}")


def wait_for_load(graph, predictor, stamp_ns):
    graph.until(lambda: predictor.stream.loads.newest_ns == stamp_ns, "load")


def numbers(message):
    pose = message.pose.pose
    p, q = pose.position, pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def expected(model, theta=THETA, wrench=DOWN):
    twist = model.predict(np.array(theta), Load(np.array(wrench))).twist
    return np.concatenate(pose_of_twist(twist)).tolist()


def test_frames_have_the_prefix_of_their_wrist(graph, model_path):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path), frame_prefix="left/")
    topics = {
        "/pose_error_predicted": PoseWithCovarianceStamped,
        "/pose_error/s_um": Vector3Stamped,
        "/wrist_markers": MarkerArray,
    }
    for topic, message_type in topics.items():
        graph.listen(message_type, topic)
        graph.connected(topic)
    graph.load(SECOND, frame_id="left/wrist_base")
    wait_for_load(graph, node, SECOND)
    graph.joints("/joint_states", SECOND)
    graph.until(lambda: all(graph.heard[topic] for topic in topics), "answers")
    first, second, markers = (graph.heard[topic][0] for topic in topics)
    frames = {each.header.frame_id for each in (first, second, *markers.markers)}
    assert frames == {"left/wrist_base"}


def test_publishes_what_the_model_predicts_to_the_bit(graph, predictor, model):
    graph.load(SECOND)
    wait_for_load(graph, predictor, SECOND)
    # Another joint in between, motors in the other order.
    graph.joints(
        "/joint_states", SECOND + 7, (THETA[1], 9.0, THETA[0]), (NAMES[1], "gripper", NAMES[0])
    )
    wait_for_predictions(graph, 1)
    message = predictions(graph)[0]
    prediction = model.predict(np.array(THETA), Load(np.array(DOWN)))
    assert nanoseconds(message.header.stamp) == SECOND + 7
    assert message.header.frame_id == "wrist_base"
    assert numbers(message) == expected(model)
    assert message.pose.covariance.tolist() == prediction.covariance.ravel().tolist()
    graph.until(lambda: graph.heard["/pose_error/phi_mdeg"], "phi")
    for topic, wanted in (
        ("/pose_error/s_um", 1e6 * prediction.twist[:3]),
        ("/pose_error/phi_mdeg", 1e3 * np.degrees(prediction.twist[3:])),
    ):
        shown = graph.heard[topic][0]
        assert nanoseconds(shown.header.stamp) == SECOND + 7
        assert three(shown.vector) == pytest.approx(wanted.tolist())


BAD_JOINTS = {
    "missing": ((0.1,), NAMES[:1], "InputError"),
    "duplicated": ((0.1, 0.2, 0.3), (*NAMES, NAMES[0]), "InputError"),
    "nan": ((float("nan"), 0.0), NAMES, "InputError"),
    "infinite": ((0.0, float("inf")), NAMES, "InputError"),
    "too few positions": ((0.1,), NAMES, "InputError"),
    "out of the domain": ((2.0, 0.0), NAMES, "UnreachablePoseError"),
}


@pytest.mark.parametrize(("theta", "names", "reason"), BAD_JOINTS.values(), ids=BAD_JOINTS)
def test_a_bad_joint_state_gives_no_prediction_and_a_reason(
    graph, predictor, model, theta, names, reason
):
    graph.load(SECOND)
    wait_for_load(graph, predictor, SECOND)
    graph.joints("/joint_states", SECOND + 1, theta, names)
    graph.joints("/joint_states", SECOND + 2, THETA)
    wait_for_predictions(graph, 1)
    assert nanoseconds(predictions(graph)[0].header.stamp) == SECOND + 2
    _, values = graph.status(NAME, lambda status, values: f"refused {reason}" in values)
    assert values[f"refused {reason}"] == "1"
    assert values["samples"] == "1"


BAD_LOADS = {
    "wrong frame": (DOWN, "tool0", "FrameError", "StaleLoadError"),
    "nan": ((0, 0, float("nan"), 0, 0, 0), "wrist_base", "InputError", "StaleLoadError"),
    "beyond range": ((0, 0, -9.0, 0, 0, 0), "wrist_base", "LoadRangeError", "LoadRangeError"),
}


@pytest.mark.parametrize(("wrench", "frame", "reason", "then"), BAD_LOADS.values(), ids=BAD_LOADS)
def test_a_bad_load_gives_no_prediction_and_a_reason(graph, predictor, wrench, frame, reason, then):
    graph.load(SECOND, wrench, frame)
    graph.until(
        lambda: predictor.stream.loads.newest_ns or predictor.health.faults, "answer to the load"
    )
    graph.joints("/joint_states", SECOND + 1)
    graph.status(NAME, lambda status, values: f"refused {reason}" in values)
    _, values = graph.status(NAME, lambda status, values: f"refused {then}" in values)
    assert values["samples"] == "0"
    assert predictions(graph) == []


def test_a_silent_load_stops_the_predictions_after_the_age_limit(graph, predictor):
    graph.load(SECOND)
    wait_for_load(graph, predictor, SECOND)
    for stamp in (SECOND + SECOND // 2, SECOND + SECOND // 2 + 1, 3 * SECOND):
        graph.joints("/joint_states", stamp)
    graph.until(lambda: predictor.health.faults == 2, "two refused samples")
    graph.load(3 * SECOND)
    wait_for_load(graph, predictor, 3 * SECOND)
    graph.joints("/joint_states", 3 * SECOND + 1)
    wait_for_predictions(graph, 2)
    stamps = [nanoseconds(message.header.stamp) for message in predictions(graph)]
    assert stamps == [SECOND + SECOND // 2, 3 * SECOND + 1]


def test_tare_makes_the_present_load_zero(graph, predictor, model):
    def tare(age_limit_s):
        predictor.set_parameters([Parameter("load_age_limit_s", value=age_limit_s)])
        answer = graph.call(Trigger, f"/{NAME}/tare", Trigger.Request())
        return "" if answer.success else answer.message

    assert "no load estimate has arrived" in tare(60.0)
    graph.load(SECOND)
    wait_for_load(graph, predictor, SECOND)
    silent_from_s = time.monotonic() + 0.001
    graph.until(lambda: time.monotonic() > silent_from_s, "a millisecond without a load")
    assert tare(0.001).startswith("refused: no load estimate has arrived for ")
    assert predictor.stream.loads.zero is None
    assert tare(60.0) == ""
    graph.joints("/joint_states", SECOND)
    wait_for_predictions(graph, 1)
    assert numbers(predictions(graph)[0]) == expected(model, wrench=np.zeros(6))


def test_a_joint_state_waits_for_its_load(graph, model_path, model):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path), load_wait_s=1.0)
    graph.listen(PoseWithCovarianceStamped, "/pose_error_predicted")
    graph.connected("/pose_error_predicted")
    graph.load(SECOND, np.zeros(6))
    wait_for_load(graph, node, SECOND)
    graph.joints("/joint_states", SECOND + 10)
    graph.until(lambda: len(node.waiting) == 1, "waiting joint state")
    graph.load(SECOND + 10)
    wait_for_predictions(graph, 1)
    assert numbers(predictions(graph)[0]) == expected(model)
    # No further load: predicted with the one that is there when the wait is over.
    graph.joints("/joint_states", SECOND + 20)
    wait_for_predictions(graph, 2)
    assert numbers(predictions(graph)[1]) == expected(model)


def test_without_a_model_the_node_is_not_configured_and_says_why(graph, tmp_path, model_path):
    graph.add(PoseErrorPredictor, model_file=str(tmp_path / "none.yaml"))
    status, _ = graph.status(NAME, lambda status, values: True)
    assert status.level == status.ERROR
    assert "none.yaml: cannot be read" in status.message
    refused = graph.call(Trigger, f"/{NAME}/reload_model", Trigger.Request())
    assert not refused.success
    assert "none.yaml" in refused.message
    node = next(node for node in graph.executor.get_nodes() if node.get_name() == NAME)
    node.set_parameters([Parameter("model_file", value=str(model_path))])
    assert not graph.call(Trigger, f"/{NAME}/reload_model", Trigger.Request()).success
    for step in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request(transition=Transition(id=step))
        assert graph.call(ChangeState, f"/{NAME}/change_state", request).success
    graph.load(SECOND)
    wait_for_load(graph, node, SECOND)
    graph.listen(PoseWithCovarianceStamped, "/pose_error_predicted")
    graph.connected("/pose_error_predicted")
    graph.joints("/joint_states", SECOND)
    wait_for_predictions(graph, 1)


def test_a_temperature_reaches_the_model_and_a_missing_one_is_reported(graph, model, tmp_path):
    path = tmp_path / "warm.yaml"
    growth = Effect(find_law("thermal_expansion"), "link_1", {})
    save_model(model.with_effects(growth), path)
    node = graph.add(PoseErrorPredictor, model_file=str(path))
    graph.listen(PoseWithCovarianceStamped, "/pose_error_predicted")
    graph.connected("/pose_error_predicted")
    graph.load(SECOND)
    wait_for_load(graph, node, SECOND)
    graph.joints("/joint_states", SECOND)
    status, _ = graph.status(NAME, lambda status, values: "temperature" in status.message)
    assert status.level == status.WARN
    message = Temperature(temperature=60.0)
    message.header.frame_id = "link_1"
    message.header.stamp = time_message(SECOND)
    graph.publish("/temperatures", message)
    graph.until(lambda: node.stream.temperatures.at(SECOND), "temperature")
    graph.joints("/joint_states", SECOND)
    wait_for_predictions(graph, 2)
    cold, hot = (np.array(numbers(message)[:3]) for message in predictions(graph))
    assert np.linalg.norm(hot - cold) > 1e-6
    # Five minutes later it is too old.
    graph.load(302 * SECOND)
    wait_for_load(graph, node, 302 * SECOND)
    graph.joints("/joint_states", 302 * SECOND)
    wait_for_predictions(graph, 3)
    status, _ = graph.status(NAME, lambda status, values: "link_1: older" in status.message)
    assert status.level == status.WARN
    assert numbers(predictions(graph)[2])[:3] == cold.tolist()


def test_frames_of_tf_static_are_used(graph, predictor, model):
    """The messages of tf2 are not among the wheels from PyPI: what they hold is handed over."""
    step = TransformStamped(child_frame_id="ft")
    step.header.frame_id = "wrist_platform"
    step.transform.rotation.x, step.transform.rotation.w = 1.0, 0.0
    broken = TransformStamped(child_frame_id="none")
    broken.transform.rotation.w = 0.5
    predictor.on_transforms(SimpleNamespace(transforms=[broken, step]))
    assert predictor.health.faults == 1
    graph.load(SECOND, (0, 0, 1.0, 0, 0, 0), "ft")
    wait_for_load(graph, predictor, SECOND)
    graph.joints("/joint_states", SECOND)
    wait_for_predictions(graph, 1)
    down = Load(np.array(DOWN), on_platform=True)
    wanted = np.concatenate(pose_of_twist(model.predict(np.array(THETA), down).twist))
    assert numbers(predictions(graph)[0]) == pytest.approx(wanted.tolist(), rel=1e-9, abs=1e-15)
