"""Draw what each hidden effect does to the residual, as a user would see it without noise.

Writes docs/pictures/hidden_effects.png and hidden_effects_strangers.png.  About two minutes.

    python bench/hidden_effects/signatures.py [--table TABLE] [--output FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.report.pictures.figure import new_figure, save_figure
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import CATALOGUE, STRANGERS, Entry, HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings
from wrist_stiffness.simulation.size import Scale

SECONDS, RATE_HZ = 40.0, 50.0
SIZE = 3.0
SHAPE_SEED = 3
COLUMNS = 5

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


def draw_page(scale: Scale, entries: dict[str, Entry], path: Path) -> None:
    """Draw one panel for each effect at its first place."""
    rows = -(-len(entries) // COLUMNS)
    figure = new_figure(3.4 * COLUMNS, 2.1 * rows)
    panels = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
    progress = Progress(path.stem)
    for number, (effect, entry) in enumerate(entries.items()):
        panel = panels[number]
        start = HiddenEffect(
            effect, entry.components[0], entry.forms[0], entry.plausible, SHAPE_SEED
        )
        hidden, note = sized_or_largest(scale, start)
        change = scale.signature(hidden)
        for axis, name in enumerate("xyz"):
            panel.plot(scale.time_s, 1e6 * change[:, axis], linewidth=0.9, label=f"s_{name}")
        panel.set_ylabel("shift [µm]", fontsize=8)
        turned = panel.twinx()
        turn = np.degrees(np.linalg.norm(change[:, 3:], axis=1)) * 1e3
        turned.plot(scale.time_s, turn, color="0.6", linewidth=0.7, label="φ")
        # From zero: a constant turn would show its rounding else.
        turned.set_ylim(0.0, 1.1 * float(turn.max()) + 1e-3)
        turned.set_ylabel("φ [mdeg]", fontsize=8, color="0.5")
        for side in (panel, turned):
            side.tick_params(labelsize=7)
            side.ticklabel_format(useOffset=False)
        panel.set_title(
            f"{effect}@{hidden.component}\n{amount(hidden.magnitude, entry.unit)}, {note}",
            fontsize=8,
        )
        progress(number + 1, len(entries))
    for panel in panels[len(entries) :]:
        panel.set_visible(False)
    for panel in panels[max(0, len(entries) - COLUMNS) : len(entries)]:
        panel.set_xlabel("time [s]", fontsize=8)
        panel.tick_params(labelbottom=True)
    lines = [*panels[0].get_lines(), *turned.get_lines()]
    figure.legend(
        lines, [str(line.get_label()) for line in lines], ncols=4, loc="outside upper left"
    )
    save_figure(figure, path)


def main() -> None:
    """Draw both pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", help="default: the shipped one")
    parser.add_argument("--output", default="docs/pictures", help="folder of the pictures")
    arguments = parser.parse_args()
    table: Table = load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz"))
    folder = Path(arguments.output)
    folder.mkdir(parents=True, exist_ok=True)
    settings = CellSettings(rate_hz=RATE_HZ, program_seconds=SECONDS, program_seed=1)
    scale = Scale(table, settings, SECONDS)
    draw_page(scale, CATALOGUE, folder / "hidden_effects.png")
    draw_page(scale, STRANGERS, folder / "hidden_effects_strangers.png")


if __name__ == "__main__":
    main()
