"""What correction bought: true pose errors of a recorded run, without and with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import MotorNames
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.recording.messages import JointState, PoseStamped, PoseWithCovarianceStamped
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.topics import (
    CORRECTED_FRAME,
    MOTOR_COMMANDS,
    MOTOR_COMMANDS_CORRECTED,
    PLATFORM_POSE_TRUE,
    POSE_ERROR_RESIDUAL,
)

SETTLED_NS = 300_000_000
"""A pose counts once its command has rested this long: the motors' lag is no elastic error."""


@dataclass(frozen=True)
class Pass:
    """The settled samples of one pass of the motion.

    Parameters
    ----------
    time_s : (n,) float
        Since the recording's first command [s].
    pointing : (n,) float
        True angle between the platform's normal and the commanded one [rad].
    shift : (n,) float
        True |s| against the commanded pose [m].
    shift_handed_on : (n,) float
        |s| less what `/pose_error_residual` said: what is left once a Cartesian manipulator has
        taken it over; NaN where the node said nothing [m].
    floor : float
        RMS pointing error that the encoder step alone makes at these poses [rad].
    """

    time_s: Array
    pointing: Array
    shift: Array
    shift_handed_on: Array
    floor: float


def rms(values: Array) -> float:
    """Return the root mean square of the finite values; NaN if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else float("nan")


def before_and_after(recording: str | Path, table: Table) -> tuple[Pass, Pass]:
    """Compare true poses with commanded ones, without and with correction.

    Parameters
    ----------
    recording : path
        Of a virtual cell that ran with the corrector first off, then on.
    table : Table
        For the commanded poses and the encoder step.

    Returns
    -------
    before, after : Pass
        Settled samples of both.

    Raises
    ------
    RecordingError
        If the recording lacks a topic, or correction was never on, or never off.
    """
    commands, poses, residuals, switched_ns = _read(recording)
    stamps = np.array([stamp for stamp, _ in commands])
    angles = np.array([theta for _, theta in commands])
    moved = np.concatenate([[True], np.any(np.diff(angles, axis=0) != 0.0, axis=1)])
    since = np.maximum.accumulate(np.where(moved, stamps, 0))
    rows = []
    for stamp, position, quaternion in poses:
        place = int(np.searchsorted(stamps, stamp, side="right")) - 1
        if place < 0 or stamp - since[place] < SETTLED_NS:
            continue
        said = residuals.get(int(stamps[place]), np.full(3, np.nan))
        rows.append((stamp - stamps[0], *angles[place], *position, *quaternion, *said))
    if not rows:
        raise RecordingError(f"{recording}: no command rested for {SETTLED_NS / 1e9:g} s")
    data = np.array(rows)
    before = data[:, 0] < switched_ns - stamps[0]
    if before.all() or not before.any():
        raise RecordingError(f"{recording}: correction was not both off and on")
    return _pass(data[before], table), _pass(data[~before], table)


def _pass(data: Array, table: Table) -> Pass:
    time_ns, theta, position, quaternion, said = np.split(data, [1, 3, 6, 10], axis=1)
    desired = table.mechanism.forward(theta)
    rotation = Rotation.from_quat(quaternion).as_matrix()
    twist = log_motion(rotation @ np.swapaxes(desired.platform, -1, -2), position)
    platform = table.geometry.platform
    objective = Objective("pointing", platform.normal, platform.tool_point)
    pointing, floor = np.empty(len(data)), np.empty(len(data))
    jacobian = table.mechanism.jacobian(desired)
    step = table.geometry.limits.encoder_step
    for i, pose in enumerate(theta):
        task = objective.matrix(table.mechanism.forward(pose))
        pointing[i] = np.linalg.norm(task @ twist[i])
        floor[i] = step / np.sqrt(12.0) * np.linalg.norm(task[:, 3:] @ jacobian[i])
    return Pass(
        time_s=time_ns[:, 0] * 1e-9,
        pointing=pointing,
        shift=np.linalg.norm(position, axis=1),
        shift_handed_on=np.linalg.norm(position - said, axis=1),
        floor=rms(floor),
    )


def _read(
    recording: str | Path,
) -> tuple[
    list[tuple[int, Array]],
    list[tuple[int, tuple[float, ...], tuple[float, ...]]],
    dict[int, Array],
    int,
]:
    motors = MotorNames()
    commands: list[tuple[int, Array]] = []
    poses: list[tuple[int, tuple[float, ...], tuple[float, ...]]] = []
    residuals: dict[int, Array] = {}
    switched_ns: int | None = None
    source = open_recording(recording)
    for topic, _, message in source.messages(
        [MOTOR_COMMANDS, PLATFORM_POSE_TRUE, MOTOR_COMMANDS_CORRECTED, POSE_ERROR_RESIDUAL]
    ):
        if isinstance(message, JointState):
            stamp = message.header.stamp_ns
            if topic == MOTOR_COMMANDS:
                commands.append((stamp, motors.angles(message.name, message.position)))
            elif switched_ns is None and message.header.frame_id == CORRECTED_FRAME:
                switched_ns = stamp
        elif isinstance(message, PoseStamped):
            p, q = message.pose.position, message.pose.orientation
            poses.append((message.header.stamp_ns, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)))
        elif isinstance(message, PoseWithCovarianceStamped):
            p = message.pose.pose.position
            residuals[message.header.stamp_ns] = np.array([p.x, p.y, p.z])
    if not commands or not poses:
        raise RecordingError(f"{recording}: it has no {MOTOR_COMMANDS} or no {PLATFORM_POSE_TRUE}")
    if switched_ns is None:
        raise RecordingError(f"{recording}: no command was corrected")
    return commands, poses, residuals, switched_ns
