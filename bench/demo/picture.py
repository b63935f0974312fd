"""True errors of a motion without and with correction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from before_after import Pass

from wrist_stiffness.report.pictures.figure import new_figure, save_figure


def draw_before_after(before: Pass, after: Pass, path: Path) -> None:
    """Draw the true errors of both passes of a motion, one above the other.

    Parameters
    ----------
    before, after : Pass
        Settled samples without and with correction.
    path : Path
        PNG to write.
    """
    figure = new_figure(8.0, 6.0)
    pointing, shift = figure.subplots(2, 1, sharex=True)
    for run, name, color in (
        (before, "without correction", "tab:red"),
        (after, "with correction", "tab:blue"),
    ):
        time_s = run.time_s - run.time_s[0]
        mdeg = 1e3 * np.degrees(run.pointing)
        pointing.plot(time_s, mdeg, ".", markersize=2, color=color, label=name)
        shift.plot(time_s, 1e6 * run.shift, ".", markersize=2, color=color, label=f"|s| {name}")
    handed_on = 1e6 * after.shift_handed_on
    time_s = after.time_s - after.time_s[0]
    shift.plot(
        time_s, handed_on, ".", markersize=2, color="tab:green", label="after the manipulator"
    )
    floor = 1e3 * np.degrees(before.floor)
    pointing.axhline(floor, color="black", linewidth=0.8, label="encoder step alone (RMS)")
    pointing.set_ylabel("pointing error [mdeg]")
    pointing.set_title("True error at rest: what two motors cancel, and what they cannot")
    shift.set_ylabel("shift of the centre [µm]")
    shift.set_xlabel("time in the motion [s]")
    for plot in (pointing, shift):
        plot.set_ylim(bottom=0.0)
        plot.legend(fontsize=7, markerscale=4, loc="upper right")
        plot.grid(alpha=0.3)
    save_figure(figure, path)
