"""A recording becomes a campaign's table: one measured pose, one row."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import compress
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.atomic_file import writing
from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording.samples import Samples
from wrist_stiffness.sessions.in_pieces import rigid_rotation
from wrist_stiffness.sessions.reading.csv_columns import (
    LOAD,
    MOTORS,
    POSITION,
    QUATERNION,
    TIME,
    Columns,
    column_of,
    marker_columns,
    seconds,
    writer_of,
)
from wrist_stiffness.sessions.reading.gauge_readings import gauge_readings
from wrist_stiffness.sessions.reading.machine_signals import machine_signals
from wrist_stiffness.sessions.reading.pose_track import base_transform, measured_components
from wrist_stiffness.sessions.reading.session import notes_of, opened, path_stamps
from wrist_stiffness.sessions.reading.signals import Stamps, last_of_equal

ROWS_A_REPORT = 1000

LONGEST_HEAD = 100_000
"""Bytes in which a table's first line ends; another kind of file may have no line at all."""


@dataclass(frozen=True)
class Exported:
    """What was written."""

    table: Path
    rows: int  # measured poses in it
    # rows without a measured value: where the wrist or its load turned back between poses
    turns: int
    remarks: tuple[str, ...]  # what was left out of it


def export_csv(
    recording: str | Path,
    output: str | Path,
    table: Table,
    *,
    remaps: Mapping[str, str] | None = None,
    settings: StreamSettings | None = None,
    progress: Progress = silent,
) -> Exported:
    """Write the measured poses of a recording with the signals that belong to them as a table.

    The numbers are those of the recording, in shortest form: importing the table gives them again
    to the bit.  Nothing is taken for an outlier and no clock is put right.  Where poses are far
    apart, rows without a measured value tell the way that friction and play remember.

    `table`: of the wrist: turns loads that are measured on the platform into F, and knows how small
    a swing of a motor is the chatter of a count; `remaps`: actual by standard topic name;
    `settings`: joint names, sensor frames and age limit of loads; `progress`: told rows done and in
    all.  Raises `InputError` if the output is something else than a table, or cannot be written;
    `WristError` if the recording cannot be read, lacks a topic or has a frame that is not known.
    """
    settings = settings or StreamSettings()
    output = Path(output)
    _require_place(output)
    source, samples, known = opened(recording, remaps or {}, settings)
    notes, _ = notes_of(samples.notes)
    try:
        machine = machine_signals(samples, known.frames, table, settings.load_age_limit_s)
        if len(samples.poses.time_ns) or len(samples.markers.time_ns):
            time_ns, measured, names, markers = _measured(samples, known.frames)
            gauges: tuple[str, ...] = ()
        else:
            time_ns, own, measured = gauge_readings(samples.gauges, notes, table)
            gauges = tuple(f"{g.name}_{'deg' if g.point is None else 'mm'}" for g in own.members)
            names, markers = (), 0
    except FrameError as error:
        raise FrameError("; ".join([f"{source.path}: {error}", *known.hints])) from error
    usable, unknown = machine.usable(time_ns)
    remarks = (*known.remarks, *unknown)
    if not usable.any():
        raise InputError(f"{source.path}: no measured pose can be used: {'; '.join(remarks)}")
    pose_ns = time_ns[usable]
    way_ns = path_stamps(machine, pose_ns, table)
    time_ns = np.union1d(pose_ns, way_ns)
    seen = np.full((len(time_ns), measured.shape[1]), np.nan)
    seen[np.searchsorted(time_ns, pose_ns)] = measured[usable]
    block = machine.at(time_ns)
    load = block.load
    if block.load_on_platform:
        load = (block_diagonal(rigid_rotation(table, block.theta)) @ load[..., None])[..., 0]
    columns = Columns(
        True,
        names,
        markers,
        {component: f"T_{component}_degC" for component in sorted(block.temperatures)},
        {name: column_of(name) for name in sorted(block.covariates)},
        gauges,
    )
    values = {
        **dict(zip(MOTORS, block.theta.T, strict=True)),
        **dict(zip(LOAD, load.T, strict=True)),
        **dict(zip(names or gauges or marker_columns(markers), seen.T, strict=True)),
        **{columns.temperatures[name]: value for name, value in block.temperatures.items()},
        **{columns.covariates[name]: value for name, value in block.covariates.items()},
    }
    zero_ns = notes.get("time_zero_ns", 0)
    _write(
        output, columns, time_ns - (zero_ns if isinstance(zero_ns, int) else 0), values, progress
    )
    if source.damage:
        remarks = (f"the recording is damaged: {source.damage}", *remarks)
    if gauges:
        remarks = (*remarks, "points and directions of the gauges have no columns")
    if len(samples.frame_poses.time_ns):
        remarks = (*remarks, "the frame's poses have no columns: its motion stays in")
    return Exported(output, len(pose_ns), len(time_ns) - len(pose_ns), remarks)


def _require_place(output: Path) -> None:
    """Refuse to replace what is no table: the recording itself, a model."""
    if output.suffix == ".mcap":
        raise InputError(f"{output}: a table is no recording; choose another name")
    if not output.is_file():
        return
    try:
        with output.open("rb") as old:
            head = old.readline(LONGEST_HEAD)
    except OSError as error:
        raise InputError(f"{output}: cannot be replaced: {error.strerror}") from error
    if head and TIME.encode() not in head:
        raise InputError(f"{output} is no earlier table: it is not replaced")


def _measured(samples: Samples, frames: Frames) -> tuple[Stamps, Array, tuple[str, ...], int]:
    """Return stamps, what was measured in F (n, columns) with NaN, pose columns, marker count."""
    if len(samples.poses.time_ns) == 0:
        found = samples.markers
        turn, origin = base_transform(found.frame_id, "measured markers", frames)
        points = found.position
        if not _is_identity(turn, origin):
            points = points @ turn.T + origin
        order = last_of_equal(found.time_ns)
        values = points.reshape(len(points), -1)
        return found.time_ns[order], values[order], (), points.shape[1]
    poses = samples.poses
    turn, origin = base_transform(poses.frame_id, "measured pose", frames)
    position, quaternion = measured_components(poses)
    if not _is_identity(turn, origin):
        position = position @ turn.T + origin
        turned = np.isfinite(quaternion).all(axis=1)
        product = Rotation.from_matrix(turn) * Rotation.from_quat(quaternion[turned])
        quaternion[turned] = product.as_quat(canonical=True)
    values = np.hstack([position, quaternion])
    # One blank component is a lost beam, a whole blank column an instrument that has none.
    there = [bool(np.isfinite(column).any()) for column in values.T]
    order = last_of_equal(poses.time_ns)
    names = tuple(compress((*POSITION, *QUATERNION), there))
    return poses.time_ns[order], values[:, there][order], names, 0


def _is_identity(turn: Array, origin: Array) -> bool:
    return bool(np.all(turn == np.eye(3)) and np.all(origin == 0.0))


def _write(
    output: Path, columns: Columns, time_ns: Stamps, values: Mapping[str, Array], progress: Progress
) -> None:
    names = columns.names[1:]
    writers = [writer_of(name) for name in names]
    table = np.stack([values[name] for name in names], axis=1)
    with writing(output) as path, path.open("w", newline="", encoding="utf-8") as stream:
        lines = csv.writer(stream, lineterminator="\n")
        lines.writerow((TIME, *names))
        for done, (stamp, row) in enumerate(zip(time_ns.tolist(), table, strict=True)):
            cells = [
                "" if value != value else write(value)
                for write, value in zip(writers, row.tolist(), strict=True)
            ]
            lines.writerow((seconds(stamp), *cells))
            if done % ROWS_A_REPORT == 0:
                progress(done, len(table))
    progress(len(table), len(table))
