"""A planned experiment: what it will settle, and its folder with table, trajectory and picture."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from wrist_stiffness import topics
from wrist_stiffness.atomic_file import partial_of, remove_orphans
from wrist_stiffness.commands.plan import COLUMNS, plan_rows
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.numerals import percent
from wrist_stiffness.planning.aims import LONGER, Answer
from wrist_stiffness.planning.information import chance_right
from wrist_stiffness.planning.plan import Plan
from wrist_stiffness.planning.timeline import Timeline
from wrist_stiffness.recording.messages import JointTrajectory, JointTrajectoryPoint
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.report.pictures.experiment_plan import draw_plan

MOST_LINES = 15
"""Of each list; the rest is counted."""

TWICE = (
    "Carry it out twice and give all recordings to 'diagnose': the last one only judges what the "
    "others show."
)

BY_HAND = (
    "Put a load on in the seconds of its change_s before a row of plan.csv, and take it off after "
    "the row, also where the next row has it again: the motors stand still meanwhile.\n"
    "Without a recording of the motors: add columns of what is measured to path.csv, fill in one "
    "row of each rest and leave the others in, for there motors turn back; then 'import' it."
)


def require_new_folder(folder: str | Path) -> None:
    """Refuse a folder that exists, or whose parent does not (InputError)."""
    folder = Path(folder)
    if folder.exists():
        raise InputError(
            f"{folder} exists already and is not overwritten; choose another name or remove it"
        )
    if not folder.resolve().parent.is_dir():
        raise InputError(f"{folder} cannot be written: its folder does not exist")


def write_plan(table: Table, timeline: Timeline, text: str, folder: str | Path) -> None:
    """Write `plan.csv`, `path.csv`, `trajectory`, `plan.png` and `summary.txt`, all or nothing.

    Raises `InputError` if the folder exists or cannot be written.
    """
    folder = Path(folder)
    require_new_folder(folder)
    partial = partial_of(folder)
    remove_orphans(folder)
    try:
        partial.mkdir()
        with (partial / "plan.csv").open("w", newline="") as stream:
            rows = csv.DictWriter(stream, COLUMNS)
            rows.writeheader()
            rows.writerows(plan_rows(timeline))
        with (partial / "path.csv").open("w", newline="") as stream:
            lines = csv.writer(stream)
            lines.writerow([*COLUMNS[:3], *COLUMNS[5:11]])
            for time_s, theta, wrench in timeline.knots:
                lines.writerow([round(time_s, 3), *np.degrees(theta).round(4), *wrench.round(6)])
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


def plan_summary(plan: Plan, commissioning: bool = False) -> str:
    """Return what a technician wants to know of a plan, of a wrist or between rivals, as lines."""
    lines = [_what(plan)]
    seen = [a for a in plan.answers if not a.goal.rival]
    blind = {a.goal.truth for a in seen if not a.settled}
    pairs = [
        a
        for a in plan.answers
        if a.goal.rival and a.goal.truth not in blind and a.goal.rival not in blind
    ]
    if commissioning:
        lines += ["", f"sees {len(seen) - len(blind)} of {len(seen)} effects of plausible size"]
        lines += [f"keeps apart {sum(a.settled for a in pairs)} of {len(pairs)} ordered pairs"]
    else:
        lines += _listed("will settle:", (_line(a) for a in plan.answers if a.settled))
        lines += ["", TWICE] if plan.timeline else []
    longer = [a for a in (*seen, *pairs) if not a.settled and a.reachable]
    lines += _listed(
        "may stay open; diagnose the new recordings too and plan again, or give it more time:",
        _weakest(longer),
    )
    never = [a for a in (*seen, *pairs) if not a.reachable]
    lines += _listed(
        f"no experiment of this kind with these loads settles, even {LONGER:g} times as long as "
        "all settings that were considered:",
        _weakest(never),
    )
    lines += _listed(
        "not for poses and loads to show:",
        (f"{name}: needs {signal}" for name, signal in plan.cannot.items()),
    )
    if commissioning:
        lines += _listed(
            "calibration: uncertainty falls by the factor",
            (f"{name}  {factor:.1f}" for name, factor in plan.calibration.items()),
            len(plan.calibration),
        )
    return "\n".join(lines)


def _what(plan: Plan) -> str:
    if plan.timeline is None:
        return "no plan: nothing that these loads allow would settle any of the questions"
    timeline, dwells = plan.timeline, plan.timeline.dwells
    loads = sorted({dwell.load.name for dwell in dwells if dwell.load.name})
    poses = len({tuple(dwell.visit.theta) for dwell in dwells})
    return (
        f"{timeline.duration_s / 60.0:.1f} minutes: {len(timeline.ends)} approaches to {poses} "
        f"poses; {len(dwells)} measurements at rest; loads: {', '.join(loads) or 'none'}\n{BY_HAND}"
    )


def _weakest(answers: Sequence[Answer]) -> list[str]:
    """Return a line for each truth, with the rival that is hardest to tell from it."""
    alike: dict[tuple[str, bool], list[Answer]] = {}
    for each in sorted(answers, key=lambda answer: answer.discrimination):
        alike.setdefault((each.goal.truth, bool(each.goal.rival)), []).append(each)
    return [_line(first, len(others)) for first, *others in alike.values()]


def _line(answer: Answer, others: int = 0) -> str:
    goal, d = answer.goal, answer.discrimination
    if not goal.rival:
        return f"{goal.truth} against nothing: {d:.1f} standard deviations"
    more = f" and {others} more" if others else ""
    apart = f"{d:.1f} standard deviations, right in {percent(float(chance_right(d)))}"
    return f"{goal.truth} if true, against {goal.rival}{more}: {apart if d else 'not told apart'}"


def _listed(title: str, lines: Iterable[str], most: int = MOST_LINES) -> list[str]:
    found = list(lines)
    if not found:
        return []
    more = [f"  and {len(found) - most} more (--json has all)"] if len(found) > most else []
    return ["", title, *(f"  {line}" for line in found[:most]), *more]
