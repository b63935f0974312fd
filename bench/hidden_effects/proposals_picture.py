"""Draw what proposed laws leave of each stranger's error in stretches that no search has seen.

python bench/hidden_effects/proposals_picture.py LINES.jsonl PICTURE.png

LINES are those of `proposals.py --output`; each stranger is shown at the smallest of its sizes.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from wrist_stiffness.identification.proposal import twins
from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure, save_figure

Line = Mapping[str, Any]

COLUMNS = 4

SERIES = {
    "nothing": ("as it is", {"color": "#999999", "linewidth": 2.2, "zorder": 2}),
    "process": ("after the Gaussian process", {"color": colour(0), "linewidth": 1.0, "zorder": 3}),
    "law": ("after the proposed law", {"color": colour(1), "linewidth": 1.2, "zorder": 4}),
}

SHOWN = {"um": ("shift", "µm"), "mdeg": ("rotation", "mdeg")}

GAP_S = 5.0
"""Between two units beyond which they belong to different stretches."""

JOINT_S = 2.0
"""Between stretches in the picture."""

LAW_WIDTH = 37
"""Letters of a law in one line."""


def draw(lines: Sequence[Line], path: Path) -> None:
    """Draw a panel for each stranger."""
    kept: dict[str, Line] = {}
    for line in sorted(lines, key=lambda each: each["size"]):
        if "shown" in line:
            kept.setdefault(line["truth"][0], line)
    rows = -(-len(kept) // COLUMNS)
    figure = new_figure(10.4, 1.9 * rows + 0.6)
    panels = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
    for axes in panels.ravel()[len(kept) :]:
        axes.axis("off")
    for axes, (_, line) in zip(panels.ravel(), sorted(kept.items()), strict=False):
        _panel(axes, line)
    for axes in panels[-1]:
        axes.set_xlabel("held-out time [s]", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=4, loc="outside upper center", frameon=False, fontsize=9)
    save_figure(figure, path)


def _panel(axes: Any, line: Line) -> None:
    shown = line["shown"]
    at, stretch = _beside(np.array(shown["time_s"]))
    for name, (label, style) in SERIES.items():
        values = np.array(shown[name])
        for number in range(stretch[-1] + 1):
            own = stretch == number
            axes.plot(at[own], values[own], label=None if number else label, **style)
    axes.axhspan(
        -2.0 * shown["noise"],
        2.0 * shown["noise"],
        color=FLOOR,
        alpha=0.18,
        linewidth=0.0,
        label="noise, 95 %",
    )
    top = max(float(np.abs(shown[name]).max()) for name in ("nothing", "law"))
    axes.set_ylim(-1.1 * top, 1.1 * top)
    what, unit = SHOWN[shown["unit"]]
    axes.set_ylabel(f"{what} [{unit}]", fontsize=8, labelpad=1)
    axes.tick_params(labelsize=7)
    text = fill(_law(line), LAW_WIDTH)
    axes.set_title("@".join(line["truth"]) + "\n" * (1 + text.count("\n")), fontsize=9, loc="left")
    style = {"color": colour(2), "weight": "bold"} if line["right_sentence"] else {"color": FLOOR}
    law = axes.text(0.0, 1.04, text, fontsize=6.8, transform=axes.transAxes, **style)
    law.set_in_layout(False)


def _law(line: Line) -> str:
    """Return the first law in short, at the stranger's own place if that is a twin."""
    if not line["laws"]:
        return "no law"
    component, truth = line["components"][0], line["truth"][1]
    form = line["forms"][0].removeprefix("a ").removeprefix("the ")
    return f"{form} at {truth if truth in twins(component) else component}"


def _beside(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times with the stretches moved together, and the number of each unit's stretch."""
    steps = np.diff(time_s, prepend=time_s[0])
    joints = steps > GAP_S
    return np.cumsum(np.where(joints, JOINT_S, steps)), np.cumsum(joints)


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("lines", type=Path)
    parser.add_argument("picture", type=Path)
    given = parser.parse_args()
    draw([json.loads(line) for line in given.lines.read_text().splitlines()], given.picture)


if __name__ == "__main__":
    main()
