"""Draw the pictures of docs/find-the-missing-effect.md again.

    python test/data/draw_tutorial.py FOLDER

FOLDER is where the commands of the tutorial were run: its models are compared once more.
"""

from __future__ import annotations

import sys
from pathlib import Path

from wrist_stiffness.commands.compare import compare
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.report.parts import against, unit_of
from wrist_stiffness.report.pictures.dependence import draw_against
from wrist_stiffness.report.pictures.errors import Bars, draw_bars

RECORDINGS = Path(__file__).parent / "tutorial"
PICTURES = Path(__file__).parents[2] / "docs/pictures"

STORIES = {
    "tutorial-known": ("tuesday", "the side of approach", ("wrist_7", "worn")),
    "tutorial-unknown": ("thursday", "clamp_bar", ("worn", "clamped")),
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
            f"{q.name} [{unit_of(q.unit)}]",
            models,
            [model.after[q.key].rms for model in found.models],
            [model.after[q.key].uncertainty for model in found.models],
            {"instrument noise": found.noise[q.key]},
        )
        for q in found.quantities
    ]
    draw_bars(bars).savefig(PICTURES / f"{name}-fall.png", dpi=130)
    told = next(each for each in found.models[0].explained.told if topic in each.members)
    others = [(model.name, model.refitted) for model in found.models[1:]]
    shown = against(told.curve, told.name, others)
    draw_against([shown]).savefig(PICTURES / f"{name}-shown.png", dpi=130)


if __name__ == "__main__":
    for each in STORIES:
        draw(each, Path(sys.argv[1]))
