"""The picture of the closed loop: true pointing error before and after, effect by effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure, save_figure

Rows = Mapping[tuple[str, ...], Mapping[str, Any]]

BEFORE = "#999999"
TICKS = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0)


def draw(exact: Sequence[str], wrong: Sequence[str], rows: Rows, path: Path) -> None:
    """Draw both bases, the largest errors first."""
    parts = [
        ("the wrist was commissioned before", "exact", exact),
        ("the table is wrong, and calibrated", "wrong", wrong),
    ]
    parts = [part for part in parts if part[2]]
    if not parts:
        return
    heights = [len(names) + 1.5 for _, _, names in parts]
    figure = new_figure(7.6, 0.22 * sum(heights) + 1.2)
    panels = figure.subplots(len(parts), 1, sharex=True, squeeze=False, height_ratios=heights)
    for axes, (title, base, names) in zip(panels[:, 0], parts, strict=True):
        _panel(axes, base, names, rows)
        axes.set_title(title, loc="left", fontsize=9)
    panels[-1, 0].set_xlabel("true pointing error at rest, RMS [mdeg]")
    panels[0, 0].legend(
        fontsize=8, loc="lower center", bbox_to_anchor=(0.35, 1.03), ncol=3, frameon=False
    )
    save_figure(figure, path)


def _panel(axes: Any, base: str, names: Sequence[str], rows: Rows) -> None:
    from matplotlib.ticker import FixedLocator, NullLocator

    ranked = sorted(names, key=lambda name: rows[name, base, "told"]["old"]["resting"])
    series: dict[str, list[tuple[float, int]]] = {}
    for place, name in enumerate(ranked):
        told, found = rows[name, base, "told"], rows.get((name, base, "diagnosed"))
        before, after = _mdeg(told["old"]), _mdeg((found or told)["extended"])
        axes.plot([before, after], [place, place], color=BEFORE, linewidth=0.8, zorder=1)
        series.setdefault("before", []).append((before, place))
        series.setdefault("told the name", []).append((_mdeg(told["extended"]), place))
        if found is not None:
            series.setdefault("as diagnosed", []).append((after, place))
        if told["perfect"]:
            series.setdefault("who knows the laws", []).append((_mdeg(told["perfect"]), place))
    styles: dict[str, dict[str, Any]] = {
        "before": {"marker": "o", "color": BEFORE, "s": 16},
        "told the name": {"marker": "o", "color": colour(0), "facecolors": "none", "s": 36},
        "as diagnosed": {"marker": "x", "color": colour(1), "s": 22},
        "who knows the laws": {"marker": "|", "color": FLOOR, "s": 80},
    }
    for label, points in series.items():
        axes.scatter(*zip(*points, strict=True), label=label, **styles[label])
    floor = float(np.mean([_mdeg(rows[name, base, "told"]["floor"]) for name in names]))
    axes.axvline(floor, color=FLOOR, linewidth=0.8, linestyle=":", label="hidden counts alone")
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(TICKS))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yticks(range(len(ranked)), [_short(name) for name in ranked], fontsize=8)
    axes.set_ylim(-0.7, len(ranked) - 0.3)


def _short(name: str) -> str:
    place, _, times = name.partition("*")
    return place.partition(":")[0] + (f" × {times}" if times else "")


def _mdeg(left: Mapping[str, float]) -> float:
    return float(1e3 * np.degrees(left["resting"]))
