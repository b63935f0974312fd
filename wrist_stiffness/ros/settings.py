"""The nodes' parameters, and the settings of the sample path that they stand for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.compensation.frames_yaml import frames_from_yaml
from wrist_stiffness.compensation.intake import MotorNames
from wrist_stiffness.compensation.objective import OBJECTIVES
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError
from wrist_stiffness.ros.parameters import ParameterEntry
from wrist_stiffness.shipped import shipped_file

SHIPPED_MODEL = "config/palmieri2015_model.yaml"

COMMON = (
    ParameterEntry("autostart", True, "configure and activate at the start", fixed=True),
    ParameterEntry("model_file", "", "model to load (YAML); empty for the shipped one"),
    ParameterEntry("motor_1_joint", "motor_1_joint", "joint name of motor 1"),
    ParameterEntry("motor_2_joint", "motor_2_joint", "joint name of motor 2"),
    ParameterEntry(
        "frames",
        "",
        "frames of load sensors (YAML): {FRAME_ID: {parent: wrist_base | wrist_platform, "
        "position_mm: [x, y, z], rpy_deg: [r, p, y], acts_on: platform | environment}}",
    ),
    ParameterEntry(
        "load_age_limit_s", 0.5, "oldest load that is still used [s]", lower=0.001, upper=3600.0
    ),
)

PREDICTION = (
    ParameterEntry(
        "load_wait_s",
        0.0,
        "longest wait for the load of a joint state [s]",
        lower=0.0,
        upper=1.0,
        fixed=True,
    ),
)

CORRECTION = (
    ParameterEntry("enabled_on_start", False, "correct from the start", fixed=True),
    ParameterEntry("objective", "pointing", "what the motors make right", choices=OBJECTIVES),
    ParameterEntry(
        "correction_limit_deg", 0.5, "largest correction of a motor [deg]", lower=0.0, upper=5.0
    ),
)


def stream_settings(values: Mapping[str, Any]) -> StreamSettings:
    """Return the settings of the sample path.

    Parameters
    ----------
    values : mapping
        Parameters by name; those of `CORRECTION` may be absent.

    Returns
    -------
    StreamSettings
        In SI units.

    Raises
    ------
    InputError
        If a text is not among its choices or the frames cannot be read.
    """
    default = StreamSettings()
    objective = values.get("objective", default.objective)
    if objective not in OBJECTIVES:
        raise InputError(f"objective: {objective!r} is not one of {', '.join(OBJECTIVES)}")
    if values["motor_1_joint"] == values["motor_2_joint"]:
        raise InputError(f"motor_1_joint, motor_2_joint: both are {values['motor_1_joint']!r}")
    limit_deg = values.get("correction_limit_deg", np.degrees(default.correction_limit))
    return StreamSettings(
        motors=MotorNames(values["motor_1_joint"], values["motor_2_joint"]),
        frames=frames_from_yaml(values["frames"]),
        load_age_limit_s=values["load_age_limit_s"],
        objective=objective,
        correction_limit=float(np.radians(limit_deg)),
    )


def model_path(named: str) -> Path:
    """Return the path of the model file that a parameter names, or of the shipped one."""
    return Path(named) if named else shipped_file(SHIPPED_MODEL)
