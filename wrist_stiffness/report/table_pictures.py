"""What a table holds in pictures: maps of an error, the budget, the bent wrist, its modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.commands.budget import PER_AXIS, Push, budget
from wrist_stiffness.commands.modes import ModeMap, modes_at
from wrist_stiffness.commands.table import FINE
from wrist_stiffness.commands.uncertainty import contributions
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.modes import RigidBody
from wrist_stiffness.report.pictures.bent_wrist import draw_bent_wrist, draw_mode_shapes
from wrist_stiffness.report.pictures.table import draw_budget, draw_map, draw_uncertainty
from wrist_stiffness.topics import MICROMETRES, MILLIDEGREES

PICTURED_POSE = np.radians([25.0, -20.0])


def picture_folder(folder: str | Path) -> Path:
    """Return a folder, made if missing; an `InputError` if it cannot be."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from error
    return folder


def draw_maps(table: Table, folder: str | Path, push: Push | None = None) -> list[Path]:
    """Draw what a load does (maps, shares, the bent wrist), and what its prediction errs by.

    `folder`: where the PNG files go; made if missing; `push`: the load; the rated one if None, for
    which the maps are the table's splines of s and phi (the paper's Figs. 5 and 6), else the closed
    form.  Gives `map_s.png`, `map_phi.png`, `budget.png`, `bent.png` and `uncertainty.png`.  Raises
    `InputError` if the folder cannot be made; `LoadRangeError` if the load is outside the table's
    range.
    """
    folder = picture_folder(folder)
    load = push or Push.rated(table)
    found = budget(table, load)
    poses = table.workspace.rectangle_grid(FINE if push is None else PER_AXIS)
    inside = table.workspace.domain(poses)
    values = np.full((*poses.shape[:-1], 2), np.nan)
    if push is None:
        values[inside] = table.map_spline(poses[inside])[:, 3:]
    else:
        halves = found.twist.reshape(-1, 2, 3)
        values[inside] = np.linalg.norm(halves, axis=-1)
    names = ("map_s.png", "map_phi.png", "budget.png", "bent.png", "uncertainty.png")
    pictures = [folder / name for name in names]
    s, phi = MICROMETRES * values[..., 0], MILLIDEGREES * values[..., 1]
    label = "shift s of the platform at O [µm]"
    draw_map(table, poses, s, label, load.text, pictures[0])
    label = "rotation phi of the platform [mdeg]"
    draw_map(table, poses, phi, label, load.text, pictures[1])
    draw_budget(table, found, load.text, pictures[2])
    draw_bent_wrist(table, PICTURED_POSE, load, pictures[3])
    draw_uncertainty(table, contributions(table), pictures[4])
    return pictures


def draw_modes(
    table: Table, found: ModeMap, folder: str | Path, payload: RigidBody | None = None
) -> list[Path]:
    """Draw the first natural frequency over both motor angles, and the shapes of four modes.

    `folder`: where the PNG files go; made if missing.  `payload`: what the platform carries.  Gives
    `map_mode_1.png` and `mode_shapes.png`.  Raises `InputError` if the folder cannot be made.
    """
    pictures = [picture_folder(folder) / name for name in ("map_mode_1.png", "mode_shapes.png")]
    carried = "no payload" if payload is None else f"payload {payload.mass:g} kg"
    draw_map(
        table,
        found.poses,
        found.frequency["at rest"][..., 0],
        "first natural frequency, motors locked [Hz]",
        f"{carried}, flanges as they rest",
        pictures[0],
    )
    configuration = table.mechanism.forward(PICTURED_POSE[None])
    draw_mode_shapes(
        table, configuration, modes_at(table, configuration, payload, "at rest"), pictures[1]
    )
    return pictures
