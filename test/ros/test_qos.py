"""Qualities of service: sensor-data drivers are heard, and every kind of listener hears us."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from wrist_stiffness.model.error_model import Load
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.conversions import joint_message, pose_message_stamped, wrench_message
from wrist_stiffness.ros.model_monitor import ModelMonitor
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor

SECOND = 1_000_000_000
NAMES = ("motor_1_joint", "motor_2_joint")
THETA = np.array([0.1, -0.2])
DOWN = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
RELIABLE = QoSProfile(depth=10)
KINDS = {"best effort": qos_profile_sensor_data, "reliable": RELIABLE}


def publisher(graph, message_type, topic, qos):
    made = graph.probe.create_publisher(message_type, topic, qos)
    graph.until(made.get_subscription_count, f"listener of {topic}")
    return made


def listener(graph, message_type, topic, qos):
    heard = []
    made = graph.probe.create_subscription(message_type, topic, heard.append, qos)
    graph.until(lambda: graph.probe.count_publishers(topic), f"publisher of {topic}")
    return heard, made


@pytest.mark.parametrize("driver", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize("listens", KINDS.values(), ids=KINDS)
def test_drivers_of_both_kinds_are_heard_and_both_kinds_of_listeners_hear(
    graph, model_path, driver, listens
):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path))
    heard, _ = listener(graph, PoseWithCovarianceStamped, "/pose_error_predicted", listens)
    load = publisher(graph, WrenchStamped, "/load_estimate", driver)
    joints = publisher(graph, JointState, "/joint_states", driver)

    def predicted():
        # A best-effort message may be lost, so both go on until there is an answer.
        load.publish(wrench_message(SECOND, "wrist_base", DOWN))
        joints.publish(joint_message(SECOND, "", NAMES, THETA))
        return heard

    graph.until(predicted, "prediction")
    assert node.health.faults <= 1


def test_a_best_effort_planner_is_not_heard_for_a_command_must_not_be_lost(graph, model_path):
    graph.add(AngleCorrector, model_file=str(model_path))
    heard, _ = listener(graph, JointState, "/motor_commands_corrected", RELIABLE)
    lossy = graph.probe.create_publisher(JointState, "/motor_commands", qos_profile_sensor_data)
    reliable = publisher(graph, JointState, "/motor_commands", RELIABLE)
    reliable.publish(joint_message(SECOND, "", NAMES, THETA))
    graph.until(lambda: heard, "command")
    assert lossy.get_subscription_count() == 0


@pytest.mark.parametrize(
    ("node", "topic", "answer", "kind", "waiting"),
    [
        (
            PoseErrorPredictor,
            "/joint_states",
            "/pose_error_predicted",
            PoseWithCovarianceStamped,
            1000,
        ),
        (AngleCorrector, "/motor_commands", "/motor_commands_corrected", JointState, 50),
    ],
    ids=["a second of joint states", "50 ms of commands"],
)
def test_what_comes_while_a_node_is_held_up_is_answered(
    graph, model_path, node, topic, answer, kind, waiting
):
    graph.add(node, model_file=str(model_path))
    load = publisher(graph, WrenchStamped, "/load_estimate", RELIABLE)
    inputs = publisher(graph, JointState, topic, QoSProfile(depth=waiting))
    heard, _ = listener(graph, kind, answer, QoSProfile(depth=waiting))
    load.publish(wrench_message(SECOND, "wrist_base", DOWN))
    # Nothing spins meanwhile.
    for i in range(waiting):
        inputs.publish(joint_message(SECOND + i, "", NAMES, THETA))
    graph.until(lambda: len(heard) == waiting, "every answer")
    assert [message.header.stamp.nanosec for message in heard] == list(range(waiting))


def test_the_alarm_reaches_a_listener_that_comes_later(graph, model_path, model):
    node = graph.add(ModelMonitor, model_file=str(model_path), baseline_samples=2)
    load = publisher(graph, WrenchStamped, "/load_estimate", RELIABLE)
    joints = publisher(graph, JointState, "/joint_states", RELIABLE)
    poses = publisher(graph, PoseStamped, "/platform_pose_measured", RELIABLE)
    load.publish(wrench_message(SECOND, "wrist_base", DOWN))
    joints.publish(joint_message(SECOND, "", NAMES, THETA))
    graph.until(lambda: node.stream.loads.newest_ns == SECOND, "load")
    prediction = model.predict(THETA, Load(DOWN))
    rotation, shift = prediction.motion
    for i in range(40):
        move = 1e-5 * (i >= 2)
        pose = pose_message_stamped(
            SECOND + i, rotation @ prediction.configuration.platform, shift + move
        )
        poses.publish(pose)
    graph.until(lambda: node.stream.monitor.alarm, "alarm")
    late = QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    heard, _ = listener(graph, Bool, "/model_alarm", late)
    graph.until(lambda: heard, "the alarm of before")
    assert heard[-1].data
    assert len(heard) < 40
