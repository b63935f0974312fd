"""What is left against the condition on which it depends: a curve with its band, or a map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.comparing.curve import CELL_DEG, ranks
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.pictures.figure import new_figure
from wrist_stiffness.report.pictures.palette import FLOOR, colour

CLASSES = 12
"""Units of a further model are averaged in so many classes of the condition."""


@dataclass(frozen=True, eq=False)
class Against:
    """One condition and a part of what is left."""

    title: str
    conditions: tuple[str, ...]  # name of the condition with unit, or of both angles of a map
    label: str  # name of the part, with unit
    values: Array  # (n, 1) or (n, 2), of the condition
    measured: Array  # (n,), the part of each unit, NaN where not measured
    places: Array  # (c, 1) or (c, 2), where the law that was found is told
    # `mean`, `sigma`: (c,), of that law, with one standard uncertainty
    mean: Array
    sigma: Array
    # name of a further model and the same part of what it leaves
    others: Sequence[tuple[str, Array]] = ()


def draw_against(every: Sequence[Against]) -> Any:
    """Return a figure with one plot for each condition."""
    columns = min(len(every), 2)
    rows = -(-len(every) // columns)
    figure = new_figure(4.6 * columns + 0.4, 3.5 * rows + 0.3)
    plots = figure.subplots(rows, columns, squeeze=False).ravel()
    for plot in plots[len(every) :]:
        plot.axis("off")
    for plot, each in zip(plots, every, strict=False):
        if len(each.conditions) == 2:
            _draw_map(figure, plot, each)
        else:
            _draw_curve(plot, each)
        plot.set_title(each.title, fontsize=9)
        plot.set_xlabel(each.conditions[0])
    return figure


def _draw_curve(plot: Any, each: Against) -> None:
    values, places = each.values[:, 0], each.places[:, 0]
    plot.plot(
        values, each.measured, ".", color=colour(0), alpha=0.35, markersize=3.5, label="measured"
    )
    low, high = each.mean - 2.0 * each.sigma, each.mean + 2.0 * each.sigma
    if len(places) <= 3:
        plot.errorbar(
            places, each.mean, 2.0 * each.sigma, fmt="o-", color="black", capsize=4, label="fitted"
        )
    else:
        plot.fill_between(places, low, high, color="black", alpha=0.2, linewidth=0.0)
        plot.plot(places, each.mean, color="black", linewidth=1.5, label="fitted, 95 %")
    for number, (name, residual) in enumerate(each.others, 1):
        known = np.isfinite(residual)
        at, means, errors = _means(values[known], residual[known])
        plot.errorbar(
            at, means, errors, fmt="s--", color=colour(number), markersize=4, capsize=2, label=name
        )
    plot.axhline(0.0, color=FLOOR, linewidth=0.6)
    plot.set_ylabel(each.label)
    plot.grid(alpha=0.3)
    plot.legend(fontsize=8)


def _means(values: Array, residual: Array) -> tuple[list[float], list[float], list[float]]:
    """Return means over classes of equal numbers of units, with standard errors."""
    rounded = np.round(values, 9)
    # Equal values share a rank, so what is the same condition is one class.
    classes = np.floor((ranks(rounded) - 0.5) * CLASSES / len(values))
    at, means, errors = [], [], []
    for place in np.unique(classes):
        own = residual[classes == place]
        at.append(float(values[classes == place].mean()))
        means.append(float(own.mean()))
        errors.append(float(own.std(ddof=1) / np.sqrt(len(own))) if len(own) > 1 else 0.0)
    return at, means, errors


def _draw_map(figure: Any, plot: Any, each: Against) -> None:
    """Cells show the law that was found, dots in the same colours what was measured."""
    top = float(np.nanmax(np.abs(each.mean)))
    corners = np.floor(each.places / CELL_DEG).astype(int)
    first = corners.min(axis=0)
    grid = np.full(corners.max(axis=0) - first + 1, np.nan)
    grid[tuple((corners - first).T)] = each.mean
    edges = [
        CELL_DEG * np.arange(start, start + count + 1)
        for start, count in zip(first, grid.shape, strict=True)
    ]
    plot.set_facecolor("#e8e8e8")
    plot.pcolormesh(*edges, grid.T, cmap="RdBu_r", vmin=-top, vmax=top, alpha=0.8)
    shown = plot.scatter(
        *each.values.T,
        c=each.measured,
        cmap="RdBu_r",
        vmin=-top,
        vmax=top,
        s=14,
        edgecolors="black",
        linewidths=0.4,
    )
    figure.colorbar(shown, ax=plot, label=each.label, extend="both")
    plot.set_ylabel(each.conditions[1])
    plot.set_aspect("equal")
