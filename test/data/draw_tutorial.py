"""Draw the pictures of docs/find-the-missing-effect.md again.

    python test/data/draw_tutorial.py FOLDER

FOLDER is where the commands of the tutorial were run: its models are compared once more.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from wrist_stiffness.commands.compare import compare
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.comparing.comparison import ComparedModel
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.model.formula_law import TURNS
from wrist_stiffness.report.page import typeset
from wrist_stiffness.report.pictures.errors import Bars, draw_against, draw_bars
from wrist_stiffness.report.pictures.figure import FLOOR, colour, new_figure
from wrist_stiffness.shipped import shipped_file

RECORDINGS = Path(__file__).parent / "tutorial"
PICTURES = Path(__file__).parents[2] / "docs/pictures"

STORIES = {
    "tutorial-known": ("tuesday", "the side of approach", ("wrist_7", "worn")),
    "tutorial-unknown": ("thursday", "clamp_bar", ("worn", "clamped")),
    "tutorial-proposed": ("saturday", "turn_3", ("worn", "proposed_1")),
}
"""Recording, condition and models by the beginning of the pictures' names."""


def draw(name: str, folder: Path) -> None:
    """Draw the fall of the error, and the residual against the condition that shows it."""
    day, topic, models = STORIES[name]
    compared = compare(
        [folder / f"{model}.yaml" for model in models],
        Recordings((RECORDINGS / f"{day}.mcap",), {}, StreamSettings()),
        Run("draw_tutorial.py", ""),
    )
    found = compared.comparison
    bars = [
        Bars(
            f"{q.name} [{typeset(q.unit)}]",
            models,
            [model.after[q.key].rms for model in found.models],
            [model.after[q.key].rms_uncertainty for model in found.models],
            {"instrument noise": found.noise[q.key]},
        )
        for q in found.quantities
    ]
    draw_bars(bars).savefig(PICTURES / f"{name}-fall.png", dpi=130)
    if topic in TURNS:
        figure = over_turn(topic, found.models)
    else:
        told = next(each for each in found.models[0].explained.told if topic in each.members)
        others = [(model.name, model.refitted) for model in found.models[1:]]
        figure = draw_against([told], others)
    figure.savefig(PICTURES / f"{name}-shown.png", dpi=130)


def over_turn(turn: str, models: Sequence[ComparedModel]) -> Figure:
    """Draw the rotations that models leave, along the longest axis of the first, over a joint."""
    table, joint = load_table(shipped_file("precomputed/palmieri2015.npz")), TURNS[turn]
    left = [model.refitted for model in models]
    theta = np.stack([left[0].covariates[name] for name in ("theta_1", "theta_2")], axis=1)
    pose = table.mechanism.forward(theta)
    degrees = np.degrees(pose.turn(joint, table.geometry.axes[joint]))
    phi = [np.degrees(1e3 * each.values[:, 3:]) for each in left]
    axis = np.linalg.svd(np.nan_to_num(phi[0]), full_matrices=False)[2][0]
    figure = new_figure(5.0, 3.8)
    plot = figure.subplots()
    for number, (model, values) in enumerate(zip(models, phi, strict=True)):
        plot.plot(degrees, values @ axis, ".", color=colour(number), label=model.name)
    plot.axhline(0.0, color=FLOOR, linewidth=0.6)
    where = ", ".join(f"{each:.2f}" for each in axis)
    plot.set(xlabel=f"turn of {joint} from home [deg]", ylabel=f"phi about ({where}) [mdeg]")
    plot.grid(alpha=0.3)
    plot.legend(fontsize=8)
    return figure


if __name__ == "__main__":
    for each in STORIES:
        draw(each, Path(sys.argv[1]))
