"""What a run's end needs: answers to the samples, and a recorder that hears them out."""

import re
import time
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from wrist_stiffness.commands.node_list import UNANSWERED
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.ros import cell_simulator, executor
from wrist_stiffness.ros.cell_simulator import AnswerCount, CellSimulator
from wrist_stiffness.ros.recorder import Recorder

QUIET_S = 0.5
RATE_HZ = 50.0
SAMPLES, TAKEN_IN_A_TURN = 300, 10


def recorder_behind(graph, path):
    """Return a recorder that has heard samples and has not taken them, as the context ends."""
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
    return recorder


def stamps_in(path):
    recording = open_recording(path)
    return [message.header.stamp_ns for _, _, message in recording.messages(["/joint_states"])]


def test_a_recorder_that_is_told_to_stop_writes_what_it_has_heard(graph, tmp_path):
    path = tmp_path / "run.mcap"
    recorder_behind(graph, path).destroy_node()
    assert stamps_in(path) == list(range(1, SAMPLES))


def test_where_few_messages_are_taken_in_a_turn_all_are_written(graph, tmp_path, monkeypatch):
    """As on a slow computer."""
    path = tmp_path / "run.mcap"
    recorder = recorder_behind(graph, path)
    looks, step_s = count(), executor.LONGEST_RUN_S / TAKEN_IN_A_TURN
    slow = SimpleNamespace(monotonic=lambda: step_s * next(looks))
    monkeypatch.setattr(executor, "time", slow)
    recorder.destroy_node()
    assert stamps_in(path) == list(range(1, SAMPLES))


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
    """A virtual wrist that moves for some seconds, and a node that answers nothing by itself."""

    def __init__(self, graph, topic, message_type):
        self._graph = graph
        self.answers = graph.probe.create_publisher(message_type, topic, 10)
        self._message_type, self.quiet_s = message_type, 0.0
        self.last = 0
        graph.listen(JointState, "/joint_states")
        arguments = {"programs": 1, "program_s": 1.0, "rate_hz": RATE_HZ, "listeners": 1}
        self.cell = graph.add(CellSimulator, **arguments)
        graph.until(self.answers.get_subscription_count, "listener")

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
        """Answer the last sample; on a busy machine others may have come before it."""
        heard = self._graph.heard["/joint_states"]
        header, self.last = heard[-1].header, len(heard)
        self.answers.publish(self._message_type(header=header))


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_run_waits_but_not_for_ever(graph, monkeypatch):
    monkeypatch.setattr(cell_simulator, "LONGEST_ANSWER_S", QUIET_S)
    run = Run(graph, "/pose_error_predicted", PoseWithCovarianceStamped)
    with pytest.raises(SystemExit):
        run.spin(np.inf)
    # The last sample is heard a little after it was said.
    assert run.quiet_s > 0.5 * QUIET_S


@pytest.mark.slow
@pytest.mark.parametrize("gone", [False, True], ids=["hangs", "hangs for so long that it is gone"])
@pytest.mark.parametrize("answered", [0, 10])
def test_a_run_says_who_fell_silent(graph, monkeypatch, capsys, answered, gone):
    monkeypatch.setattr(cell_simulator, "LONGEST_ANSWER_S", QUIET_S)
    run = Run(graph, "/pose_error_predicted", PoseWithCovarianceStamped)
    heard = graph.heard["/joint_states"]
    for sample in range(answered):
        graph.until(lambda sample=sample: len(heard) > sample, "sample")
        run.answer()
    graph.until(lambda: heard, "sample")
    if gone:
        graph.probe.destroy_publisher(run.answers)
    with pytest.raises(SystemExit) as ended:
        run.spin(np.inf)
    assert ended.value.code == UNANSWERED
    (line,) = capsys.readouterr().err.splitlines()
    told = re.search(
        "pose_error_predictor: no answer heard to ([0-9]+) of ([0-9]+) samples, ([0-9]+) of", line
    )
    missing, asked, silence = map(int, told.groups())
    # What was said before the end may not have been taken yet.
    graph.executor.remove_node(run.cell)
    graph.until(lambda: len(heard) == asked, "last sample")
    assert asked >= 2 * RATE_HZ
    # The motors' queue holds one: of answers that come close together only the newest is heard.
    assert asked - answered <= missing < asked + (answered == 0)
    assert asked - run.last <= silence <= missing


@pytest.mark.slow
def test_a_run_of_which_a_node_is_held_up_for_less_than_a_second_is_sound(graph, capsys):
    run = Run(graph, "/pose_error_predicted", PoseWithCovarianceStamped)
    heard, answered = graph.heard["/joint_states"], [0]

    def answer_some():
        if len(heard) >= answered[0] + 0.6 * RATE_HZ:
            answered[0] = len(heard)
            run.answer()

    with pytest.raises(SystemExit) as ended:
        graph.until(answer_some, "end of the run")
    assert len(heard) > 1.5 * RATE_HZ
    assert ended.value.code == 0
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_a_run_does_not_wait_for_ever_for_a_corrector_that_hangs(graph, monkeypatch, capsys):
    monkeypatch.setattr(cell_simulator, "LONGEST_SWITCHING_S", QUIET_S)
    hung = rclpy.create_node("angle_corrector", context=graph.context)  # Nobody runs it.
    hung.create_service(SetBool, "~/enable", lambda request, response: response)
    hung.create_subscription(JointState, "/motor_commands", lambda message: None, 10)
    graph.add(CellSimulator, programs=2, program_s=1.0, rate_hz=RATE_HZ, enable_at_repeat=True)
    with pytest.raises(SystemExit) as ended:
        graph.until(lambda: False, "end of the run")
    hung.destroy_node()
    assert ended.value.code == UNANSWERED
    (line,) = capsys.readouterr().err.splitlines()
    assert "angle_corrector/enable: no answer in 0.5 s" in line


def test_answers_are_counted_by_the_numbers_of_their_samples():
    count = AnswerCount(first=10)
    assert (count.asked(10), count.missing(10), count.silence(10)) == (0, 0, 0)
    assert (count.asked(15), count.missing(15), count.silence(15)) == (5, 5, 5)
    for number in (12, 13, 13, 11, 5, 17):
        count.hear(number)
    # Without an answer: 10, 11, 14, 15, 16, 18, 19.
    assert count.last == 17
    assert (count.asked(20), count.missing(20), count.silence(20)) == (10, 7, 3)
    assert count.silence(30) == 12
