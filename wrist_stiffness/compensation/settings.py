"""What nodes and replay can be told, the same for both."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.intake import Frames, MotorNames
from wrist_stiffness.compensation.objective import ObjectiveName
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.mechanism.components import Array


@dataclass(frozen=True)
class StreamSettings:
    """Names, frames and limits of the sample path."""

    motors: MotorNames = field(default_factory=MotorNames)  # joint names of the motors
    frames: Frames = field(default_factory=Frames)  # frames in which loads arrive
    load_age_limit_s: float = 0.5  # oldest load that is still used [s]
    signal_age_limit_s: float = 300.0  # oldest temperature or covariate that is still used [s]
    # (6,), standard deviation of force and moment at O; None leaves it out of covariances [N, N m]
    load_noise: Array | None = None
    objective: ObjectiveName = "pointing"  # what the correction makes right
    # largest correction of a motor angle; where more would be needed the model is not believed and
    # there is none [rad]
    correction_limit: float = float(np.radians(0.5))
    # how the correction may change and where it fades
    safety: SafetySettings = field(default_factory=SafetySettings)
    # what of the load is taken for a payload
    supervisor: SupervisorSettings = field(default_factory=SupervisorSettings)
    # `marker_rate_hz`, `marker_exaggeration`: how often the wrist is drawn [1/s], and the factor on
    # its error [-]
    marker_rate_hz: float = 10.0
    marker_exaggeration: float = 1000.0
