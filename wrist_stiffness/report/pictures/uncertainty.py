"""Picture of what a prediction's error is made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wrist_stiffness.commands.uncertainty import Contribution
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.report.pictures.figure import new_figure, save_figure


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
