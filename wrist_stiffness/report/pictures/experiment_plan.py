"""A planned experiment: where, in which order, under what, when."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.planning.timeline import Timeline
from wrist_stiffness.report.pictures.figure import new_figure, over_angles, save_figure

MARKERS = "osD^vP*X<>"
"""Of the loads, none first."""

ARROW_DEG = 6.0
"""Longer than an approach, to stand out from under its marker."""


def draw_plan(table: Table, timeline: Timeline, path: Path) -> None:
    """Draw the poses in the joint space and the time line."""
    figure = new_figure(11.5, 6.0)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25))
    _draw_poses(figure, figure.add_subplot(grid[:, 0]), table, timeline)
    angles = figure.add_subplot(grid[0, 1])
    loads = figure.add_subplot(grid[1, 1], sharex=angles)
    minutes = np.array([knot[0] for knot in timeline.knots]) / 60.0
    theta = np.degrees([knot[1] for knot in timeline.knots])
    force = np.linalg.norm([knot[2][:3] for knot in timeline.knots], axis=1)
    for motor in range(2):
        angles.plot(minutes, theta[:, motor], linewidth=0.7, label=f"motor {motor + 1}")
    for label, colour in (("reference pose", "tab:green"), ("long hold", "tab:red")):
        spans = [d for d in timeline.dwells if d.visit.purpose == label]
        for number, dwell in enumerate(spans):
            begin = dwell.time_s / 60.0
            for plot in (angles, loads):
                plot.axvspan(
                    begin,
                    begin + max(dwell.hold_s, 0.005 * timeline.duration_s) / 60.0,
                    color=colour,
                    alpha=0.35,
                    linewidth=0.0,
                    label=label if number == 0 else None,
                )
    angles.set_ylabel("motor angle [deg]")
    angles.set_title(
        f"{timeline.duration_s / 60.0:.1f} minutes, warm-up until "
        f"{timeline.dwells[0].time_s / 60.0:.1f}",
        fontsize=9,
    )
    # Motion is everywhere inside the axes.
    figure.legend(*angles.get_legend_handles_labels(), fontsize=8, loc="lower right", ncols=4)
    loads.plot(minutes, force, linewidth=0.8, color="black")
    loads.set_ylim(bottom=0.0)
    loads.set_ylabel("force of the load [N]")
    loads.set_xlabel("time [min]")
    for plot in (angles, loads):
        plot.grid(alpha=0.3)
    save_figure(figure, path)


def _draw_poses(figure: Any, plot: Any, table: Table, timeline: Timeline) -> None:
    visits = list(dict.fromkeys(dwell.visit for dwell in timeline.dwells))
    names = ["", *sorted({visit.load.name for visit in visits} - {""})]
    poses = np.degrees([visit.theta for visit in visits])
    sides = np.array([visit.approach for visit in visits])
    border = np.degrees(table.workspace.operative_border)
    plot.plot(*border.T, color="black", linewidth=1.5, label="operative workspace")
    plot.quiver(
        *(poses - ARROW_DEG * sides).T,
        *(ARROW_DEG * sides).T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.005,
        headwidth=4.0,
        color="0.6",
    )
    for number, name in enumerate(names):
        own = np.array([visit.load.name == name for visit in visits])
        if not own.any():
            continue
        shown = plot.scatter(
            *poses[own].T,
            c=np.flatnonzero(own) + 1,
            vmin=1,
            vmax=len(visits),
            cmap="viridis",
            marker=MARKERS[number % len(MARKERS)],
            s=36,
            edgecolors="black",
            linewidths=0.4,
            zorder=3,
            label=name or "no load",
        )
    bar = figure.colorbar(shown, ax=plot, location="bottom", shrink=0.8)
    bar.set_label("order of the visits")
    over_angles(plot)
    plot.set_title(f"{table.geometry.name}: poses, arrows = last approach", fontsize=9)
    plot.legend(fontsize=7, loc="upper right")
