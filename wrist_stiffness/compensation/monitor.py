"""Does the model still hold?  Residuals of the measured pose, their statistics and a change alarm.

The alarm is a two-sided CUSUM on each whitened component (Page 1954; Montgomery, "Introduction to
Statistical Quality Control", ch. 9), against a baseline that is learned first.  It finds a lasting
change of one standard deviation in some 30 samples.  It fails where the fault is there before the
baseline, where a change stays well below half a standard deviation, and, by false alarms, where the
noise is larger or longer correlated than it is said to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.error_model import Prediction


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
