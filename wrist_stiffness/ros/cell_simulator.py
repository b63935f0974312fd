"""Node `cell_simulator`: the virtual wrist with its motors, load and pose sensor."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from functools import partial
from typing import Any, NoReturn

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, WrenchStamped
from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from wrist_stiffness.commands.node_list import LARGEST_SEED, RATES_HZ, UNANSWERED
from wrist_stiffness.compensation.intake import MotorNames, checked_prefix
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.parameters import FRAMES_PREFIXED, ParameterEntry
from wrist_stiffness.errors import WristError
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.ros.conversions import (
    joint_message,
    nanoseconds,
    pose_message_stamped,
    wrench_message,
)
from wrist_stiffness.ros.parameters import declare, model_path, values_of
from wrist_stiffness.ros.qos import NOTES_QOS, RELIABLE_QOS
from wrist_stiffness.ros.run import tell
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.experiment import EXPERIMENTS
from wrist_stiffness.topics import (
    BASE_FRAME,
    JOINT_STATES,
    LOAD_ESTIMATE,
    MODEL_RESIDUAL,
    MOTOR_COMMANDS,
    MOTOR_COMMANDS_CORRECTED,
    PLATFORM_POSE,
    POSE_ERROR_PREDICTED,
    RECORDING_NOTES,
    relative,
)


class AnswerCount:
    """Answers of one node, heard in the order of the samples.

    `first`: number of the first sample that the node was asked.
    """

    def __init__(self, first: int) -> None:
        self._first = first
        self._silence = self._heard = 0
        self.last = first - 1  # number of the newest sample that was answered

    def hear(self, number: int) -> None:
        """Count the answer to a sample by its number."""
        if number > self.last:
            self._silence = self.silence(number)
            self._heard += 1
            self.last = number

    def asked(self, end: int) -> int:
        """Return how many samples before number `end` the node was asked."""
        return end - self._first

    def missing(self, end: int) -> int:
        """Return to how many of these no answer was heard."""
        return self.asked(end) - self._heard

    def silence(self, end: int) -> int:
        """Return how many samples before number `end` were without an answer in a row, at most."""
        return max(self._silence, end - self.last - 1)


PARAMETERS = (
    ParameterEntry("model_file", "", "model whose table is the true wrist; empty: the shipped one"),
    ParameterEntry("rate_hz", 100.0, "samples per second", RATES_HZ),
    ParameterEntry("experiment", "rich", "what the motion is", choices=tuple(EXPERIMENTS)),
    ParameterEntry("program_s", 60.0, "length of the motion [s]", (1.0, 86400.0)),
    ParameterEntry(
        "programs", 0, "how often the motion is done, then the node ends; 0: for ever", (0, 1e9)
    ),
    ParameterEntry("seed", 0, "of the program and of the sensors' noise", (0, LARGEST_SEED)),
    ParameterEntry(
        "listeners", 0, "subscriptions of /joint_states to wait for before moving", (0, 100)
    ),
    ParameterEntry(
        "enable_at_repeat", False, "switch the angle corrector on when the motion repeats"
    ),
    FRAMES_PREFIXED,
)

SENT_QUEUE = QoSProfile(depth=1)
"""Motors follow the newest command only."""

SPEAKERS = {
    POSE_ERROR_PREDICTED: ("pose_error_predictor", PoseWithCovarianceStamped),
    MODEL_RESIDUAL: ("model_monitor", PoseWithCovarianceStamped),
    MOTOR_COMMANDS_CORRECTED: ("angle_corrector", JointState),
}
"""Who says of a sample what."""

LONGEST_ANSWER_S = 1.0
"""So long the last sample waits for its answers, where nobody may be there to give them."""

SILENCE_S = 1.0
"""A node that answers no sample for longer than that hangs; one that is held up loses some."""

LONGEST_GREETING_S = 5.0
"""So long the motion waits for its listeners to answer; one that hangs is named at the end."""

NAMELESS = "_NODE_NAME_UNKNOWN_"
"""What the middleware calls a node whose name comes later than its subscription."""

LONGEST_SWITCHING_S = 10.0
"""So long the motion waits for the angle corrector to be switched on."""


class CellSimulator(Node):
    """Thin shell over `VirtualCell`; its motors follow `/motor_commands_corrected`."""

    def __init__(self, **options: Any) -> None:
        super().__init__("cell_simulator", **options)
        declare(self, PARAMETERS)
        own = values_of(self, PARAMETERS)
        seed = own["seed"]
        settings = CellSettings(
            rate_hz=own["rate_hz"],
            program_seconds=own["program_s"],
            program_seed=seed,
            experiment=own["experiment"],
        )
        model = load_model(model_path(own["model_file"]))
        self.cell = VirtualCell(model.table, settings, np.random.default_rng(seed))
        motors = MotorNames()
        self._names = (motors.motor_1, motors.motor_2)
        self._base_frame = checked_prefix(own["frame_prefix"]) + BASE_FRAME
        self._programs = own["programs"]
        self._enable_at_repeat = own["enable_at_repeat"]
        self._sent = self.cell.desired(0.0)
        self._start_ns: int | None = None
        self._step = 0
        self._program = -1
        self._enabling: Future | None = None
        self._enabling_s = 0.0
        self._listeners: list[Client] = []
        self._greetings: list[Future] = []
        self._found_s = 0.0

        self._joints = self.create_publisher(JointState, relative(JOINT_STATES), RELIABLE_QOS)
        self._load = self.create_publisher(WrenchStamped, relative(LOAD_ESTIMATE), RELIABLE_QOS)
        self._command = self.create_publisher(JointState, relative(MOTOR_COMMANDS), RELIABLE_QOS)
        self._measured = self.create_publisher(PoseStamped, relative(PLATFORM_POSE), RELIABLE_QOS)
        self._true = self.create_publisher(PoseStamped, "~/platform_pose_true", RELIABLE_QOS)
        self._notes = self.create_publisher(String, relative(RECORDING_NOTES), NOTES_QOS)
        self._enable = self.create_client(SetBool, "angle_corrector/enable")
        self._asked_s = time.monotonic()
        self._answers: dict[str, AnswerCount] = {}
        for topic, (_, message_type) in SPEAKERS.items():
            answer = partial(self._on_answer, topic)
            self.create_subscription(message_type, relative(topic), answer, SENT_QUEUE)
        self.create_timer(1.0 / settings.rate_hz, self._on_timer)

    def _on_answer(self, topic: str, message: JointState | PoseWithCovarianceStamped) -> None:
        if topic in self._answers and self._start_ns is not None:
            since_s = (nanoseconds(message.header.stamp) - self._start_ns) / NANOSECONDS
            number = round(since_s * self.cell.settings.rate_hz)
            if number < self._step:
                self._answers[topic].hear(number)
        if isinstance(message, JointState):
            try:
                self._sent = MotorNames().angles(message.name, message.position)
            except WristError as error:
                self.get_logger().warning(str(error), throttle_duration_sec=5.0)

    def _on_timer(self) -> None:
        if not self._may_move():
            return
        time_s = self._step / self.cell.settings.rate_hz
        program = int(time_s // self.cell.program.duration_s)
        if program != self._program and not self._begin(program, time_s):
            return
        self._publish(time_s)
        self._step += 1

    def _may_move(self) -> bool:
        if self._start_ns is None:
            listeners = self.count_subscribers(relative(JOINT_STATES))
            if listeners < self.get_parameter("listeners").value:
                return False
            if self._enable_at_repeat and not (
                self._enable.service_is_ready() and self.count_subscribers(relative(MOTOR_COMMANDS))
            ):
                return False
            if listeners and not self._is_known():
                return False
            self._start_ns = self.get_clock().now().nanoseconds
        return True

    def _is_known(self) -> bool:
        """Tell whether the listeners know this node, or take too long.

        That it sees them does not say that they see it: an announcement that got lost comes again
        after about a second, and best-effort listeners miss the samples until then.  Who answers a
        request has read what was announced before it.
        """
        self._found_s = self._found_s or time.monotonic()
        if not self._listeners:
            found = self.get_subscriptions_info_by_topic(relative(JOINT_STATES))
            named = all(each.node_name != NAMELESS for each in found)
            for each in found if named else ():
                name = f"{each.node_namespace.rstrip('/')}/{each.node_name}/get_parameters"
                self._listeners.append(self.create_client(GetParameters, name))
        if not self._greetings and all(each.service_is_ready() for each in self._listeners):
            request = GetParameters.Request(names=["use_sim_time"])
            self._greetings = [each.call_async(request) for each in self._listeners]
        answered = bool(self._greetings) and all(each.done() for each in self._greetings)
        return answered or time.monotonic() > self._found_s + LONGEST_GREETING_S

    def _begin(self, program: int, time_s: float) -> bool:
        """Begin a repetition of the motion; False while the corrector has not answered yet."""
        if self._programs and program >= self._programs:
            if not self._is_answered():
                return False
            for publisher in self.publishers:
                publisher.wait_for_all_acked(Duration(seconds=1.0))
            self._end(self._silent())
        corrects = self._enable_at_repeat and program > 0
        if corrects:
            if self._enabling is None:
                self._enabling = self._enable.call_async(SetBool.Request(data=True))
                self._enabling_s = time.monotonic()
            if not self._enabling.done():
                if time.monotonic() > self._enabling_s + LONGEST_SWITCHING_S:
                    switched = f"{self._enable.srv_name}: no answer in {LONGEST_SWITCHING_S:g} s"
                    self._end([switched, *self._silent()])
                return False
        self._program = program
        notes = {
            "source": "virtual cell",
            "program": program,
            "start_ns": self._stamp_ns(time_s),
            "correction": "on" if corrects else "off",
            "load_source": "ft",
        }
        self._notes.publish(String(data=json.dumps(notes)))
        return True

    def _is_answered(self) -> bool:
        """Tell whether those who are there have answered the last sample, or take too long."""
        return time.monotonic() > self._asked_s + LONGEST_ANSWER_S or all(
            answers.last == self._step - 1 or not self.count_publishers(relative(topic))
            for topic, answers in self._answers.items()
        )

    def _silent(self) -> list[str]:
        """Return who left samples without an answer for too long."""
        longest = SILENCE_S * self.cell.settings.rate_hz
        return [
            f"{SPEAKERS[topic][0]}: no answer heard to {answers.missing(self._step)} of "
            f"{answers.asked(self._step)} samples, {answers.silence(self._step)} of them in a row"
            for topic, answers in self._answers.items()
            if answers.silence(self._step) > longest
        ]

    def _end(self, faults: Sequence[str]) -> NoReturn:
        if faults:
            tell("; ".join(faults))
        raise SystemExit(UNANSWERED if faults else 0)

    def _stamp_ns(self, time_s: float) -> int:
        return (self._start_ns or 0) + round(time_s * NANOSECONDS)

    def _publish(self, time_s: float) -> None:
        for topic in SPEAKERS:
            # Once it was there: of a node that hangs for long the middleware says that it has gone.
            if topic not in self._answers and self.count_publishers(relative(topic)):
                self._answers[topic] = AnswerCount(self._step)
        stamp_ns = self._stamp_ns(time_s)
        sample = self.cell.step(time_s, self._sent)
        # The load first: it belongs to the joint state of the same stamp.
        frame = self._base_frame
        self._load.publish(wrench_message(stamp_ns, frame, sample.wrench))
        self._joints.publish(joint_message(stamp_ns, "", self._names, sample.encoder, sample.speed))
        self._measured.publish(
            pose_message_stamped(stamp_ns, sample.measured_rotation, sample.measured_shift, frame)
        )
        self._true.publish(
            pose_message_stamped(stamp_ns, sample.pose_rotation, sample.pose_shift, frame)
        )
        self._command.publish(joint_message(stamp_ns, "", self._names, self.cell.desired(time_s)))
        self._asked_s = time.monotonic()
