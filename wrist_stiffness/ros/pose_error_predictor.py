"""Node `pose_error_predictor`: the platform's pose error for every joint state."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, Vector3Stamped
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from wrist_stiffness.commands.wrist_drawing import Pace, drawing_of
from wrist_stiffness.compensation.parameters import PREDICTION
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import WristError
from wrist_stiffness.mechanism.urdf import urdf
from wrist_stiffness.model.error_model import Prediction
from wrist_stiffness.ros.conversions import body_transforms, transforms_type
from wrist_stiffness.ros.qos import SENSOR_QOS, STATE_QOS
from wrist_stiffness.ros.stream_messages import (
    JointSample,
    error_payload,
    joint_reader,
    vector_payload,
)
from wrist_stiffness.ros.wrist_node import WristNode
from wrist_stiffness.topics import (
    JOINT_STATES,
    MICROMETRES,
    MILLIDEGREES,
    POSE_ERROR_PHI_MDEG,
    POSE_ERROR_PREDICTED,
    POSE_ERROR_S_UM,
    ROBOT_DESCRIPTION,
    TF,
    WRIST_MARKERS,
)

CHECKS_PER_WAIT = 4
"""How often, within the longest wait, overdue joint states are looked for."""


class PoseErrorPredictor(WristNode):
    """Publishes `/pose_error_predicted`; nothing for a sample that cannot be predicted.

    With `load_wait_s`, joint states wait for the load that belongs to them, in order of arrival: a
    load with their own or a later stamp, for then no other one can belong to them.
    """

    stream: PredictionStream

    def __init__(self, **options: Any) -> None:
        super().__init__("pose_error_predictor", PREDICTION, **options)
        self._pace = Pace()
        self._error = self.say(PoseWithCovarianceStamped, POSE_ERROR_PREDICTED)
        self._s_um = self.say(Vector3Stamped, POSE_ERROR_S_UM)
        self._phi_mdeg = self.say(Vector3Stamped, POSE_ERROR_PHI_MDEG)
        self._markers = self.say(MarkerArray, WRIST_MARKERS)
        self._description = self.say(String, ROBOT_DESCRIPTION, STATE_QOS)
        self._transforms_type = transforms_type()
        if self._transforms_type is not None:
            self._transforms = self.say(self._transforms_type, TF)
        self._wait_s = self.get_parameter("load_wait_s").value
        # with the end of their wait, by a clock that never jumps [s]
        self.waiting: deque[tuple[float, JointSample]] = deque()
        if self._wait_s > 0.0:
            self.every(self._wait_s / CHECKS_PER_WAIT, self.after_load)
        self.start()

    def make_stream(self, settings: StreamSettings) -> PredictionStream:
        """Return the prediction stream."""
        return PredictionStream(None, settings)

    def make_inputs(self) -> None:
        """Listen to the motors."""
        joints = joint_reader()
        self.hear(JointState, JOINT_STATES, self._on_joint_state, SENSOR_QOS, read=joints)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model, and tell viewers what its wrist looks like."""
        configured = super().on_configure(state)
        if self.stream.model is not None:
            motors = self.stream.settings.motors
            geometry = self.stream.model.table.geometry
            description = urdf(geometry, (motors.motor_1, motors.motor_2))
            self._description.publish(String(data=description))
        return configured

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the joint states that wait."""
        self.waiting.clear()
        return super().on_deactivate(state)

    def _on_joint_state(self, joints: JointSample) -> None:
        self.waiting.append((time.monotonic() + self._wait_s, joints))
        self.after_load()

    def after_load(self) -> None:
        """Predict for the joint states that need not wait any longer."""
        now_s, newest_ns = time.monotonic(), self.stream.loads.newest_ns
        while self.waiting:
            until_s, joints = self.waiting[0]
            has_load = newest_ns is not None and joints.stamp_ns <= newest_ns
            if not has_load and now_s < until_s:
                return
            self.waiting.popleft()
            try:
                self._predict(joints)
            except WristError as error:
                self.on_fault(error)

    def _predict(self, joints: JointSample) -> None:
        stamp_ns = joints.stamp_ns
        prediction = self.stream.on_joint_state(
            stamp_ns, joints.names, joints.positions, joints.velocities
        )
        frame, twist = self.base_frame, prediction.twist
        self._error.publish(error_payload(stamp_ns, twist, prediction.covariance, frame))
        if self._s_um.get_subscription_count():
            self._s_um.publish(vector_payload(stamp_ns, MICROMETRES * twist[:3], frame))
        if self._phi_mdeg.get_subscription_count():
            self._phi_mdeg.publish(vector_payload(stamp_ns, MILLIDEGREES * twist[3:], frame))
        self.health.good()
        self.left_out = prediction.warnings
        self._draw(stamp_ns, prediction)

    def _draw(self, stamp_ns: int, prediction: Prediction) -> None:
        rate_hz = self.get_parameter("marker_rate_hz").value
        if not self._pace.takes(stamp_ns, rate_hz):
            return
        if self._transforms_type is not None:
            poses = body_transforms(
                stamp_ns, prediction.configuration, self.stream.settings.frames.prefix
            )
            self._transforms.publish(self._transforms_type(transforms=poses))
        if not self._markers.get_subscription_count():
            return
        geometry = self.stream.running_model().model.table.geometry
        exaggeration = self.get_parameter("marker_exaggeration").value
        drawing = drawing_of(geometry, exaggeration, self.base_frame)
        at, twist = prediction.configuration.as_block, prediction.twist[None]
        self._markers.publish(*drawing.payloads(np.array([stamp_ns]), at, twist))
