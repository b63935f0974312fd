"""Standard topic names, and the map to the names in somebody's recording."""

from __future__ import annotations

from collections.abc import Iterable

from wrist_stiffness.errors import InputError

JOINT_STATES = "/joint_states"
LOAD_ESTIMATE = "/load_estimate"
TEMPERATURES = "/temperatures"
COVARIATES = "/covariates/"
PLATFORM_POSE = "/platform_pose_measured"
PLATFORM_MARKERS = "/platform_markers_measured"
FRAME_POSE = "/frame_pose_measured"
MOTOR_COMMANDS = "/motor_commands"
MOTOR_TRAJECTORY = "/motor_trajectory"
RECORDING_NOTES = "/recording_notes"
TF_STATIC = "/tf_static"

STANDARD_TOPICS = (
    JOINT_STATES,
    LOAD_ESTIMATE,
    TEMPERATURES,
    PLATFORM_POSE,
    PLATFORM_MARKERS,
    FRAME_POSE,
    MOTOR_COMMANDS,
    MOTOR_TRAJECTORY,
    RECORDING_NOTES,
    TF_STATIC,
)
"""Topics that are read; besides these, any topic below ``/covariates/``."""


def parse_topic_remaps(remaps: Iterable[str]) -> dict[str, str]:
    """Parse ``STANDARD:=ACTUAL``, the form in which commands take topic names.

    Parameters
    ----------
    remaps : Iterable[str]
        One text for each topic; a leading slash may be left out, as in ROS.

    Returns
    -------
    dict[str, str]
        Name in the recording, by standard name.

    Raises
    ------
    InputError
        If a text has another form, names no standard topic, or two speak of the same topic.
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
