"""Write a recording of the virtual cell."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.recording import RecordingWriter, topics
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    String,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.simulation.cell import CellSample, CellSettings, VirtualCell

BASE_FRAME = "wrist_base"
START_NS = 1_700_000_000_000_000_000
"""Stamp of a recording's first sample: a fixed date, so that a seed gives the same bytes."""

BLOCK = 500
"""Samples in memory at a time."""


@dataclass(frozen=True)
class Simulated:
    """What was written.

    Parameters
    ----------
    path : Path
        The recording.
    samples : int
        Samples on each topic.
    seconds : float
        Duration [s].
    """

    path: Path
    samples: int
    seconds: float


def simulate_recording(
    path: str | Path,
    table: Table,
    settings: CellSettings,
    seconds: float,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
    overwrite: bool = False,
) -> Simulated:
    """Let the virtual cell work and record it.

    Parameters
    ----------
    path : path
        rosbag2 folder, or file where it ends in `.mcap`.
    table : Table
        Of the true wrist.
    settings : CellSettings
        Program, rate, sensors.
    seconds : float
        Duration [s].
    seed : int
        Of all noise; the same seed gives the same bytes.
    progress : callable, optional
        Is told samples done and samples in all.
    overwrite : bool
        Replace an existing recording.

    Returns
    -------
    Simulated
        What was written.

    Raises
    ------
    InputError
        If the duration is not positive or the seed negative.
    RecordingError
        If the recording exists or cannot be written.
    """
    if not (np.isfinite(seconds) and seconds > 0.0):
        raise InputError(f"simulate: {seconds} s is not a positive duration")
    if seed < 0:
        raise InputError(f"simulate: seed {seed} is negative")
    cell = VirtualCell(table, settings, np.random.default_rng(seed))
    total = max(1, round(seconds * settings.rate_hz))
    with RecordingWriter(path, overwrite=overwrite) as writer:
        notes = String(json.dumps(recording_notes(table, settings), sort_keys=True))
        writer.write(topics.RECORDING_NOTES, notes, START_NS)
        for first in range(0, total, BLOCK):
            number = np.arange(first, min(first + BLOCK, total))
            time_s = number / settings.rate_hz
            sent = cell.desired(time_s)
            block = cell.run(time_s, sent)
            for i, t in enumerate(time_s):
                _write_sample(writer, START_NS + round(t * 1e9), sent[i], block[i])
            if progress is not None:
                progress(int(number[-1]) + 1, total)
    return Simulated(Path(path), total, total / settings.rate_hz)


def recording_notes(table: Table, settings: CellSettings) -> dict[str, str]:
    """Return the free facts that a user would know about the recording."""
    return {
        "wrist": table.geometry.name,
        "pose_sensor": settings.instrument,
        "load_source": "ft",
        "session": "simulated",
    }


def _write_sample(
    writer: RecordingWriter, stamp_ns: int, command: np.ndarray, sample: CellSample
) -> None:
    """Write one sample; the load goes first, so that it has arrived with its joint state."""
    header = Header(stamp_ns, BASE_FRAME)
    force, moment = sample.wrench[:3].tolist(), sample.wrench[3:].tolist()
    quaternion = Rotation.from_matrix(sample.measured_rotation).as_quat(canonical=True)
    pose = Pose(Point(*sample.measured_shift.tolist()), Quaternion(*quaternion.tolist()))
    motors = Header(stamp_ns, "")
    for topic, message in (
        (topics.LOAD_ESTIMATE, WrenchStamped(header, Wrench(Vector3(*force), Vector3(*moment)))),
        (topics.MOTOR_COMMANDS, JointState(motors, DEFAULT_JOINTS, tuple(command.tolist()))),
        (topics.JOINT_STATES, JointState(motors, DEFAULT_JOINTS, tuple(sample.encoder.tolist()))),
        (topics.PLATFORM_POSE, PoseStamped(header, pose)),
    ):
        writer.write(topic, message, stamp_ns)
