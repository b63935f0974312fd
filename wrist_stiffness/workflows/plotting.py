"""Pictures. Every function writes one PNG; matplotlib is imported where it draws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.workflows.before_after import Pass

DPI = 130


def new_figure(width_in: float, height_in: float) -> Any:
    """Return a figure that needs no screen."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def draw_map(table: Table, poses: Array, values: Array, label: str, load: str, path: Path) -> None:
    """Draw one quantity over the joint space, with the operative workspace bordered.

    Parameters
    ----------
    table : Table
        The lookup.
    poses : (n, n, 2) float
        Motor angles on a grid, the first one along the first axis [rad].
    values : (n, n) float
        The quantity in the unit of the label; NaN outside the map domain.
    label, load : str
        What is shown, and under which load.
    path : Path
        PNG to write.
    """
    from matplotlib.colors import BoundaryNorm

    workspace = table.workspace
    operative = values[workspace.operative(poses)]
    figure = new_figure(7.0, 5.6)
    plot = figure.subplots()
    theta_1, theta_2 = np.degrees(poses[:, 0, 0]), np.degrees(poses[0, :, 1])
    # Equal counts per colour: the border's steep maximum would hide the operative workspace else.
    levels = np.unique(np.nanquantile(values, np.linspace(0.0, 1.0, 25)))
    filled = plot.contourf(
        theta_1, theta_2, values.T, levels=levels, norm=BoundaryNorm(levels, 256), cmap="viridis"
    )
    lines = plot.contour(
        theta_1, theta_2, values.T, levels=levels[::3], colors="white", linewidths=0.5
    )
    plot.clabel(lines, fontsize=7, fmt="%.3g")
    border = np.degrees(workspace.operative_border)
    plot.plot(*border.T, color="black", linewidth=2.0, label="operative workspace")
    plot.set_xlabel("motor 1 angle θ₁ [deg]")
    plot.set_ylabel("motor 2 angle θ₂ [deg]")
    plot.set_aspect("equal")
    plot.set_title(
        f"{table.geometry.name}: {label}\n{load}; operative workspace "
        f"{operative.min():.3g} to {operative.max():.3g}, mean {operative.mean():.3g}; "
        f"map up to {np.nanmax(values):.3g}",
        fontsize=9,
    )
    figure.colorbar(filled, ax=plot, format="%.3g")
    plot.legend(loc="upper right", fontsize=7)
    figure.savefig(path, dpi=DPI)


def draw_before_after(before: Pass, after: Pass, path: Path) -> None:
    """Draw the true errors of both passes of a motion, one above the other.

    Parameters
    ----------
    before, after : Pass
        Settled samples without and with correction.
    path : Path
        PNG to write.
    """
    figure = new_figure(8.0, 6.0)
    pointing, shift = figure.subplots(2, 1, sharex=True)
    for run, name, color in (
        (before, "without correction", "tab:red"),
        (after, "with correction", "tab:blue"),
    ):
        time_s = run.time_s - run.time_s[0]
        mdeg = 1e3 * np.degrees(run.pointing)
        pointing.plot(time_s, mdeg, ".", markersize=2, color=color, label=name)
        shift.plot(time_s, 1e6 * run.shift, ".", markersize=2, color=color, label=f"|s| {name}")
    handed_on = 1e6 * after.shift_handed_on
    time_s = after.time_s - after.time_s[0]
    shift.plot(
        time_s, handed_on, ".", markersize=2, color="tab:green", label="after the manipulator"
    )
    floor = 1e3 * np.degrees(before.floor)
    pointing.axhline(floor, color="black", linewidth=0.8, label="encoder step alone (RMS)")
    pointing.set_ylabel("pointing error [mdeg]")
    pointing.set_title("True error at rest: what two motors cancel, and what they cannot")
    shift.set_ylabel("shift of the centre [µm]")
    shift.set_xlabel("time in the motion [s]")
    for plot in (pointing, shift):
        plot.set_ylim(bottom=0.0)
        plot.legend(fontsize=7, markerscale=4, loc="upper right")
        plot.grid(alpha=0.3)
    figure.savefig(path, dpi=DPI)
