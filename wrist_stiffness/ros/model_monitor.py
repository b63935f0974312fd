"""Node `model_monitor`: measured against predicted pose, and an alarm when that changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from wrist_stiffness.compensation.measured_pose import NOT_MEASURED
from wrist_stiffness.compensation.monitor import MonitoredPose, MonitorStream
from wrist_stiffness.compensation.parameters import MONITOR, POSE_TYPES, monitor_settings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.ros.conversions import nanoseconds, pose_numbers, three
from wrist_stiffness.ros.parameters import values_of
from wrist_stiffness.ros.qos import SENSOR_QOS, STATE_QOS
from wrist_stiffness.ros.stream_messages import JointSample, error_payload, joint_reader
from wrist_stiffness.ros.wrist_node import WristNode
from wrist_stiffness.topics import (
    FRAME_POSE,
    JOINT_STATES,
    MODEL_ALARM,
    MODEL_RESIDUAL,
    PLATFORM_MARKERS,
    PLATFORM_POSE,
)


class ModelMonitor(WristNode):
    """Publishes `/model_residual` and `/model_alarm` for every measured pose."""

    stream: MonitorStream

    def __init__(self, **options: Any) -> None:
        super().__init__("model_monitor", MONITOR, **options)
        self._residual = self.say(PoseWithCovarianceStamped, MODEL_RESIDUAL)
        self._alarm = self.say(Bool, MODEL_ALARM, STATE_QOS)
        self.start()

    def make_stream(self, settings: StreamSettings) -> MonitorStream:
        """Return the monitor's stream."""
        return MonitorStream(None, settings, monitor_settings(values_of(self, MONITOR)))

    def facts(self) -> dict[str, str]:
        """Return the residuals' statistics."""
        monitor = self.stream.monitor
        s_um, phi_mdeg = 1e6 * monitor.rms[:3], 1e3 * np.degrees(monitor.rms[3:])
        return {
            "residuals": str(monitor.count),
            "baseline": "being learned" if monitor.learning else "learned",
            "rms s [um]": f"{np.linalg.norm(s_um):.3f}",
            "rms phi [mdeg]": f"{np.linalg.norm(phi_mdeg):.3f}",
            "rms over expected noise": "" if monitor.learning else f"{monitor.ratio:.3f}",
            "alarm": str(monitor.alarm).lower(),
            "poses of the frame": str(self.stream.frame.count),
        }

    def restriction(self) -> str:
        """Return the alarm."""
        return "the residuals have changed" if self.stream.monitor.alarm else ""

    def make_inputs(self) -> None:
        """Listen to the motors and to the pose sensor; a topic can only have one type."""
        joints = joint_reader()
        self.hear(JointState, JOINT_STATES, self._on_joints, SENSOR_QOS, read=joints)
        # The frame before the platform: it is taken out of the pose of the same stamp.
        self.hear(PoseStamped, FRAME_POSE, self._on_frame_pose, SENSOR_QOS)
        if self.get_parameter("pose_type").value == POSE_TYPES[1]:
            pose = self._on_pose_with_covariance
            self.hear(PoseWithCovarianceStamped, PLATFORM_POSE, pose, SENSOR_QOS)
        else:
            self.hear(PoseStamped, PLATFORM_POSE, self._on_pose, SENSOR_QOS)
        self.hear(PoseArray, PLATFORM_MARKERS, self._on_markers, SENSOR_QOS)

    def _on_joints(self, joints: JointSample) -> None:
        self.stream.on_joint_state(
            joints.stamp_ns, joints.names, joints.positions, joints.velocities
        )

    def _on_frame_pose(self, message: PoseStamped) -> None:
        header = message.header
        self.stream.on_frame_pose(
            nanoseconds(header.stamp), header.frame_id, *pose_numbers(message.pose)
        )

    def _on_pose(self, message: PoseStamped) -> None:
        self._judge(message.header, self.stream.on_pose, *pose_numbers(message.pose))

    def _on_pose_with_covariance(self, message: PoseWithCovarianceStamped) -> None:
        variance = np.reshape(message.pose.covariance, (6, 6)).diagonal()
        numbers = pose_numbers(message.pose.pose)
        self._judge(message.header, self.stream.on_pose, *numbers, variance)

    def _on_markers(self, message: PoseArray) -> None:
        points = [three(pose.position) for pose in message.poses]
        self._judge(message.header, self.stream.on_markers, points)

    def _judge(self, header: Header, judge: Callable[..., MonitoredPose], *measured: Any) -> None:
        stamp_ns = nanoseconds(header.stamp)
        judged = judge(stamp_ns, header.frame_id, *measured)
        self.left_out = judged.warnings
        # What is not measured is sent as zero with a huge variance: poses cannot carry a NaN.
        residual = np.nan_to_num(judged.residual)
        covariance = judged.covariance + np.diag(NOT_MEASURED * np.isnan(judged.residual))
        self._residual.publish(error_payload(stamp_ns, residual, covariance, self.base_frame))
        self._alarm.publish(Bool(data=self.stream.monitor.alarm))
        self.health.good()
