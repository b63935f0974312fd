"""Pictures of a table: maps, whose share an error is, and what its prediction errs by."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.commands.budget import Budget
from wrist_stiffness.commands.uncertainty import Contribution
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.report.pictures.figure import new_figure, save_figure

BANDS = 12
"""At most so many colours; ends of the colour bar stand for what lies beyond."""


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
    where.set_aspect("equal")
    where.set_xlabel("motor 1 angle θ₁ [deg]")
    where.set_ylabel("motor 2 angle θ₂ [deg]")
    save_figure(figure, path)


def draw_uncertainty(table: Table, found: list[Contribution], path: Path) -> None:
    """Draw a bar for each contribution, in s and in phi."""
    figure = new_figure(9.0, 1.9 + 0.42 * len(found))
    plot = figure.subplots()
    places = np.arange(len(found))
    for offset, name, colour in ((-0.2, "s", "tab:blue"), (0.2, "phi", "tab:orange")):
        values = [100.0 * getattr(each, name) for each in found]
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
