"""What nodes and replay can be told, the same for both."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wrist_stiffness.compensation.intake import Frames, MotorNames
from wrist_stiffness.compensation.objective import ObjectiveName
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.supervision import SupervisorSettings
from wrist_stiffness.mechanism.components import Array


@dataclass(frozen=True)
class StreamSettings:
    """Names, frames and limits of the sample path.

    Parameters
    ----------
    motors : MotorNames
        Joint names of the motors.
    frames : Frames
        Frames in which loads arrive.
    load_age_limit_s : float
        Oldest load that is still used [s].
    signal_age_limit_s : float
        Oldest temperature or covariate that is still used [s].
    load_noise : (6,) float, optional
        Standard deviation of force and moment at O; None leaves it out of covariances [N, N m].
    objective : str
        What the correction makes right.
    correction_limit : float
        Largest correction of a motor angle; where more would be needed the model is not believed
        and there is none [rad].
    safety : SafetySettings
        How the correction may change and where it fades.
    supervisor : SupervisorSettings
        What of the load is taken for a payload.
    marker_rate_hz, marker_exaggeration : float
        How often the wrist is drawn [1/s], and the factor on its error [-].
    """

    motors: MotorNames = field(default_factory=MotorNames)
    frames: Frames = field(default_factory=Frames)
    load_age_limit_s: float = 0.5
    signal_age_limit_s: float = 300.0
    load_noise: Array | None = None
    objective: ObjectiveName = "pointing"
    correction_limit: float = float(np.radians(0.5))
    safety: SafetySettings = field(default_factory=SafetySettings)
    supervisor: SupervisorSettings = field(default_factory=SupervisorSettings)
    marker_rate_hz: float = 10.0
    marker_exaggeration: float = 1000.0
