"""What `compare` tells on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.comparing.comparison import ComparedModel
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.report.parts import number

if TYPE_CHECKING:
    from wrist_stiffness.commands.compare import Compared


def comparison_lines(compared: Compared) -> list[str]:
    """Return the answer for a terminal."""
    found, last = compared.comparison, compared.comparison.models[-1]
    out = [*found.verdict, "", *_table(compared)]
    out += ["", f"{last.name}: on what the error depends"]
    out += [f"  - {sentence}" for sentence in sentences(last.explained)]
    out += ["", f"{last.name}: worst poses", *_worst(compared, last)]
    if compared.notes:
        out += ["", *(f"note: {note}" for note in compared.notes)]
    return out


def _table(compared: Compared) -> list[str]:
    found = compared.comparison
    wide = max(38, *(len(model.name) + 4 for model in found.models))
    keys = [q.key for q in found.quantities]
    heads = "".join(f"{f'{q.name} [{q.unit}]':>29}" for q in found.quantities)
    out = [" " * wide + heads, " " * wide + f"{'mean':>11}{'RMS':>9}{'max':>9}" * len(keys)]
    for title, stage in (
        ("as it stands", "before"),
        ("registrations, zeros, tare refitted", "after"),
    ):
        out.append(title)
        for model in found.models:
            sizes = [getattr(model, stage)[key] for key in keys]
            cells = "".join(
                f"{number(size.mean, 4):>11}{number(size.rms, 4):>9}{number(size.maximum, 4):>9}"
                for size in sizes
            )
            out.append(f"  {model.name:{wide - 2}}{cells}")
    for title, level in compared.levels():
        cells = "".join(f"{'':11}{number(level[key], 4):>9}{'':9}" for key in keys)
        out.append(f"{title:{wide}}{cells}".rstrip())
    return out


def _worst(compared: Compared, model: ComparedModel) -> list[str]:
    quantities = compared.comparison.quantities
    titles = "".join(f"{f'{q.name} [{q.unit}]':>13}" for q in quantities)
    out = [f"{'time [s]':>10}{'motors [deg]':>18}{'force [N]':>24}{titles}  session"]
    for pose in compared.worst(model):
        motors = " ".join(f"{angle:.1f}" for angle in pose.theta_deg)
        force = " ".join(f"{value:.2f}" for value in np.round(pose.load[:3], 2) + 0.0)
        errors = "".join(f"{number(pose.errors[q.key]):>13}" for q in quantities)
        out.append(f"{pose.time_s:10.1f}{motors:>18}{force:>24}{errors}  {pose.session}")
    return out
