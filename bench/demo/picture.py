"""The demo in one picture: corrected under load, a hidden fault named, the error down to noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from before_after import Pass, rms
from run_demo import DemoResult, Fault

from wrist_stiffness.numerals import percent
from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure, save_figure

CANDIDATES = 5
"""The most probable ones are drawn."""

ROOM = 1.3
"""Axes over the largest value: the legend lies above."""


def draw_demo(result: DemoResult, path: Path) -> None:
    """Draw what the demo showed, from left to right in the order of its steps.

    Parameters
    ----------
    result : DemoResult
        Of `run_demo.run_demo`.
    path : Path
        PNG to write.
    """
    figure = new_figure(13.0, 4.2)
    corrected, found, added = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 0.8))
    _draw_correction(corrected, result.before, result.after)
    _draw_finding(found, result.fault)
    _draw_fall(added, result.fault)
    save_figure(figure, path)


def _draw_correction(plot: Any, before: Pass, after: Pass) -> None:
    sizes = [1e3 * np.degrees(rms(each.pointing)) for each in (before, after)]
    for number, (run, name) in enumerate(((before, "without"), (after, "with"))):
        time_s = run.time_s - run.time_s[0]
        mdeg = 1e3 * np.degrees(run.pointing)
        label = f"{name} correction"
        plot.plot(time_s, mdeg, ".", markersize=3, color=colour(1 - number), label=label)
    floor = 1e3 * np.degrees(before.floor)
    plot.axhline(floor, color=FLOOR, linewidth=1.0, label="encoder step alone (RMS)")
    plot.set_title(f"1. Correction under 3 N: {sizes[0]:.0f} to {sizes[1]:.0f} mdeg (RMS)")
    plot.set_xlabel("time in the motion [s]")
    plot.set_ylabel("true pointing error at rest [mdeg]")
    plot.set_ylim(0.0, ROOM * 1e3 * np.degrees(before.pointing.max()))
    plot.legend(fontsize=8, loc="upper right")


def _draw_finding(plot: Any, fault: Fault) -> None:
    best = fault.diagnosis.standings[:CANDIDATES]
    names = [each.name.replace("@", "\n") for each in best]
    shares = [100.0 * each.probability for each in best]
    bars = plot.barh(names, shares, color=colour(2))
    plot.bar_label(bars, [percent(each.probability) for each in best], padding=3)
    plot.invert_yaxis()
    plot.set_xlim(0.0, 130.0)
    plot.set_xticks([0, 50, 100])
    plot.set_xlabel("probability that it is missing [%]")
    plot.set_title("2. A fault was hidden: what is it?")
    plot.tick_params(axis="y", labelsize=8)


def _draw_fall(plot: Any, fault: Fault) -> None:
    errors = {"model\nas given": fault.before.held_out["phi_mdeg"]}
    if fault.after is not None:
        errors["fault\nadded"] = fault.after.held_out["phi_mdeg"]
    bars = plot.bar(errors.keys(), errors.values(), color=(colour(1), colour(0)), width=0.6)
    plot.bar_label(bars, fmt="%.1f")
    noise = fault.noise["phi_mdeg"]
    plot.axhline(noise, color=FLOOR, linewidth=1.0, label="noise of the instrument")
    plot.set_ylabel("error phi on another day, RMS [mdeg]")
    plot.set_title("3. The error falls")
    plot.set_ylim(0.0, ROOM * max(errors.values()))
    plot.legend(fontsize=8, loc="upper right")
