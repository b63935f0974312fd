"""A quantity over the joint space, with the operative workspace bordered."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.pictures.figure import new_figure, save_figure

BANDS = 12
"""At most so many colours; ends of the colour bar stand for what lies beyond."""


def draw_map(table: Table, poses: Array, values: Array, label: str, load: str, path: Path) -> None:
    """Draw one quantity over the joint space, with the operative workspace bordered.

    Parameters
    ----------
    poses : (n, n, 2) float
        Motor angles on a grid, the first one along the first axis [rad].
    values : (n, n) float
        The quantity in the unit of the label; NaN outside the map domain.
    label, load : str
        What is shown, and under which load.
    """
    from matplotlib.ticker import MaxNLocator

    workspace = table.workspace
    operative = values[workspace.operative(poses)]
    figure = new_figure(7.0, 5.6)
    plot = figure.subplots()
    theta_1, theta_2 = np.degrees(poses[:, 0, 0]), np.degrees(poses[0, :, 1])
    # Even bands over the operative workspace: the steep border would take all colours else.
    levels = MaxNLocator(BANDS).tick_values(operative.min(), operative.max())
    filled = plot.contourf(theta_1, theta_2, values.T, levels=levels, cmap="viridis", extend="both")
    lines = plot.contour(
        theta_1, theta_2, values.T, levels=levels[::2], colors="white", linewidths=0.5
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
    save_figure(figure, path)
