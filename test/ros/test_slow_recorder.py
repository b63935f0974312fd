"""A recorder that is told to stop hears out what has come, also on a slow computer."""

from itertools import count
from types import SimpleNamespace

import rclpy
from sensor_msgs.msg import JointState

from wrist_stiffness.recording import open_recording
from wrist_stiffness.ros import executor
from wrist_stiffness.ros.recorder import Recorder

SAMPLES, TAKEN_IN_A_TURN = 300, 10


def test_where_few_messages_are_taken_in_a_turn_all_are_written(graph, tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"
    graph.listen(JointState, "/joint_states")
    recorder = graph.add(Recorder, output=str(path))
    graph.until(lambda: list(recorder.subscriptions), "subscriptions of the recorder")
    graph.joints("/joint_states", 1)
    graph.until(lambda: graph.heard["/joint_states"], "first sample")
    graph.executor.remove_node(recorder)
    for stamp_ns in range(2, SAMPLES):
        graph.joints("/joint_states", stamp_ns)
    graph.until(lambda: len(graph.heard["/joint_states"]) == SAMPLES - 1, "all samples")
    rclpy.shutdown(context=graph.context)
    looks, step_s = count(), executor.LONGEST_RUN_S / TAKEN_IN_A_TURN
    slow = SimpleNamespace(monotonic=lambda: step_s * next(looks))
    monkeypatch.setattr(executor, "time", slow)
    recorder.destroy_node()
    recording = open_recording(path)
    stamps = [message.header.stamp_ns for _, _, message in recording.messages(["/joint_states"])]
    assert stamps == list(range(1, SAMPLES))
