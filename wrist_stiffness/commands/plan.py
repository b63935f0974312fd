"""Plan an experiment and write it as a folder: table, trajectory, picture, summary."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.commands.read_sessions import (
    Recordings,
    read_sessions,
    recording_sha256,
    remarks_of,
)
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.planning.information import MeasurementNoise
from wrist_stiffness.planning.loads_file import read_loads
from wrist_stiffness.planning.plan import Conditions, Plan, plan
from wrist_stiffness.planning.question import between, commissioning
from wrist_stiffness.planning.rivals import dwell_noise, read_rivals
from wrist_stiffness.planning.timeline import Pace, Timeline, as_experiment
from wrist_stiffness.progress import Progress, silent

MDEG = float(np.radians(1e-3))

COLUMNS = (
    "time_s",
    "motor_1_deg",
    "motor_2_deg",
    "approach",
    "load",
    *(f"{axis}_N" for axis in ("fx", "fy", "fz")),
    *(f"{axis}_Nm" for axis in ("mx", "my", "mz")),
    "hold_s",
    "purpose",
)

LONGEST_MIN = 120.0
"""Minutes of one experiment; planning takes 2 GB and minutes for so many."""


@dataclass(frozen=True)
class Options:
    """What the user says of an experiment.

    Raises `InputError` if a number is not positive or the experiment longer than `LONGEST_MIN`.
    """

    minutes: float | None  # duration; None for what it takes
    speed_deg_per_s: float = 30.0  # largest speed of a motor
    dwell_s: float = 2.0  # what one measurement at rest takes, settling included
    in_motion: bool = True  # whether the pose sensor measures in motion too
    # `noise_um`, `noise_mdeg`: standard deviation of each component of one measured pose, for a
    # commissioning
    noise_um: float = 1.0
    noise_mdeg: float = 1.0
    seed: int = 0  # the same seed gives the same plan

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("minutes", "speed_deg_per_s", "dwell_s", "noise_um", "noise_mdeg"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise InputError(f"plan: {name} = {value:g} is not a positive number")
        if self.minutes is not None and self.minutes > LONGEST_MIN:
            raise InputError(
                f"plan: {self.minutes:g} minutes are more than {LONGEST_MIN:g}: plan a shorter "
                "experiment, and the next one after its diagnosis"
            )
        if self.seed < 0:
            raise InputError(f"plan: seed {self.seed} is below 0")


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan and what it is for."""

    model: ErrorModel
    plan: Plan
    remarks: tuple[str, ...]  # on what it was made from

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        timeline = self.plan.timeline
        return {
            "schema": 1,
            "remarks": list(self.remarks),
            "duration_s": None if timeline is None else timeline.duration_s,
            "dwells": [] if timeline is None else plan_rows(timeline),
            "answers": [
                {
                    "truth": answer.goal.truth,
                    "rival": answer.goal.rival or None,
                    "discrimination": answer.discrimination,
                    "settled": answer.settled,
                    "reachable": answer.reachable,
                }
                for answer in self.plan.answers
            ],
            "cannot": dict(self.plan.cannot),
            "uncertainty_falls_by": dict(self.plan.calibration),
        }


def plan_experiment(
    model_file: str | Path,
    loads: str | Path,
    options: Options,
    diagnosis: str | Path | None = None,
    recordings: Recordings | None = None,
    progress: Progress = silent,
) -> Planned:
    """Plan the first experiment on a wrist, or the next one between rivals.

    `loads`: file of the loads that the user can apply; `options`: duration, pace,
    noise; `diagnosis`: result of `diagnose --json`;
    what it could not tell apart is asked; `recordings`: those of the diagnosis: its rivals are
    fitted to them, and what it left open counts as open.  Raises `WristError` if a file is wrong,
    nothing is left to separate, or nothing fits into the duration.
    """
    model, rng, earlier = load_model(model_file), np.random.default_rng(options.seed), []
    remarks: list[str] = []
    if diagnosis is None:
        question = commissioning(rng)
        white = np.repeat([1e-6 * options.noise_um, MDEG * options.noise_mdeg], 3)
        noise = MeasurementNoise(white, model.table.geometry.limits.encoder_step)
    else:
        rivals = read_rivals(diagnosis)
        question = between(rivals.classes, rivals.silent, rng)
        noise = dwell_noise(model.table, rivals.noise)
        sessions = {} if recordings is None else read_sessions(recordings, [model], silent)
        earlier = [as_experiment(model, session) for session in sessions.values()]
        given = {Path(model_file): file_sha256(model_file)}
        given |= {path: recording_sha256(path) for path in sessions}
        remarks += [
            f"{path} is not what {diagnosis} was made from: give the model and the recordings that "
            "were diagnosed, or diagnose these"
            for path, sha256 in given.items()
            if rivals.diagnosed and sha256 not in rivals.diagnosed
        ]
        remarks += remarks_of(sessions.values())
    geometry = model.table.geometry
    conditions = Conditions(
        read_loads(loads, geometry.gravity, geometry.limits.force),
        Pace(float(np.radians(options.speed_deg_per_s)), options.dwell_s, options.in_motion),
        noise,
        None if options.minutes is None else 60.0 * options.minutes,
        options.seed,
    )
    return Planned(model, plan(model, question, conditions, earlier, progress), tuple(remarks))


def plan_rows(timeline: Timeline) -> list[dict[str, Any]]:
    """Return the measurements at rest, each with the columns of `plan.csv`."""
    rows = []
    for dwell in timeline.dwells:
        angles = np.degrees(dwell.visit.theta)
        signs = "".join("+" if sign > 0.0 else "-" for sign in dwell.visit.approach)
        values = [
            round(dwell.time_s, 3),
            *(round(float(angle), 4) for angle in angles),
            signs,
            dwell.load.name or "none",
            *(round(float(component), 6) for component in dwell.wrench),
            round(dwell.hold_s, 3),
            dwell.purpose,
        ]
        rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows
