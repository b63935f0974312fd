"""The one place of topic and frame names, and the map to the names in somebody's recording.

A name is that of a wrist in the root namespace, as it stands in a recording.  Live nodes use it
relative to their own namespace (`relative`), so that two wrists live side by side.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

from wrist_stiffness.errors import InputError

BASE_FRAME = "wrist_base"
PLATFORM_FRAME = "wrist_platform"
INSTRUMENT_FRAME = "instrument"
"""Of poses from an instrument of which nobody knows where it stands: they are registered."""

CORRECTED_FRAME = "wrist_corrected"
"""No frame: marks a command that was corrected, so that no second corrector does it again."""

MICROMETRES, MILLIDEGREES = 1e6, 180e3 / pi
"""By which numbers in m and rad are told larger to people, and on topics named _um and _mdeg."""

JOINT_STATES = "/joint_states"
LOAD_ESTIMATE = "/load_estimate"
TEMPERATURES = "/temperatures"
COVARIATES = "/covariates/"
PLATFORM_POSE = "/platform_pose_measured"
PLATFORM_MARKERS = "/platform_markers_measured"
GAUGE_READINGS = "/gauge_readings"
FRAME_POSE = "/frame_pose_measured"
MOTOR_COMMANDS = "/motor_commands"
MOTOR_TRAJECTORY = "/motor_trajectory"
PAYLOAD = "/payload"
RECORDING_NOTES = "/recording_notes"
TF, TF_STATIC = "/tf", "/tf_static"

POSE_ERROR_PREDICTED = "/pose_error_predicted"
POSE_ERROR_S_UM = "/pose_error/s_um"
POSE_ERROR_PHI_MDEG = "/pose_error/phi_mdeg"
WRIST_MARKERS = "/wrist_markers"
ROBOT_DESCRIPTION = "/robot_description"
MOTOR_COMMANDS_CORRECTED = "/motor_commands_corrected"
MOTOR_POSITIONS_CORRECTED = "/motor_positions_corrected"
MOTOR_TRAJECTORY_CORRECTED = "/motor_trajectory_corrected"
POSE_ERROR_RESIDUAL = "/pose_error_residual"
POSE_ERROR_RESIDUAL_TASK = "/pose_error_residual/task_point"
MODEL_RESIDUAL = "/model_residual"
MODEL_ALARM = "/model_alarm"
WRIST_STATUS = "/wrist_status"
DIAGNOSTICS = "/diagnostics"
PLATFORM_POSE_TRUE = "/cell_simulator/platform_pose_true"
"""Of the virtual cell alone."""

GLOBAL_TOPICS = (TF, TF_STATIC, DIAGNOSTICS)
"""One for all robots of a graph, by the conventions of tf2 and of the diagnostics' viewers."""

STANDARD_TOPICS = (
    JOINT_STATES,
    LOAD_ESTIMATE,
    TEMPERATURES,
    PLATFORM_POSE,
    PLATFORM_MARKERS,
    GAUGE_READINGS,
    FRAME_POSE,
    MOTOR_COMMANDS,
    MOTOR_TRAJECTORY,
    RECORDING_NOTES,
    TF_STATIC,
)
"""Topics that are read; besides these, any topic below ``/covariates/``."""


def relative(topic: str) -> str:
    """Return the name by which a node says or hears a topic within its namespace."""
    return topic if topic in GLOBAL_TOPICS else topic.removeprefix("/")


def parse_topic_remaps(remaps: Iterable[str]) -> dict[str, str]:
    """Parse ``STANDARD:=ACTUAL``, the form in which commands take topic names.

    `remaps`: one text for each topic; a leading slash may be left out, as in ROS.  Gives names in
    the recording by standard name.  Raises `InputError` if a text has another form, names no
    standard topic, or two speak of the same topic.
    """
    actual_by_standard: dict[str, str] = {}
    for remap in remaps:
        standard, separator, actual = (part.strip() for part in remap.partition(":="))
        if not (standard.strip("/") and separator and actual.strip("/")):
            raise InputError(f"topic {remap!r} is not of the form STANDARD:=ACTUAL")
        standard, actual = (name if name[0] == "/" else f"/{name}" for name in (standard, actual))
        if standard not in STANDARD_TOPICS and not standard.startswith(COVARIATES):
            known = ", ".join((*STANDARD_TOPICS, COVARIATES + "NAME"))
            raise InputError(f"{standard} is not a standard topic; these are {known}")
        if standard in actual_by_standard:
            raise InputError(f"topic {standard} is mapped twice, last by {remap!r}")
        if actual in actual_by_standard.values():
            raise InputError(f"topic {actual} is used for two standard topics, last by {remap!r}")
        actual_by_standard[standard] = actual
    return actual_by_standard
