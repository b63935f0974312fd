"""Pictures of measured errors: side by side, over the joint space, over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.inference.observations import Labels
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure

CELL_DEG = 6.0
"""Side of a cell of the map."""

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
        plot.set_xlabel(f"{bars.label}, RMS")
        plot.set_title(", ".join(told), fontsize=9, loc="left")
    return figure


def draw_map(
    border: Array, theta: Array, lengths: Sequence[tuple[str, Array]], titles: Sequence[str]
) -> Any:
    """Return a figure of errors over the joint space: a row for a model, a column for a quantity.

    `border` (b, 2): motor angles on the border of the operative workspace [rad]; `theta` (n, 2):
    motor angles of the units [rad]; `lengths`: quantity with unit, and the error of each model at
    each unit, NaN where not measured.
    """
    figure = new_figure(0.5 + 3.8 * len(lengths), 0.9 + 3.4 * len(titles))
    plots = figure.subplots(len(titles), len(lengths), squeeze=False, sharex=True, sharey=True)
    edges, cells = _cells(np.degrees(np.concatenate([theta, border])), np.degrees(theta))
    shape = tuple(len(edge) - 1 for edge in edges)
    for column, (label, values) in zip(plots.T, lengths, strict=True):
        means = [_cell_rms(cells, each, shape) for each in values]
        top = float(np.nanmax(means[0]))
        for plot, mean, title in zip(column, means, titles, strict=True):
            shown = plot.pcolormesh(*edges, mean.T, cmap="viridis", vmin=0.0, vmax=top)
            plot.plot(*np.degrees(border).T, color="black", linewidth=1.2)
            plot.plot(*np.degrees(theta).T, ".", color="white", markersize=0.8, rasterized=True)
            plot.set_facecolor("#e8e8e8")
            plot.set_aspect("equal")
            plot.set_title(f"{_shortened(title)}: {label.split()[0]}", fontsize=9)
        above = max(float(np.nanmax(mean)) for mean in means) > top
        figure.colorbar(
            shown,
            ax=column.tolist(),
            label=f"{label}, RMS in a cell",
            extend="max" if above else "neither",
            location="bottom",
            shrink=0.9,
            aspect=30,
        )
        column[-1].set_xlabel("motor 1 angle θ₁ [deg]")
    figure.supylabel("motor 2 angle θ₂ [deg]", fontsize="medium")
    return figure


def _cells(spanned: Array, theta: Array) -> tuple[tuple[Array, Array], Labels]:
    """Edges of a grid over all angles [deg], and the cell of each unit along both axes, (2, n)."""
    low, high = np.floor(spanned.min(axis=0) / CELL_DEG), np.ceil(spanned.max(axis=0) / CELL_DEG)
    edges = tuple(CELL_DEG * np.arange(low[i], high[i] + 1.0) for i in range(2))
    places = np.stack([np.digitize(theta[:, i], edges[i]) - 1 for i in range(2)])
    most = np.array([[len(edge) - 2] for edge in edges])
    return (edges[0], edges[1]), np.clip(places, 0, most)


def _cell_rms(cells: Labels, values: Array, shape: tuple[int, ...]) -> Array:
    """Root mean square in each cell, NaN where nothing was measured."""
    known = np.isfinite(values)
    total, count = np.zeros(shape), np.zeros(shape)
    np.add.at(total, tuple(cells[:, known]), values[known] ** 2)
    np.add.at(count, tuple(cells[:, known]), 1.0)
    return np.where(count > 0, np.sqrt(total / np.maximum(count, 1.0)), np.nan)


def draw_time_line(
    times: Array,
    sessions: Labels,
    session_names: Sequence[str],
    lengths: Sequence[tuple[str, Array, float]],
    titles: Sequence[str],
) -> Any:
    """Return a figure of errors over the time of each session.

    `times`, `sessions` (n,) arrays: of the units; time in s.  `session_names`: the last few are
    drawn where there are many.  `lengths`: quantity with unit, error of each model, and what noise
    alone gives.
    """
    numbers = list(range(len(session_names)))[-MOST_SESSIONS:]
    figure = new_figure(1.5 + 6.0 * min(len(numbers), 2) ** 0.5, 2.3 * len(lengths) + 0.5)
    plots = figure.subplots(len(lengths), len(numbers), squeeze=False, sharex="col", sharey="row")
    for row, (label, values, floor) in zip(plots, lengths, strict=True):
        for plot, number in zip(row, numbers, strict=True):
            own = sessions == number
            minutes = (times[own] - times[own].min()) / 60.0
            for place, (each, title) in enumerate(zip(values, titles, strict=True)):
                plot.plot(
                    minutes,
                    each[own],
                    ".",
                    markersize=2.5,
                    color=colour(place),
                    label=_shortened(title),
                    rasterized=True,
                )
            plot.axhline(floor, color=FLOOR, linestyle="--", linewidth=1.0, label="noise floor")
            plot.set_ylim(bottom=0.0)
            plot.grid(alpha=0.3)
        row[0].set_ylabel(label)
    for plot, number in zip(plots[0], numbers, strict=True):
        plot.set_title(_shortened(session_names[number]), fontsize=9)
    for plot in plots[-1]:
        plot.set_xlabel("time [min]")
    handles, names = plots[0, 0].get_legend_handles_labels()
    figure.legend(
        handles, names, loc="outside upper left", ncols=4, fontsize=8, markerscale=4, frameon=False
    )
    return figure


def _shortened(name: str) -> str:
    return name if len(name) <= MOST_LETTERS else f"…{name[1 - MOST_LETTERS :]}"
