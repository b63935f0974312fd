"""A measured pose finds its joint state and its load, by stamps, and becomes a residual.

It comes as a pose or as the places of markers; where a target on the wrist's frame is measured too,
the frame's motion is taken out first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wrist_stiffness.compensation.measured_pose import (
    NOT_MEASURED,
    FrameMotion,
    measured_pose,
    newest_before,
    pose_of_markers,
)
from wrist_stiffness.compensation.monitor import (
    MonitorSettings,
    ResidualMonitor,
    residual_of_pose,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel

JOINT_STATES_KEPT = 1024

JointStateKept = tuple[int, Array, Array | None]
"""Stamp [ns], motor angles [rad] and, where given, motor speeds [rad/s]."""


@dataclass(frozen=True)
class MonitoredPose:
    """Residual of one measured pose."""

    residual: Array  # (6,), measured minus predicted; NaN where not measured [m, rad]
    covariance: Array  # (6, 6), of measurement and prediction together
    warnings: tuple[str, ...]  # of the prediction


class MonitorStream(Stream):
    """Residual for every measured pose.

    `model`: may be replaced between samples; the baseline is then learned anew.  `monitoring`: what
    counts as a change.
    """

    def __init__(
        self, model: ErrorModel | None, settings: StreamSettings, monitoring: MonitorSettings
    ) -> None:
        super().__init__(model, settings)
        self._monitoring = monitoring
        self._joints: deque[JointStateKept] = deque(maxlen=JOINT_STATES_KEPT)
        # motion of the wrist's frame, where a target on it is measured
        self.frame = FrameMotion(monitoring.frame_age_limit_s)
        self._judged: ErrorModel | None = None
        # statistics and alarm since the model was loaded
        self.monitor = ResidualMonitor(monitoring)

    def on_joint_state(
        self,
        stamp_ns: int,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
    ) -> None:
        """Keep a joint state (see `MotorNames.angles` for its errors)."""
        motors = self.settings.motors
        theta, theta_dot = motors.angles(names, positions), motors.speeds(names, velocities)
        self._joints.append((stamp_ns, theta, theta_dot))

    def on_pose(
        self,
        stamp_ns: int,
        frame_id: str,
        position: Sequence[float],
        quaternion: Sequence[float],
        variance: Array | None = None,
    ) -> MonitoredPose:
        """Compare a measured pose with the prediction.

        `stamp_ns`: its stamp [ns].  `frame_id`: `wrist_base`, or mapped to it.  `position`,
        `quaternion`: of the platform, U -> F; [m], x y z w.  `variance` (6,): of the measurement,
        where it says so; huge where not measured [m^2, rad^2].  Gives `MonitoredPose`: to be
        published with the pose's stamp.  Raises `WristError` if the pose is not usable or no joint
        state, load or pose of the frame belongs to it.
        """
        rotation, place = measured_pose(self.loads.frames, frame_id, position, quaternion)
        if variance is not None:
            turn, _ = self.loads.frames.in_base(frame_id, "measured pose")
            variance = np.ravel(np.reshape(variance, (2, 3)) @ (turn.T**2))
        return self._judge(stamp_ns, rotation, place, variance)

    def on_markers(self, stamp_ns: int, frame_id: str, points: ArrayLike) -> MonitoredPose:
        """Compare the platform's pose that its markers tell with the prediction.

        `stamp_ns`: their stamp [ns].  `frame_id`: `wrist_base`, or mapped to it.  `points` (n, 3):
        the geometry's readout points in their order [m]; NaN where lost.  Gives `MonitoredPose`: to
        be published with the markers' stamp.  Raises `WristError` if too few are seen, or as
        `on_pose`.
        """
        nominal = self.running_model().model.table.geometry.platform.readout_points
        pose = pose_of_markers(self.loads.frames, frame_id, points, nominal)
        return self._judge(stamp_ns, *pose, None)

    def on_frame_pose(
        self,
        stamp_ns: int,
        frame_id: str,
        position: Sequence[float],
        quaternion: Sequence[float],
    ) -> None:
        """Keep a pose of the target on the frame (parameters and errors as those of `on_pose`)."""
        what = "measured frame pose"
        pose = measured_pose(self.loads.frames, frame_id, position, quaternion, what)
        self.frame.add(stamp_ns, *pose)

    def _judge(
        self, stamp_ns: int, rotation: Array, position: Array, variance: Array | None
    ) -> MonitoredPose:
        rotation, position = self.frame.taken_out(stamp_ns, rotation, position)
        limit_s = self._monitoring.joint_age_limit_s
        _, theta, theta_dot = newest_before(self._joints, stamp_ns, limit_s, "joint state")
        running = self.running_model()
        prediction = running.advance(stamp_ns, theta, self.loads.at(stamp_ns)[1], theta_dot)
        residual = residual_of_pose(rotation, position, prediction)
        noise = self._monitoring.noise**2
        if variance is not None:
            residual = np.where(variance < NOT_MEASURED, residual, np.nan)
            noise = np.maximum(noise, variance)
        if running.model is not self._judged:
            self._judged, self.monitor = running.model, ResidualMonitor(self._monitoring)
        excess = noise - self._monitoring.noise**2
        self.monitor.add(residual, np.diag(prediction.covariance) + excess)
        return MonitoredPose(residual, prediction.covariance + np.diag(noise), prediction.warnings)
