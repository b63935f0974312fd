"""Pictures of a table: maps, whose share an error is, what a prediction errs by, modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.commands.budget import PER_AXIS, Budget, Push, budget
from wrist_stiffness.commands.modes import ModeMap, modes_at
from wrist_stiffness.commands.table import FINE
from wrist_stiffness.commands.uncertainty import Contribution, contributions
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.modes import RigidBody
from wrist_stiffness.report.pictures.bent_wrist import draw_bent_wrist, draw_mode_shapes
from wrist_stiffness.report.pictures.figure import new_figure, over_angles, save_figure
from wrist_stiffness.topics import MICROMETRES, MILLIDEGREES

BANDS = 12
"""At most so many colours; ends of the colour bar stand for what lies beyond."""

PICTURED_POSE = np.radians([25.0, -20.0])


def draw_map(table: Table, poses: Array, values: Array, label: str, load: str, path: Path) -> None:
    """Draw one quantity over the joint space, with the operative workspace bordered.

    `poses` (n, n, 2): motor angles on a grid, the first one along the first axis [rad].  `values`
    (n, n): the quantity in the unit of the label; NaN outside the map domain.  `label`, `load`:
    what is shown, and under which load.
    """
    from matplotlib.ticker import MaxNLocator

    workspace = table.workspace
    operative = values[workspace.operative(poses)]
    figure = new_figure(7.0, 5.6)
    plot = figure.subplots()
    theta_1, theta_2 = np.degrees(poses[:, 0, 0]), np.degrees(poses[0, :, 1])
    # Even bands over the operative workspace: the steep border would take all colours else.
    levels = MaxNLocator(BANDS).tick_values(operative.min(), operative.max())
    below, above = np.nanmin(values) < levels[0], np.nanmax(values) > levels[-1]
    extend = ("neither", "max", "min", "both")[2 * below + above]
    filled = plot.contourf(theta_1, theta_2, values.T, levels=levels, cmap="viridis", extend=extend)
    lines = plot.contour(
        theta_1, theta_2, values.T, levels=levels[::2], colors="white", linewidths=0.5
    )
    plot.clabel(lines, fontsize=7, fmt="%.3g")
    border = np.degrees(workspace.operative_border)
    plot.plot(*border.T, color="black", linewidth=2.0, label="operative workspace")
    over_angles(plot)
    plot.set_title(
        f"{table.geometry.name}: {label}\n{load}; operative workspace "
        f"{operative.min():.3g} to {operative.max():.3g}, mean {operative.mean():.3g}; "
        f"map up to {np.nanmax(values):.3g}",
        fontsize=9,
    )
    figure.colorbar(filled, ax=plot, format="%.3g")
    plot.legend(loc="upper right", fontsize=7)
    save_figure(figure, path)


def draw_budget(table: Table, budget: Budget, load: str, path: Path) -> None:
    """Draw the strain-energy share of each component, and which is the largest where."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    colours = [colormaps["tab10"](number) for number in range(len(ELASTIC))]
    figure = new_figure(12.0, 4.8)
    bars, where = figure.subplots(1, 2, width_ratios=[1.1, 1.0])
    inside = 100.0 * budget.shares[budget.operative]
    mean, low, high = inside.mean(axis=0), inside.min(axis=0), inside.max(axis=0)
    places = np.arange(len(ELASTIC))
    bars.barh(places, mean, color=colours)
    bars.hlines(places, low, high, color="black", linewidth=1.2)
    for place, value in zip(places, mean, strict=True):
        bars.text(1.02 * high.max(), place, f"{value:.1f} %", va="center", fontsize=9)
    bars.set_yticks(places, ELASTIC)
    bars.invert_yaxis()
    bars.set_xlim(0.0, 1.15 * high.max())
    bars.set_xlabel("share of strain energy in the operative workspace [%]\nbar: mean, line: range")
    bars.set_title(f"{table.geometry.name}: whose share is it?\n{load}", fontsize=10)

    largest = np.argmax(budget.shares, axis=1)
    degrees = np.degrees(budget.theta)
    where.scatter(
        *degrees.T,
        c=largest,
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(ELASTIC) - 0.5,
        marker="s",
        s=14,
        linewidths=0,
    )
    where.plot(*np.degrees(table.workspace.operative_border).T, color="black", linewidth=2.0)
    for number in np.unique(largest):
        where.plot([], [], "s", color=colours[number], label=ELASTIC[number])
    where.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), title="largest share")
    over_angles(where)
    save_figure(figure, path)


def draw_uncertainty(table: Table, found: list[Contribution], path: Path) -> None:
    """Draw a bar for each contribution, in s and in phi."""
    figure = new_figure(9.0, 1.9 + 0.42 * len(found))
    plot = figure.subplots()
    places = np.arange(len(found))
    for offset, name, colour in ((-0.2, "s", "tab:blue"), (0.2, "phi", "tab:orange")):
        values = [100.0 * each.bound[name] for each in found]
        bars = plot.barh(places + offset, values, height=0.36, color=colour, label=name)
        for bar, each in zip(bars, found, strict=True):
            bar.set_alpha(1.0 if each.stated else 0.4)
        for place, value in zip(places + offset, values, strict=True):
            digits = 3 if value > 99.5 else 2
            plot.text(value, place, f" {value:.{digits}g} %", va="center", fontsize=7)
    plot.set_xscale("log")
    plot.set_yticks(places, [each.name for each in found])
    plot.invert_yaxis()
    plot.margins(x=0.12)
    plot.set_xlabel(
        "error that 99 of 100 random poses and loads of the map domain keep [% of s and of phi]"
    )
    stated = 100.0 * table.header.errors["stated_relative"]
    plot.set_title(
        f"{table.geometry.name}: what a prediction's error is made of\n"
        f"full colour: in the stated {stated:.2g} %; pale: not in it",
        fontsize=10,
    )
    plot.legend(loc="upper right")
    save_figure(figure, path)


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
    shown = (
        ("shift s of the platform at O [µm]", MICROMETRES),
        ("rotation phi of the platform [mdeg]", MILLIDEGREES),
    )
    for column, (label, unit) in enumerate(shown):
        draw_map(table, poses, unit * values[..., column], label, load.text, pictures[column])
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
