"""Node `recorder`: writes the wrist's topics, as they come from the wire, into a recording."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from importlib import import_module
from typing import Any

from rclpy.node import Node

from wrist_stiffness import topics
from wrist_stiffness.compensation.parameters import ParameterEntry
from wrist_stiffness.errors import InputError
from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording.channel import Channel, channel_of
from wrist_stiffness.recording.messages import (
    Bool,
    DiagnosticArray,
    Float64MultiArray,
    JointState,
    JointTrajectory,
    Message,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    String,
    Temperature,
    Vector3Stamped,
    WrenchStamped,
)
from wrist_stiffness.ros.executor import DataGroup, take_in_order
from wrist_stiffness.ros.parameters import declare
from wrist_stiffness.ros.qos import NOTES_QOS, RECORDING_QOS

PARAMETERS = (
    ParameterEntry("output", "", "new folder, or new file ending in .mcap", fixed=True),
    ParameterEntry(
        "begin_with",
        "",
        "topics, with blanks between, that must have a publisher first",
        fixed=True,
    ),
)

LOOKS_PER_S = 20

MOST_RUNS_AT_END = 50
"""Of the executor: a second, for a stream that does not end."""

TOPICS: dict[str, type[Message]] = {
    topics.LOAD_ESTIMATE: WrenchStamped,
    topics.TEMPERATURES: Temperature,
    topics.PLATFORM_POSE: PoseStamped,
    topics.PLATFORM_MARKERS: PoseArray,
    topics.FRAME_POSE: PoseStamped,
    topics.MOTOR_COMMANDS: JointState,
    topics.MOTOR_TRAJECTORY: JointTrajectory,
    topics.RECORDING_NOTES: String,
    topics.PLATFORM_POSE_TRUE: PoseStamped,
    topics.POSE_ERROR_PREDICTED: PoseWithCovarianceStamped,
    topics.POSE_ERROR_S_UM: Vector3Stamped,
    topics.POSE_ERROR_PHI_MDEG: Vector3Stamped,
    topics.MOTOR_COMMANDS_CORRECTED: JointState,
    topics.MOTOR_POSITIONS_CORRECTED: Float64MultiArray,
    topics.MOTOR_TRAJECTORY_CORRECTED: JointTrajectory,
    topics.POSE_ERROR_RESIDUAL: PoseWithCovarianceStamped,
    topics.POSE_ERROR_RESIDUAL_TASK: PoseWithCovarianceStamped,
    topics.MODEL_RESIDUAL: PoseWithCovarianceStamped,
    topics.MODEL_ALARM: Bool,
    topics.DIAGNOSTICS: DiagnosticArray,
    topics.JOINT_STATES: JointState,
}
"""The joint states last: who sees them heard knows that all the others are heard."""


class Recorder(Node):
    """Records until it is told to stop; the recording then takes its name.

    When the disk is full it ends, and says under which name it kept what it had written.

    Raises `InputError` if no output is named; `RecordingError` if the output exists or cannot be
    written.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("recorder", **options)
        declare(self, PARAMETERS)
        output = self.get_parameter("output").value
        if not output:
            raise InputError("recorder: the parameter output names no recording")
        self._begin_with = self.get_parameter("begin_with").value.split()
        self._looking = self.create_timer(1.0 / LOOKS_PER_S, self._look)
        # Last, so that nothing can fail between the opening and `destroy_node`.
        self._recording = ExitStack()
        self._writer = self._recording.enter_context(RecordingWriter(output, keep_partial=True))

    def _look(self) -> None:
        if not all(self.count_publishers(topics.relative(each)) for each in self._begin_with):
            return
        self._looking.cancel()
        group = DataGroup()
        for topic, message_type in TOPICS.items():
            package, kind, name = message_type.ros_type.split("/")
            self.create_subscription(
                getattr(import_module(f"{package}.{kind}"), name),
                topics.relative(topic),
                partial(self._on_message, channel_of(topic, message_type)),
                NOTES_QOS if topic == topics.RECORDING_NOTES else RECORDING_QOS,
                raw=True,
                callback_group=group,
            )

    def _on_message(self, channel: Channel, payload: bytes) -> None:
        self._writer.write_raw(channel, payload, self.get_clock().now().nanoseconds)

    def destroy_node(self) -> None:
        """Write what has been heard but not taken yet, and give the recording its name."""
        data = [each for each in self.subscriptions if isinstance(each.callback_group, DataGroup)]
        try:
            for _ in range(MOST_RUNS_AT_END):
                if not take_in_order(data):
                    break
        finally:
            # First the recording: a crash of the middleware as it ends must not cost it.
            try:
                self._recording.close()
            finally:
                super().destroy_node()
