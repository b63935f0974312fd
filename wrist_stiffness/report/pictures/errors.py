"""Pictures of measured errors: side by side, over joint space and time, against a condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.comparing.comparison import ComparedModel, Comparison, lengths
from wrist_stiffness.comparing.curve import CELL_DEG, Curve, classes_of, since_start_s
from wrist_stiffness.comparing.explained import Told
from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.page import title, typeset
from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure

LINES = {"--": "dashed", ":": "dotted", "-.": "dash-dotted"}

MOST_SESSIONS = 6
"""Time lines of more sessions would be too small to read."""

MOST_LETTERS = 28
"""Of a name beside a bar or above a plot; of a longer one the end is shown, where paths differ."""


@dataclass(frozen=True)
class Bars:
    """One quantity of several models."""

    label: str  # quantity with unit, for the axis
    names: Sequence[str]  # of the models
    # `values`, `uncertainties`: root mean square errors and their standard uncertainties
    values: Sequence[float]
    uncertainties: Sequence[float]
    # levels to compare with: the instrument's noise, what laws of the conditions leave
    marks: dict[str, float]


def draw_bars(every: Sequence[Bars]) -> Any:
    """Return a figure with one row of bars for each quantity."""
    rows = max(len(bars.names) for bars in every)
    figure = new_figure(6.5, len(every) * (1.1 + 0.4 * rows))
    plots = figure.subplots(len(every), 1, squeeze=False)[:, 0]
    for plot, bars in zip(plots, every, strict=True):
        places = np.arange(len(bars.names))
        plot.barh(
            places,
            bars.values,
            xerr=bars.uncertainties if any(bars.uncertainties) else None,
            color=[colour(place) for place in range(len(places))],
            height=0.6,
            error_kw={"ecolor": "black", "capsize": 3},
        )
        for place, value, error in zip(places, bars.values, bars.uncertainties, strict=True):
            plot.annotate(
                f"{value:.3g}",
                (value + error, place),
                xytext=(5, 0),
                textcoords="offset points",
                va="center",
                # The line of a level may run through it.
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
            )
        told: list[str] = []
        for style, (name, level) in zip(LINES, bars.marks.items(), strict=False):
            plot.axvline(level, color=FLOOR, linestyle=style)
            told.append(f"{name} ({LINES[style]}) {level:.3g}")
        plot.set_yticks(places, [_shortened(name) for name in bars.names])
        plot.invert_yaxis()
        ends = [value + error for value, error in zip(bars.values, bars.uncertainties, strict=True)]
        plot.set_xlim(0.0, 1.18 * max([*filter(np.isfinite, ends), *bars.marks.values()]))
        plot.set_xlabel(f"{typeset(bars.label)}, RMS")
        plot.set_title(", ".join(told), fontsize=9, loc="left")
    return figure


def draw_map(border: Array, models: Sequence[ComparedModel]) -> Any:
    """Return a figure of errors over the joint space: a row for a model, a column for a quantity.

    `border` (b, 2): motor angles on the border of the operative workspace [rad].
    """
    units, border = models[0].refitted, np.degrees(border)
    theta = np.degrees([units.covariate(f"theta_{motor}") for motor in (1, 2)]).T
    spanned = np.concatenate([theta, border]) / CELL_DEG
    low, high = np.floor(spanned.min(axis=0)), np.ceil(spanned.max(axis=0))
    edges = [CELL_DEG * np.arange(low[i], high[i] + 1.0) for i in range(2)]
    figure = new_figure(0.5 + 3.8 * len(units.reported), 0.9 + 3.4 * len(models))
    plots = figure.subplots(
        len(models), len(units.reported), squeeze=False, sharex=True, sharey=True
    )
    for column, quantity in zip(plots.T, units.reported, strict=True):
        means = [_cell_rms(theta, lengths(model.refitted, quantity), edges) for model in models]
        top = float(np.nanmax(means[0]))
        for plot, mean, model in zip(column, means, models, strict=True):
            shown = plot.pcolormesh(*edges, mean.T, cmap="viridis", vmin=0.0, vmax=top)
            plot.plot(*border.T, color="black", linewidth=1.2)
            plot.plot(*theta.T, ".", color="white", markersize=0.8, rasterized=True)
            plot.set_facecolor("#e8e8e8")
            plot.set_aspect("equal")
            plot.set_title(f"{_shortened(model.name)}: {quantity.name}", fontsize=9)
        above = max(float(np.nanmax(mean)) for mean in means) > top
        figure.colorbar(
            shown,
            ax=column.tolist(),
            label=typeset(f"{title(quantity.key)}, RMS in a cell"),
            extend="max" if above else "neither",
            location="bottom",
            shrink=0.9,
            aspect=30,
        )
        column[-1].set_xlabel("motor 1 angle θ₁ [deg]")
    figure.supylabel("motor 2 angle θ₂ [deg]", fontsize="medium")
    return figure


def _cell_rms(theta: Array, values: Array, edges: Sequence[Array]) -> Array:
    """Root mean square of values (n,) at angles (n, 2) in each cell, NaN where none is finite."""
    known = np.isfinite(values)
    one, two = theta[known].T
    total, _, _ = np.histogram2d(one, two, edges, weights=values[known] ** 2)
    count, _, _ = np.histogram2d(one, two, edges)
    return np.where(count > 0, np.sqrt(total / np.maximum(count, 1.0)), np.nan)


def draw_time_line(found: Comparison, models: Sequence[ComparedModel]) -> Any:
    """Return a figure of errors over the time of each session, of the last few if there are many.

    `models`: of the comparison, those to be drawn together.
    """
    units = models[0].refitted
    numbers = list(range(len(found.sessions)))[-MOST_SESSIONS:]
    figure = new_figure(1.5 + 6.0 * min(len(numbers), 2) ** 0.5, 2.3 * len(found.quantities) + 0.5)
    plots = figure.subplots(
        len(found.quantities), len(numbers), squeeze=False, sharex="col", sharey="row"
    )
    for row, quantity in zip(plots, found.quantities, strict=True):
        for plot, number in zip(row, numbers, strict=True):
            own = units.sessions == number
            minutes = since_start_s(units)[own] / 60.0
            for place, model in enumerate(models):
                plot.plot(
                    minutes,
                    lengths(model.refitted, quantity)[own],
                    ".",
                    markersize=2.5,
                    color=colour(place),
                    label=_shortened(model.name),
                    rasterized=True,
                )
            floor, noise = found.noise[quantity.key], f"noise floor{at_most(found.noise_known)}"
            plot.axhline(floor, color=FLOOR, linestyle="--", linewidth=1.0, label=noise)
            plot.set_ylim(bottom=0.0)
            plot.grid(alpha=0.3)
        row[0].set_ylabel(typeset(title(quantity.key)))
    for plot, number in zip(plots[0], numbers, strict=True):
        plot.set_title(_shortened(found.sessions[number]), fontsize=9)
    for plot in plots[-1]:
        plot.set_xlabel("time [min]")
    handles, names = plots[0, 0].get_legend_handles_labels()
    figure.legend(
        handles, names, loc="outside upper left", ncols=4, fontsize=8, markerscale=4, frameon=False
    )
    return figure


def _shortened(name: str) -> str:
    return name if len(name) <= MOST_LETTERS else f"…{name[1 - MOST_LETTERS :]}"


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
    return typeset(f"{curve.quantity.name} {curve.where} [{curve.quantity.unit}]")


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
    classes = classes_of(values)
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
