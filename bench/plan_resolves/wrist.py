"""The wrist of the comparison: its model, loads, noise, and a virtual cell that measures."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.planning.information import MeasurementNoise
from wrist_stiffness.planning.loads_file import Actuator, AppliedLoad, Weight
from wrist_stiffness.planning.timeline import Pace, Timeline, Visit, run_through
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise
from wrist_stiffness.simulation.program import Program, Track
from wrist_stiffness.simulation.size import base_pose, departure

RATE_HZ = 5.0
PACE = Pace(float(np.radians(30.0)), 2.0, in_motion=False)
QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))
MODEL = load_model(shipped_file("config/palmieri2015_model.yaml"))
TABLE = MODEL.table
WORKSPACE = TABLE.workspace
MDEG = float(np.radians(1e-3))
NOISE = MeasurementNoise(np.repeat([1e-6, MDEG], 3), TABLE.geometry.limits.encoder_step)
LOADS = (
    Weight("weight", 0.1, np.array([0.02, 0.0, -0.018]), 15.0),
    Actuator(
        "gripper",
        np.repeat([-1.0, -0.01], 3),
        np.repeat([1.0, 0.01], 3),
        np.array([0.0, 0.0, -0.018]),
        True,
        1.0,
    ),
)
"""What the user can apply, to planned and to random poses."""


def paper_design() -> Timeline:
    """Return 25 poses under 1 N downward, approached from one side."""
    lower, upper = WORKSPACE.rectangle
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    axis = np.linspace(-1.0, 1.0, 5) * 0.5
    zero = np.zeros(3)
    load = AppliedLoad("1 N", np.array([0.0, 0.0, -1.0]), zero, zero, False, False, 1.0)
    visits = [
        Visit(middle + half * np.array([x, y]), np.ones(2), load, True) for x in axis for y in axis
    ]
    return once_each(performance(visits))


def performance(visits: list[Visit]) -> Timeline:
    """Return visits one after the other."""
    return run_through(visits, WORKSPACE, PACE)


def once_each(timeline: Timeline) -> Timeline:
    """Return the same without the zero-load returns: each visit is measured under its load."""
    loaded = np.abs(timeline.block.load[timeline.rows]).sum(axis=1) > 0.0
    ever = np.array([loaded[timeline.visit == visit].any() for visit in timeline.visit])
    kept = loaded | ~ever
    return replace(
        timeline,
        rows=timeline.rows[kept],
        visit=timeline.visit[kept],
        moving=timeline.moving[kept],
    )


def left_by(timeline: Timeline, hidden: HiddenEffect) -> np.ndarray:
    """Return what the hidden effect leaves at the observed samples, (n, 6)."""
    return _measured(timeline, hidden) - _without(timeline)


@lru_cache(maxsize=2)
def _without(timeline: Timeline) -> np.ndarray:
    return _measured(timeline, None)


def _measured(timeline: Timeline, hidden: HiddenEffect | None) -> np.ndarray:
    """Return residuals (n, 6) at the observed samples of a cell with noiseless sensors."""
    times, angles, loads = (np.array(column) for column in zip(*timeline.knots, strict=True))
    settings = CellSettings(
        rate_hz=RATE_HZ,
        instrument="ideal",
        load_sensor=QUIET,
        hidden=() if hidden is None else (hidden,),
    )
    cell = VirtualCell(TABLE, settings, np.random.default_rng(0))
    still = Track(np.array([0.0, times[-1]]), np.zeros((2, 1)))
    cell.program = Program(Track(times, angles), Track(times, loads), still, times[-1] + 1.0)
    time_s = np.arange(0.0, times[-1], 1.0 / RATE_HZ)
    sample = cell.run(time_s, cell.desired(time_s))
    base = base_pose(TABLE, sample.encoder, sample.wrench)
    found = departure(sample.measured_rotation, sample.measured_shift, base)
    out = np.zeros((len(timeline.block), 6))
    for row in timeline.rows:
        until = timeline.block.time[row]
        out[row] = found[(time_s >= until - 1.0) & (time_s <= until)].mean(axis=0)
    return out
