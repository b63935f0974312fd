"""What nodes and replay can be told, the same for both."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wrist_stiffness.compensation.intake import Frames, MotorNames
from wrist_stiffness.compensation.objective import ObjectiveName


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
    objective : str
        What the correction makes right.
    correction_limit : float
        Largest correction of a motor angle [rad].
    """

    motors: MotorNames = field(default_factory=MotorNames)
    frames: Frames = field(default_factory=Frames)
    load_age_limit_s: float = 0.5
    objective: ObjectiveName = "pointing"
    correction_limit: float = float(np.radians(0.5))
