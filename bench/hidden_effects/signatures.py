"""Draw what hidden effects do to the residual, as a user would see it without noise.

Writes docs/pictures/hidden_effects.png: four of the catalogue, and four outside it.

    python bench/hidden_effects/signatures.py [--table TABLE] [--output FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.report.pictures.figure import new_figure, save_figure
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import CATALOGUE, STRANGERS, HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings
from wrist_stiffness.simulation.size import Scale

SECONDS, RATE_HZ = 40.0, 50.0
SIZE = 3.0
SHAPE_SEED = 3
DRAWN = (
    ("link_stiffness", "joint_clearance", "backlash", "thermal_expansion"),
    ("loose_seat", "cable_stop", "dent", "swelling"),
)
"""One row each; of every kind of time course one."""

SHOWN = {
    "m": ((1e6, "µm"), (1e3, "mm")),
    "s": ((1e3, "ms"),),
    "rad": ((180e3 / np.pi, "mdeg"), (180.0 / np.pi, "deg")),
    "m/N": ((1e6, "µm/N"),),
    "rad/(N m)": ((180.0 / np.pi, "mdeg/(N mm)"),),
    "m/K^2": ((1e6, "µm/K²"), (1e3, "mm/K²")),
    "-": ((1.0, ""),),
}
"""Factors from SI to the units that are shown; the first that gives less than a thousand."""


def sized_or_largest(scale: Scale, start: HiddenEffect) -> tuple[HiddenEffect, str]:
    """Return the effect at `SIZE`, or at its plausible magnitude, and what the panel says."""
    try:
        return scale.sized(start, SIZE), f"size {SIZE:g}"
    except InputError:
        return start, f"plausible, size {scale.size(start):.2g}"


def amount(magnitude: float, unit: str) -> str:
    """Return a magnitude in a unit that people use."""
    units = SHOWN.get(unit, ((1.0, unit),))
    factor, shown = next((u for u in units if u[0] * magnitude < 1000.0), units[-1])
    return f"{factor * magnitude:.3g} {shown}".strip()


def draw(scale: Scale, path: Path) -> None:
    """Draw shift over rotation for each effect, at the first place where it may be."""
    entries = CATALOGUE | STRANGERS
    figure = new_figure(3.2 * len(DRAWN[0]), 3.6 * len(DRAWN))
    panels = figure.subplots(2 * len(DRAWN), len(DRAWN[0]), sharex=True)
    for row, effects in enumerate(DRAWN):
        for column, effect in enumerate(effects):
            entry = entries[effect]
            start = HiddenEffect(
                effect, entry.components[0], entry.forms[0], entry.plausible, SHAPE_SEED
            )
            hidden, note = sized_or_largest(scale, start)
            change = scale.signature(hidden)
            shift, rotation = panels[2 * row : 2 * row + 2, column]
            for axis, name in enumerate("xyz"):
                shift.plot(scale.time_s, 1e6 * change[:, axis], linewidth=1.0, label=f"s_{name}")
            phi = np.degrees(np.linalg.norm(change[:, 3:], axis=1)) * 1e3
            rotation.plot(scale.time_s, phi, color="0.3", linewidth=1.0)
            # From zero: a constant rotation would show its rounding else.
            rotation.set_ylim(0.0, 1.1 * float(phi.max()) + 1e-3)
            shift.set_title(
                f"{effect} at {hidden.component}\n{amount(hidden.magnitude, entry.unit)} ({note})",
                fontsize=9,
            )
    for axes in panels[0::2, 0]:
        axes.set_ylabel("s [µm]")
    for axes in panels[1::2, 0]:
        axes.set_ylabel("phi [mdeg]")
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    lines = panels[0, 0].get_lines()
    figure.legend(
        lines, [str(each.get_label()) for each in lines], ncols=3, loc="outside upper left"
    )
    save_figure(figure, path)


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", help="default: the shipped one")
    parser.add_argument("--output", default="docs/pictures", help="folder of the pictures")
    arguments = parser.parse_args()
    table: Table = load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz"))
    folder = Path(arguments.output)
    folder.mkdir(parents=True, exist_ok=True)
    settings = CellSettings(rate_hz=RATE_HZ, program_seconds=SECONDS, program_seed=1)
    scale = Scale(table, settings, SECONDS)
    draw(scale, folder / "hidden_effects.png")


if __name__ == "__main__":
    main()
