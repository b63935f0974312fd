"""A planned experiment as a folder: table, trajectory, picture, summary."""

from __future__ import annotations

import csv
import os
import shutil
from pathlib import Path

from wrist_stiffness import topics
from wrist_stiffness.commands.plan import COLUMNS, plan_rows
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.planning.timeline import Timeline
from wrist_stiffness.recording.messages import JointTrajectory, JointTrajectoryPoint
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.report.pictures.experiment_plan import draw_plan


def require_new_folder(folder: str | Path) -> None:
    """Refuse a place that is taken or cannot be.

    Raises `InputError` if it exists, or its parent does not.
    """
    folder = Path(folder)
    if folder.exists():
        raise InputError(
            f"{folder} exists already and is not overwritten; choose another name or remove it"
        )
    if not folder.resolve().parent.is_dir():
        raise InputError(f"{folder} cannot be written: its folder does not exist")


def write_plan(table: Table, timeline: Timeline, text: str, folder: str | Path) -> None:
    """Write `plan.csv`, the recording `trajectory`, `plan.png` and `summary.txt`, all or nothing.

    `folder`: to make; its parent must exist.  Raises `InputError` if the folder exists or cannot be
    written.
    """
    folder = Path(folder)
    require_new_folder(folder)
    partial = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        partial.mkdir()
        with (partial / "plan.csv").open("w", newline="") as stream:
            rows = csv.DictWriter(stream, COLUMNS)
            rows.writeheader()
            rows.writerows(plan_rows(timeline))
        with RecordingWriter(partial / "trajectory") as recording:
            recording.write(topics.MOTOR_TRAJECTORY, trajectory(timeline), 0)
        draw_plan(table, timeline, partial / "plan.png")
        (partial / "summary.txt").write_text(text + "\n", encoding="utf-8")
        os.rename(partial, folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def trajectory(timeline: Timeline) -> JointTrajectory:
    """Return the motors' motion.

    All points are rests: a joint_trajectory_controller joins points with zero velocity and
    acceleration by the same minimum-jerk moves.
    """
    rest = (0.0, 0.0)
    points = tuple(
        JointTrajectoryPoint(
            positions=(float(theta[0]), float(theta[1])),
            velocities=rest,
            accelerations=rest,
            time_from_start_ns=round(1e9 * time_s),
        )
        for time_s, theta, _ in timeline.knots[1:]
    )
    return JointTrajectory(joint_names=DEFAULT_JOINTS, points=points)
