"""What a run's last samples need: their answers, and a recorder that hears them out."""

import time

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import JointState

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.ros import cell_simulator
from wrist_stiffness.ros.cell_simulator import CellSimulator
from wrist_stiffness.ros.recorder import Recorder

QUIET_S = 0.5
SAMPLES = 300


def test_a_recorder_that_is_told_to_stop_writes_what_it_has_heard(graph, tmp_path):
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
    # As a signal ends a process: first the context, then the node.
    rclpy.shutdown(context=graph.context)
    recorder.destroy_node()
    recording = open_recording(path)
    stamps = [message.header.stamp_ns for _, _, message in recording.messages(["/joint_states"])]
    assert stamps == list(range(1, SAMPLES))


def test_a_recorder_whose_disk_refuses_the_last_message_is_closed(graph, tmp_path, monkeypatch):
    recorder = graph.add(Recorder, output=str(tmp_path / "run.mcap"))
    graph.until(lambda: list(recorder.subscriptions), "subscriptions of the recorder")
    graph.listen(JointState, "/joint_states")
    graph.executor.remove_node(recorder)
    monkeypatch.setattr(RecordingWriter, "write_raw", refused)
    graph.joints("/joint_states", 1)
    graph.until(lambda: graph.heard["/joint_states"], "first sample")
    with pytest.raises(RecordingError, match="No space left"):
        recorder.destroy_node()
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


def refused(writer, channel, payload, log_time_ns):
    """As a full disk does."""
    raise RecordingError("run.mcap cannot be written: No space left on device")


class Run:
    """A virtual wrist that moves for a second, and a node that answers nothing by itself."""

    def __init__(self, graph, topic, message_type):
        self._graph = graph
        self._answers = graph.probe.create_publisher(message_type, topic, 10)
        self._message_type, self.quiet_s = message_type, 0.0
        graph.listen(JointState, "/joint_states")
        graph.add(CellSimulator, programs=1, program_s=1.0, rate_hz=50.0, listeners=1)
        graph.until(self._answers.get_subscription_count, "listener")

    def spin(self, seconds):
        """Go on until so much time has passed without a further sample."""
        heard = self._graph.heard["/joint_states"]
        last = [0, time.monotonic()]

        def quiet():
            if len(heard) > last[0]:
                last[:] = len(heard), time.monotonic()
            self.quiet_s = time.monotonic() - last[1]
            return last[0] and self.quiet_s > seconds

        self._graph.until(quiet, "end of the run")

    def answer(self):
        """Answer the last sample."""
        header = self._graph.heard["/joint_states"][-1].header
        self._answers.publish(self._message_type(header=header))


@pytest.mark.parametrize(
    ("topic", "message_type"),
    [
        ("/pose_error_predicted", PoseWithCovarianceStamped),
        ("/model_residual", PoseWithCovarianceStamped),
        ("/motor_commands_corrected", JointState),
    ],
)
def test_a_run_ends_when_its_last_sample_is_answered(graph, monkeypatch, topic, message_type):
    monkeypatch.setattr(cell_simulator, "LONGEST_ANSWER_S", np.inf)
    run = Run(graph, topic, message_type)
    run.spin(QUIET_S)
    run.answer()
    with pytest.raises(SystemExit):
        run.spin(np.inf)


def test_a_run_waits_but_not_for_ever(graph, monkeypatch):
    monkeypatch.setattr(cell_simulator, "LONGEST_ANSWER_S", QUIET_S)
    run = Run(graph, "/pose_error_predicted", PoseWithCovarianceStamped)
    with pytest.raises(SystemExit):
        run.spin(np.inf)
    # The last sample is heard a little after it was said.
    assert run.quiet_s > 0.5 * QUIET_S
