"""What a run's start needs: that those who listen know who speaks, and not only the reverse."""

import time

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from wrist_stiffness.commands import cell
from wrist_stiffness.errors import InputError
from wrist_stiffness.ros import cell_simulator
from wrist_stiffness.ros.cell_simulator import NAMELESS, CellSimulator

GREETED = "/silent/get_parameters"


@pytest.fixture
def silent(graph):
    """Return a node that listens but does not run."""
    node = rclpy.create_node("silent", context=graph.context)
    node.create_subscription(JointState, "/joint_states", lambda message: None, 10)
    yield node
    node.destroy_node()


def moving(graph):
    """Return a virtual wrist that waits for two listeners: the probe and the silent one."""
    graph.listen(JointState, "/joint_states")
    return graph.add(CellSimulator, program_s=1.0, rate_hz=50.0, listeners=2)


def test_the_motion_waits_until_every_listener_answers(graph, silent):
    simulator = moving(graph)
    graph.until(lambda: simulator.count_clients(GREETED), "request to the silent listener")
    answered_ns = simulator.get_clock().now().nanoseconds
    graph.executor.add_node(silent)
    graph.until(lambda: graph.heard["/joint_states"], "first sample")
    stamp = graph.heard["/joint_states"][0].header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec > answered_ns


def test_a_listener_that_hangs_holds_the_motion_up_for_a_while_only(graph, silent, monkeypatch):
    monkeypatch.setattr(cell_simulator, "LONGEST_GREETING_S", 0.5)
    simulator = moving(graph)
    graph.until(lambda: simulator.count_clients(GREETED), "request to the silent listener")
    asked_s = time.monotonic()
    graph.until(lambda: graph.heard["/joint_states"], "first sample")
    assert time.monotonic() - asked_s > 0.4


def test_a_listener_whose_name_comes_late_is_greeted_by_it(graph, monkeypatch):
    """Its subscription and its name are announced apart."""
    graph.listen(JointState, "/joint_states")
    simulator = graph.add(CellSimulator, program_s=1.0, rate_hz=50.0)
    nameless, known = [], simulator.get_subscriptions_info_by_topic

    def named_late(topic):
        found = known(topic)
        if len(nameless) < 3:
            nameless.append(topic)
            for each in found:
                each.node_name = each.node_namespace = NAMELESS
        return found

    monkeypatch.setattr(simulator, "get_subscriptions_info_by_topic", named_late)
    graph.until(lambda: graph.heard["/joint_states"], "first sample")
    assert len(nameless) == 3
    assert simulator.count_clients("/probe/get_parameters") == 1


def test_two_cells_in_two_namespaces_have_frames_of_their_own(graph):
    spoken = {"load_estimate": WrenchStamped} | dict.fromkeys(
        ("platform_pose_measured", "cell_simulator/platform_pose_true"), PoseStamped
    )
    for side in ("left", "right"):
        prefix = Parameter("frame_prefix", value=f"{side}/")
        arguments = ["--ros-args", "-r", f"__ns:=/{side}"]
        cell = CellSimulator(
            context=graph.context, cli_args=arguments, parameter_overrides=[prefix]
        )
        graph.executor.add_node(cell)
        for topic, message_type in spoken.items():
            graph.listen(message_type, f"/{side}/{topic}")
    for side in ("left", "right"):
        for topic in spoken:
            heard = graph.heard[f"/{side}/{topic}"]
            graph.until(lambda heard=heard: heard, f"{side} {topic}")
            assert {each.header.frame_id for each in heard} == {f"{side}/wrist_base"}


def test_a_frame_prefix_that_cannot_be_one_is_refused(graph):
    with pytest.raises(InputError, match="frame_prefix: '/left' is not made of"):
        graph.add(CellSimulator, frame_prefix="/left")


def test_the_recorder_waits_for_all_that_the_virtual_cell_says(graph):
    simulator = graph.add(CellSimulator, rate_hz=50.0)
    said = {publisher.topic_name for publisher in simulator.publishers}
    assert said - {"/recording_notes", "/rosout", "/parameter_events"} <= set(cell.SPOKEN)
