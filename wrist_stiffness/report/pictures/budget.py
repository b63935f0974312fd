"""Picture of the error budget: whose share it is, and where."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.commands.budget import Budget
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.report.pictures.figure import new_figure, save_figure


def draw_budget(table: Table, budget: Budget, load: str, path: Path) -> None:
    """Draw the strain-energy share of each component, and which is the largest where.

    Parameters
    ----------
    table : Table
        The lookup.
    budget : Budget
        Of one load.
    load : str
        The load in words.
    path : Path
        PNG to write.
    """
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
