"""The nodes' parameters, and the settings of the sample path that they stand for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.intake import Frames, MotorNames, checked_prefix, frames_from_yaml
from wrist_stiffness.compensation.monitor import MonitorSettings
from wrist_stiffness.compensation.objective import OBJECTIVES
from wrist_stiffness.compensation.payload import Thresholds
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError

ParameterValue = bool | int | float | str

COVARIATE = re.compile("[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter of a node."""

    name: str  # with its unit at the end where it has one
    default: ParameterValue  # also says the type
    text: str  # what it does, one line
    limits: tuple[float, float] | None = None  # least and largest number; None for any
    choices: tuple[str, ...] = ()  # allowed texts; empty for any
    fixed: bool = False  # can only be set at the start


def check_choices(entries: Sequence[ParameterEntry], values: Mapping[str, Any]) -> None:
    """Refuse a text that is not among its choices, which ROS itself cannot check.

    Raises `InputError` with the parameter, its value and the choices.
    """
    for entry in entries:
        if entry.choices and values[entry.name] not in entry.choices:
            raise InputError(
                f"{entry.name}: {values[entry.name]!r} is not one of {', '.join(entry.choices)}"
            )


FRAMES_PREFIXED = ParameterEntry(
    "frame_prefix",
    "",
    "before the names of all frames, on topics and in TF, so that wrists live side by side: left/",
    fixed=True,
)

COMMON = (
    ParameterEntry("autostart", True, "configure and activate at the start", fixed=True),
    ParameterEntry("model_file", "", "model to load (YAML); empty for the shipped one"),
    ParameterEntry(
        "model_load_limit_s",
        30.0,
        "longest time that the loading of a model may take [s]",
        (0.1, 3600.0),
    ),
    ParameterEntry(
        "allow_python_laws",
        False,
        "run the Python files that a model names as laws; only for models that you trust",
        fixed=True,
    ),
    ParameterEntry(
        "tare_needed", True, "warn while no tare was taken; false where the load comes tared"
    ),
    ParameterEntry(
        "tare_age_limit_s",
        3600.0,
        "oldest tare that is taken up again after a restart [s]",
        (0.0, 604800.0),
    ),
    ParameterEntry(
        "state_folder",
        "~/.ros/wrist_stiffness",
        "folder in which the tare outlives the node; empty to keep nothing",
        fixed=True,
    ),
    ParameterEntry("motor_1_joint", "motor_1_joint", "joint name of motor 1"),
    ParameterEntry("motor_2_joint", "motor_2_joint", "joint name of motor 2"),
    ParameterEntry(
        "frames",
        "",
        "frames of sensors (YAML): {FRAME_ID: {parent: wrist_base | wrist_platform, "
        "position_mm: [x, y, z], rpy_deg: [r, p, y], acts_on: platform | environment}}",
    ),
    FRAMES_PREFIXED,
    ParameterEntry(
        "covariates", "", "names of /covariates/NAME that the model uses, with blanks", fixed=True
    ),
    ParameterEntry("load_age_limit_s", 0.5, "oldest load that is still used [s]", (0.001, 3600.0)),
    ParameterEntry(
        "signal_age_limit_s",
        300.0,
        "oldest temperature or covariate that is still used [s]",
        (0.001, 86400.0),
    ),
)

PREDICTION = (
    ParameterEntry(
        "load_force_noise_n",
        0.0,
        "standard deviation of a force component; with load_moment_noise_nm 0 it is left out of "
        "the covariance [N]",
        (0.0, 1000.0),
    ),
    ParameterEntry(
        "load_moment_noise_nm", 0.0, "the same of a moment component at O [N m]", (0.0, 100.0)
    ),
    ParameterEntry(
        "load_wait_s", 0.0, "longest wait for the load of a joint state [s]", (0.0, 1.0), fixed=True
    ),
    ParameterEntry("marker_rate_hz", 10.0, "of /wrist_markers; 0 for none [1/s]", (0.0, 100.0)),
    ParameterEntry("marker_exaggeration", 1000.0, "factor on the error drawn [-]", (0.0, 1e6)),
)

PASS_THROUGH, STOP = "pass_through", "stop"

CORRECTION = (
    ParameterEntry("enabled_on_start", False, "correct from the start", fixed=True),
    ParameterEntry(
        "inactive_commands",
        PASS_THROUGH,
        "what becomes of commands while the node is not active, once the correction has faded out",
        choices=(PASS_THROUGH, STOP),
    ),
    ParameterEntry(
        "command_age_limit_s",
        0.5,
        "oldest command that is forwarded, like the reference timeout of ros2_control; 0 for any "
        "[s]",
        (0.0, 3600.0),
    ),
    ParameterEntry("objective", "pointing", "what the motors make right", choices=OBJECTIVES),
    ParameterEntry(
        "correction_limit_deg",
        0.5,
        "where a motor would need more than this there is no correction [deg]",
        (0.0, 5.0),
    ),
    ParameterEntry("slew_deg_s", 0.5, "fastest change of a correction [deg/s]", (0.001, 1000.0)),
    ParameterEntry(
        "deadband_steps",
        0.15,
        "error that a motor may leave before its correction moves [encoder steps]",
        (0.0, 10.0),
    ),
    ParameterEntry(
        "domain_fade_deg",
        2.0,
        "the correction fades within this distance from the border of the domain [deg]",
        (0.001, 45.0),
    ),
    ParameterEntry(
        "singularity_fade",
        0.05,
        "the correction fades within this distance of |D| from its limit [-]",
        (0.001, 0.5),
    ),
    ParameterEntry(
        "load_policy",
        "judge",
        "what is corrected for: judge: a payload that is recognised or told; follow: every load as "
        "it is measured, only where it cannot be a contact",
        choices=("judge", "follow"),
    ),
    ParameterEntry(
        "model_doubt",
        2.0,
        "the wrist may be so many times stiffer or softer than the model; with load_policy judge "
        "1/x of the correction is applied, which never goes past the aim [-]",
        (1.0, 10.0),
    ),
    ParameterEntry(
        "contact_force_n",
        0.05,
        "force by which a load departs that is another load; never below five times the scatter "
        "that the tare found [N]",
        (0.001, 1000.0),
    ),
    ParameterEntry("contact_moment_nm", 0.002, "the same of a moment at O [N m]", (0.00001, 100.0)),
)

POSE_TYPES = ("PoseStamped", "PoseWithCovarianceStamped")

MONITOR = tuple(
    replace(entry, fixed=True)
    for entry in (
        ParameterEntry(
            "pose_type",
            POSE_TYPES[0],
            "message type of /platform_pose_measured",
            choices=POSE_TYPES,
        ),
        ParameterEntry(
            "noise_s_um", 1.0, "standard deviation of a measured coordinate [um]", (0.001, 1e6)
        ),
        ParameterEntry(
            "noise_phi_mdeg", 2.0, "standard deviation of a measured angle [mdeg]", (0.001, 1e6)
        ),
        ParameterEntry(
            "joint_age_limit_s",
            0.02,
            "oldest joint state that is matched with a pose [s]",
            (0.0, 10.0),
        ),
        ParameterEntry(
            "frame_age_limit_s",
            1.0,
            "oldest pose of the frame that is taken out of a pose, once one was measured [s]",
            (0.0, 3600.0),
        ),
        ParameterEntry(
            "baseline_samples", 500, "poses from which the baseline is learned", (1, 1e6)
        ),
        ParameterEntry(
            "alarm_threshold",
            15.0,
            "sum of deviations at which there is an alarm [standard deviations]",
            (1.0, 1e6),
        ),
    )
)


def monitor_settings(values: Mapping[str, Any]) -> MonitorSettings:
    """Return what counts as a change, from the parameters `MONITOR` by name.

    Raises `InputError` if a text is not among its choices.
    """
    check_choices(MONITOR, values)
    noise = np.repeat([1e-6 * values["noise_s_um"], radians(1e-3 * values["noise_phi_mdeg"])], 3)
    return MonitorSettings(
        noise,
        values["baseline_samples"],
        threshold=values["alarm_threshold"],
        joint_age_limit_s=values["joint_age_limit_s"],
        frame_age_limit_s=values["frame_age_limit_s"],
    )


def stream_settings(values: Mapping[str, Any]) -> StreamSettings:
    """Return the settings of the sample path, in SI units.

    `values`: parameters of `COMMON`, `PREDICTION` and `CORRECTION` by name; those that a node does
    not have are at their defaults.  Raises `InputError` if the motors have not two names, the
    frames cannot be read or a text is not among its choices.
    """
    entries = (*COMMON, *PREDICTION, *CORRECTION)
    values = {entry.name: entry.default for entry in entries} | dict(values)
    check_choices(entries, values)
    motors = MotorNames(values["motor_1_joint"], values["motor_2_joint"])
    first, second = motors.motor_1, motors.motor_2
    if not first or not second or first == second:
        raise InputError(f"motor_1_joint, motor_2_joint: {first!r}, {second!r} are not two names")
    for name in values["covariates"].split():
        if not COVARIATE.fullmatch(name):
            raise InputError(
                f"covariates: {name!r} cannot be the name of a topic: a letter, then letters, "
                "digits and _"
            )
    prefix = checked_prefix(values["frame_prefix"])
    sensors = frames_from_yaml(values["frames"]).sensors
    own = {name.removeprefix(prefix): sensor for name, sensor in sensors.items()}
    noise = np.repeat([values["load_force_noise_n"], values["load_moment_noise_nm"]], 3)
    return StreamSettings(
        motors=motors,
        frames=Frames(own, prefix),
        load_age_limit_s=values["load_age_limit_s"],
        signal_age_limit_s=values["signal_age_limit_s"],
        load_noise=noise if noise.any() else None,
        marker_rate_hz=values["marker_rate_hz"],
        marker_exaggeration=values["marker_exaggeration"],
        objective=values["objective"],
        correction_limit=radians(values["correction_limit_deg"]),
        safety=SafetySettings(
            slew=radians(values["slew_deg_s"]),
            deadband_steps=values["deadband_steps"],
            domain_fade=radians(values["domain_fade_deg"]),
            singularity_fade=values["singularity_fade"],
        ),
        supervisor=SupervisorSettings(
            Thresholds(values["contact_force_n"], values["contact_moment_nm"]),
            values["model_doubt"],
            follow=values["load_policy"] == "follow",
        ),
    )
