"""Does the model still hold?  Residuals of the measured pose, their statistics and a change alarm.

A measured pose finds its joint state and its load, by stamps.  It comes as a pose or as the places
of markers; where a target on the wrist's frame is measured too, the frame's motion is taken out.

The alarm is a two-sided CUSUM on each whitened component (Page 1954; Montgomery, "Introduction to
Statistical Quality Control", ch. 9), against a baseline that is learned first.  It finds a lasting
change of one standard deviation in some 30 samples.  It fails where the fault is there before the
baseline, where a change stays well below half a standard deviation, and, by false alarms, where the
noise is larger or longer correlated than it is said to be.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wrist_stiffness.compensation.measured_pose import (
    NOT_MEASURED,
    FrameMotion,
    measured_pose,
    newest_before,
    pose_of_markers,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.error_model import ErrorModel, Prediction


def residual_of_pose(rotation: Array, position: Array, prediction: Prediction) -> Array:
    """Return log(T_err,measured T_err,predicted^-1).

    `rotation` (3, 3): measured rotation U -> F of the platform; `position` (3,): measured place of
    the platform's point O in F [m]; `prediction`: at the measured motor angles.  Gives (6,): twist
    at O in F, measured minus predicted [m, rad].
    """
    bent, shift = prediction.motion
    left = rotation @ prediction.configuration.platform.T @ bent.T
    return log_motion(left, position - left @ shift)


@dataclass(frozen=True)
class MonitorSettings:
    """What counts as a change."""

    noise: Array  # (6,), standard deviation of the measured pose, positive [m, rad]
    baseline: int = 500  # samples from which the baseline is learned
    slack: float = 0.5  # changes below this are not counted [standard deviations]
    # sum at which there is an alarm [standard deviations]; 15 means one false alarm in about a
    # million samples of white noise
    threshold: float = 15.0
    # oldest joint state and oldest pose of the frame that are still matched with a pose [s]
    joint_age_limit_s: float = 0.02
    frame_age_limit_s: float = 1.0


class ResidualMonitor:
    """Statistics and change alarm over a stream of residuals.

    `settings`: what counts as a change.
    """

    def __init__(self, settings: MonitorSettings) -> None:
        self._settings = settings
        self.count = 0  # residuals taken in
        self.alarm = False  # whether the residuals have left the baseline
        self._mean = np.zeros(6)
        self._squares = np.zeros(6)
        self._whitened_squares = np.zeros(6)
        self._sums = np.zeros((2, 6))

    @property
    def learning(self) -> bool:
        """Whether the baseline is still being learned."""
        return self.count < self._settings.baseline

    @property
    def rms(self) -> Array:
        """RMS of the residuals so far, (6,) [m, rad]."""
        return np.sqrt(self._squares / max(self.count, 1))

    @property
    def ratio(self) -> float:
        """RMS of the whitened residuals after the baseline: 1 where the noise is as stated."""
        after = max(self.count - self._settings.baseline, 1)
        return float(np.sqrt(self._whitened_squares.mean() / after))

    def add(self, residual: Array, model_variance: Array) -> None:
        """Take in a residual.

        `residual` (6,): measured minus predicted [m, rad]; NaN where not measured; `model_variance`
        (6,): variance of the prediction [m^2, rad^2].
        """
        measured = np.where(np.isfinite(residual), residual, self._mean)
        learning = self.learning
        self.count += 1
        self._squares += measured**2
        if learning:
            self._mean = self._mean + (measured - self._mean) / self.count
            return
        scale = np.sqrt(self._settings.noise**2 + model_variance)
        z = (measured - self._mean) / scale
        self._whitened_squares += z**2
        moved = self._sums + np.stack([z, -z]) - self._settings.slack
        # Not higher than twice the threshold, so that an end of the change is seen in due time.
        self._sums = np.clip(moved, 0.0, 2.0 * self._settings.threshold)
        self.alarm = bool(np.any(self._sums > self._settings.threshold))


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

    def _used(self, model: ErrorModel) -> ErrorModel:
        """Take the uncertainty of what is measured: what a registration hides never changes."""
        model = super()._used(model)
        joint = model.joint
        return model if joint is None else replace(model, joint=joint.as_measured)

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
