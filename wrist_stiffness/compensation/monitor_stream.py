"""A measured pose finds its joint state and its load, by stamps, and becomes a residual."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import BASE_FRAME
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.monitor import (
    MonitorSettings,
    ResidualMonitor,
    residual_of_pose,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel

JOINT_STATES_KEPT = 1024

JointStateKept = tuple[int, Array, Array | None]
"""Stamp [ns], motor angles [rad] and, where given, motor speeds [rad/s]."""

NOT_MEASURED = 1.0
"""A variance of this or more says that a component is not measured [m^2, rad^2]."""

UNIT_TOLERANCE = 1e-3
"""Largest deviation of a quaternion's norm from one."""


@dataclass(frozen=True)
class MonitoredPose:
    """Residual of one measured pose.

    Parameters
    ----------
    residual : (6,) float
        Measured minus predicted; NaN where not measured [m, rad].
    covariance : (6, 6) float
        Of measurement and prediction together.
    """

    residual: Array
    covariance: Array


class MonitorStream(Stream):
    """Residual for every measured pose.

    Parameters
    ----------
    model : ErrorModel or None
        May be replaced between samples; the baseline is then learned anew.
    settings : StreamSettings
        Names, frames, limits.
    monitoring : MonitorSettings
        What counts as a change.
    joint_age_limit_s : float
        Oldest joint state that is still matched with a pose [s].
    """

    def __init__(
        self,
        model: ErrorModel | None,
        settings: StreamSettings,
        monitoring: MonitorSettings,
        joint_age_limit_s: float,
    ) -> None:
        super().__init__(model, settings)
        self._monitoring = monitoring
        self._age_limit_ns = round(joint_age_limit_s * NANOSECONDS)
        self._joints: deque[JointStateKept] = deque(maxlen=JOINT_STATES_KEPT)
        self._judged: ErrorModel | None = None
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

        Parameters
        ----------
        stamp_ns : int
            Its stamp [ns].
        frame_id : str
            Must be `wrist_base`.
        position, quaternion : sequence of 3 and 4 float
            Of the platform, U -> F; [m], x y z w.
        variance : (6,) float, optional
            Of the measurement, where it says so; huge where not measured [m^2, rad^2].

        Returns
        -------
        MonitoredPose
            To be published with the pose's stamp.

        Raises
        ------
        WristError
            If the pose is not usable or no joint state or load belongs to it.
        """
        if frame_id != BASE_FRAME:
            raise FrameError(f"measured pose: frame '{frame_id}' is not {BASE_FRAME}")
        numbers = np.array([*position, *quaternion], dtype=float)
        if not np.all(np.isfinite(numbers)):
            raise InputError(f"measured pose: {numbers.tolist()} is not finite")
        norm = float(np.linalg.norm(numbers[3:]))
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            raise InputError(f"measured pose: quaternion has the norm {norm:.4g}, not 1")
        theta, theta_dot = self._joints_at(stamp_ns)
        running = self.running_model()
        prediction = running.advance(stamp_ns, theta, self.loads.at(stamp_ns)[1], theta_dot)
        rotation = Rotation.from_quat(numbers[3:]).as_matrix()
        residual = residual_of_pose(rotation, numbers[:3], prediction)
        noise = self._monitoring.noise**2
        if variance is not None:
            residual = np.where(variance < NOT_MEASURED, residual, np.nan)
            noise = np.maximum(noise, variance)
        if running.model is not self._judged:
            self._judged, self.monitor = running.model, ResidualMonitor(self._monitoring)
        excess = noise - self._monitoring.noise**2
        self.monitor.add(residual, np.diag(prediction.covariance) + excess)
        return MonitoredPose(residual, prediction.covariance + np.diag(noise))

    def _joints_at(self, stamp_ns: int) -> tuple[Array, Array | None]:
        newest = next((kept for kept in reversed(self._joints) if kept[0] <= stamp_ns), None)
        if newest is None:
            raise InputError("measured pose: no joint state with a stamp before it")
        joint_stamp_ns, theta, theta_dot = newest
        if stamp_ns - joint_stamp_ns > self._age_limit_ns:
            raise InputError(
                f"measured pose: newest joint state is {(stamp_ns - joint_stamp_ns) * 1e-9:.3f} s "
                f"older (limit {self._age_limit_ns * 1e-9:g} s)"
            )
        return theta, theta_dot
