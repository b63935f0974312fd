"""Node `angle_corrector`: motor commands corrected for the predicted error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from wrist_stiffness.compensation.correction import Correction
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.parameters import CORRECTION, correction_settings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.trajectory import planned_point
from wrist_stiffness.errors import WristError
from wrist_stiffness.ros.conversions import nanoseconds
from wrist_stiffness.ros.qos import COMMAND_QOS, RELIABLE_QOS
from wrist_stiffness.ros.run import run
from wrist_stiffness.ros.stream_messages import (
    JointSample,
    angles_payload,
    error_payload,
    joint_payload,
    joint_reader,
)
from wrist_stiffness.ros.wrist_node import WristNode


class AngleCorrector(WristNode):
    """Forwards commands, corrected where that is safe, unchanged where it is not.

    A command that is not finite or lacks a motor is not forwarded.
    """

    stream: CorrectionStream

    def __init__(self, **options: Any) -> None:
        super().__init__("angle_corrector", CORRECTION, **options)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.autostart()

    def make_stream(self, settings: StreamSettings) -> CorrectionStream:
        """Return the correction stream."""
        return CorrectionStream(None, settings, self.get_parameter("enabled_on_start").value)

    def apply_values(self, values: Mapping[str, Any]) -> StreamSettings:
        """Check parameters and return the settings that they stand for."""
        return correction_settings(values)

    def facts(self) -> dict[str, str]:
        """Return whether commands are corrected."""
        return {
            "enabled": str(self.stream.enabled).lower(),
            "load": self.stream.supervision.state.value,
        }

    def restriction(self) -> str:
        """Return what keeps the node from correcting in full."""
        supervision = self.stream.supervision
        if self.stream.enabled and supervision.text:
            return f"{supervision.state.value}: {supervision.text}"
        return ""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make the outputs and load the model."""
        self._command = self.create_lifecycle_publisher(
            JointState, "/motor_commands_corrected", RELIABLE_QOS
        )
        self._positions = self.create_lifecycle_publisher(
            Float64MultiArray, "/motor_positions_corrected", RELIABLE_QOS
        )
        self._trajectory = self.create_lifecycle_publisher(
            JointTrajectory, "/motor_trajectory_corrected", RELIABLE_QOS
        )
        self._residual = self.create_lifecycle_publisher(
            PoseWithCovarianceStamped, "/pose_error_residual", RELIABLE_QOS
        )
        self._task_residual = self.create_lifecycle_publisher(
            PoseWithCovarianceStamped, "/pose_error_residual/task_point", RELIABLE_QOS
        )
        return super().on_configure(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Remove the outputs."""
        for publisher in (
            self._command,
            self._positions,
            self._trajectory,
            self._residual,
            self._task_residual,
        ):
            self.destroy_lifecycle_publisher(publisher)
        return super().on_cleanup(state)

    def make_inputs(self) -> list[Subscription]:
        """Listen to commands."""
        return [
            self.hear_bytes(
                JointState, "/motor_commands", joint_reader(), self._on_command, COMMAND_QOS
            ),
            self.hear(JointTrajectory, "/motor_trajectory", self._on_trajectory, COMMAND_QOS),
        ]

    def _on_command(self, joints: JointSample) -> None:
        stamp_ns = joints.stamp_ns
        try:
            command = self.stream.on_command(
                stamp_ns, joints.frame_id, joints.names, joints.positions, joints.velocities
            )
        except WristError as error:
            self.warn(error)
            return
        positions = tuple(command.positions.tolist())
        sent = joints._replace(frame_id=command.frame_id, positions=positions)
        self._command.publish(joint_payload(sent))
        self._positions.publish(angles_payload(command.theta))
        if command.fault is not None:
            self.warn(command.fault)
            return
        if command.correction is not None:
            self.left_out = command.correction.prediction.warnings
            self._publish_residual(stamp_ns, command.correction)
        self.health.good()

    def _publish_residual(self, stamp_ns: int, correction: Correction) -> None:
        twist, prediction = correction.after, correction.prediction
        self._residual.publish(error_payload(stamp_ns, twist, prediction.covariance))
        at_task_point = self.stream.residual_at_task_point(correction)
        if at_task_point is not None:
            self._task_residual.publish(error_payload(stamp_ns, *at_task_point))

    def _on_trajectory(self, message: JointTrajectory) -> None:
        # A zero stamp says "at once".
        stamp_ns = nanoseconds(message.header.stamp) or self.get_clock().now().nanoseconds
        try:
            names = message.joint_names
            points = [
                planned_point(len(names), point.positions, point.velocities, point.accelerations)
                for point in message.points
            ]
            trajectory = self.stream.on_trajectory(stamp_ns, message.header.frame_id, names, points)
        except WristError as error:
            self.warn(error)
            return
        message.header.frame_id = trajectory.frame_id
        for point, planned in zip(message.points, trajectory.points, strict=True):
            point.positions = planned.positions
            point.velocities = planned.velocities
            point.accelerations = planned.accelerations
        self._trajectory.publish(message)
        if trajectory.fault is not None:
            self.warn(trajectory.fault)
        else:
            self.health.good()

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.stream.enabled = request.data
        response.success = True
        response.message = f"correction is {'on' if request.data else 'off'}"
        return response


def main() -> int:
    """Run the node."""
    return run(AngleCorrector)


if __name__ == "__main__":
    raise SystemExit(main())
