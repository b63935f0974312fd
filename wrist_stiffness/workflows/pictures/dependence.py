"""A residual against the condition on which it depends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import rankdata

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.workflows.pictures.figure import new_figure
from wrist_stiffness.workflows.pictures.palette import colour

CLASSES = 12
"""Units are averaged in so many classes of the condition."""


@dataclass(frozen=True, eq=False)
class Against:
    """One condition and a part of the residual.

    Parameters
    ----------
    title, condition, label : str
        What is shown, and the names of both axes with units.
    values : (n,) float
        Of the condition.
    residuals : sequence of (str, (n,) float)
        Name of a model and the part of its residual, NaN where not measured.
    """

    title: str
    condition: str
    label: str
    values: Array
    residuals: Sequence[tuple[str, Array]]


def draw_against(every: Sequence[Against]) -> Any:
    """Return a figure with one plot for each condition."""
    columns = min(len(every), 2)
    rows = -(-len(every) // columns)
    figure = new_figure(4.3 * columns + 0.4, 3.1 * rows + 0.3)
    plots = figure.subplots(rows, columns, squeeze=False).ravel()
    for plot in plots[len(every) :]:
        plot.axis("off")
    for plot, each in zip(plots, every, strict=False):
        few = len(np.unique(np.round(each.values, 9))) <= 3
        for number, (name, residual) in enumerate(each.residuals):
            _draw(plot, each.values, residual, few, number, name)
        plot.axhline(0.0, color="black", linewidth=0.6)
        plot.set_title(each.title, fontsize=9)
        plot.set_xlabel(each.condition)
        plot.set_ylabel(each.label)
        plot.grid(alpha=0.3)
        if len(each.residuals) > 1:
            plot.legend(fontsize=8, markerscale=2)
    return figure


def _draw(plot: Any, values: Array, residual: Array, few: bool, number: int, name: str) -> None:
    known = np.isfinite(residual)
    values, residual = values[known], residual[known]
    plot.plot(
        values, residual, ".", color=colour(number), alpha=0.25, markersize=3, rasterized=True
    )
    if few:
        classes = np.unique(np.round(values, 9), return_inverse=True)[1]
    else:
        # Equal values share a rank, so what is the same condition is one class.
        classes = np.floor((rankdata(np.round(values, 9)) - 0.5) * CLASSES / len(values))
    centres, means, errors = [], [], []
    for place in np.unique(classes):
        own = residual[classes == place]
        centres.append(float(values[classes == place].mean()))
        means.append(float(own.mean()))
        errors.append(float(own.std(ddof=1) / np.sqrt(len(own))) if len(own) > 1 else 0.0)
    plot.errorbar(
        centres,
        means,
        errors,
        fmt="o-",
        color=colour(number),
        markersize=4,
        capsize=2,
        label=name,
        markeredgecolor="black",
        markeredgewidth=0.5,
    )
