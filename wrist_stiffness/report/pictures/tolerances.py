"""Picture of a tolerance study: what each tolerance costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.commands.tolerances import ToleranceStudy
from wrist_stiffness.report.page import title, typeset
from wrist_stiffness.report.pictures.figure import new_figure, save_figure


def draw_tolerances(study: ToleranceStudy, path: Path) -> None:
    """Draw a bar for each tolerance, in s and in phi."""
    rows = (*study.costs, study.others)
    figure = new_figure(11.0, 1.2 + 0.22 * len(rows))
    places = np.arange(len(rows))
    axes = figure.subplots(1, 2, sharey=True)
    for axis, key, colour in zip(axes, study.whole.size, ("tab:blue", "tab:orange"), strict=True):
        value, sigma = np.array([cost.size[key] for cost in rows]).T
        axis.barh(places, value, xerr=sigma, color=colour, error_kw={"linewidth": 1.0})
        axis.set_xlabel(f"{typeset(title(key))}, RMS; all together {study.whole.size[key][0]:.3g}")
        axis.set_xlim(left=0.0)
        axis.grid(axis="x", linewidth=0.4)
        axis.set_axisbelow(True)
    axes[0].set_yticks(places, [cost.name for cost in rows], fontsize=8)
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    load = " ".join(f"{value:g}" for value in study.load)
    figure.suptitle(
        f"{study.model}: what a tolerance costs, {study.wrists} virtual wrists, load {load}",
        fontsize=10,
    )
    save_figure(figure, path)
