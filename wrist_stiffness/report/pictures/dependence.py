"""What is left against the condition on which it depends: a curve with its band, or a map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wrist_stiffness.comparing.curve import CELL_DEG, Curve, ranks
from wrist_stiffness.comparing.explained import Told
from wrist_stiffness.inference import Observations
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.parts import typeset, unit_of
from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure

CLASSES = 12
"""Units of a further model are averaged in so many classes of the condition."""


def draw_against(every: Sequence[Told], models: Sequence[tuple[str, Observations]] = ()) -> Any:
    """Return a figure with one plot for each condition.

    `models`: name and residuals of further models over the same units, shown along the same way.
    """
    columns = min(len(every), 2)
    rows = -(-len(every) // columns)
    figure = new_figure(4.6 * columns + 0.4, 3.5 * rows + 0.3)
    plots = figure.subplots(rows, columns, squeeze=False).ravel()
    for plot in plots[len(every) :]:
        plot.axis("off")
    for plot, each in zip(plots, every, strict=False):
        if len(each.curve.names) == 2:
            _draw_map(figure, plot, each.curve)
        else:
            _draw_curve(plot, each.curve, models)
        plot.set_title(each.name, fontsize=9)
        plot.set_xlabel(typeset(each.curve.labels[0]))
    return figure


def _label(curve: Curve) -> str:
    """Return the name of the part of the error that is shown, with its unit."""
    return f"{curve.quantity.name} {curve.where} [{unit_of(curve.quantity.unit)}]"


def _draw_curve(plot: Any, each: Curve, models: Sequence[tuple[str, Observations]]) -> None:
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
    for number, (name, left) in enumerate(models, 1):
        residual = each.along(left.values)
        known = np.isfinite(residual)
        at, means, errors = _means(values[known], residual[known])
        plot.errorbar(
            at, means, errors, fmt="s--", color=colour(number), markersize=4, capsize=2, label=name
        )
    plot.axhline(0.0, color=FLOOR, linewidth=0.6)
    plot.set_ylabel(_label(each))
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


def _draw_map(figure: Any, plot: Any, each: Curve) -> None:
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
    figure.colorbar(shown, ax=plot, label=_label(each), extend="both")
    plot.set_ylabel(typeset(each.labels[1]))
    plot.set_aspect("equal")
