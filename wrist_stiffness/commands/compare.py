"""How far models are off from recordings, where and under which condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wrist_stiffness.commands.provenance import Provenance, Run
from wrist_stiffness.commands.read_sessions import (
    Recordings,
    fitted_among,
    read_sessions,
    remarks_of,
    sha256_by_name,
)
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.comparison import ComparedModel, Comparison, WorstPose, worst_poses
from wrist_stiffness.comparing.wiring import WORTH_ASKING
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.progress import Progress, silent


@dataclass(frozen=True, eq=False)
class Compared:
    """A comparison and what it was made from."""

    comparison: Comparison
    border: Array  # (b, 2), motor angles on the border of the operative workspace [rad]
    notes: tuple[str, ...]  # what a reader must know of the numbers
    damage: tuple[str, ...]  # those of them on recordings that are cut or damaged
    provenance: Provenance

    def worst(self, model: ComparedModel) -> tuple[WorstPose, ...]:
        """Return the poses at which a model fails worst."""
        found = self.comparison
        return worst_poses(model.refitted, found.noise, found.sessions)

    def levels(self) -> list[tuple[str, dict[str, float]]]:
        """Return what the errors are to be compared with, by name."""
        found = self.comparison
        models, last = found.models, found.models[-1]
        of = {each.name: f"{each.name}: " if len(models) > 1 else "" for each in models}
        levels = [
            *(
                (f"{of[each.name]}surely above noise and drift", each.explained.above)
                for each in models
            ),
            (f"{of[last.name]}instrument noise{at_most(found.noise_known)}", found.noise),
            (f"{of[last.name]}drift of the instrument", last.explained.drift),
        ]
        if found.repeated_by_side:
            levels.append(("repeatability, from the same side", found.repeated_by_side))
        if found.repeated:
            levels.append(("repeatability, from any side", found.repeated))
        laws = f"{of[models[0].name]}laws of the conditions, unseen part"
        return [*levels, (laws, found.reachable)]

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        values = self.comparison.as_values()
        for model, own in zip(self.comparison.models, values["models"], strict=True):
            own["worst_poses"] = [pose.as_values() for pose in self.worst(model)]
        return {**values, "notes": list(self.notes), "provenance": self.provenance.as_values()}


def compare(
    models: Sequence[str | Path],
    recordings: Recordings,
    run: Run,
    progress: Callable[[str], Progress] = lambda label: silent,
) -> Compared:
    """Compare models with recordings of one wrist.

    `models`: model files, the one to be improved upon first; `progress`: from a label to a function
    that is told steps done and in all.  Raises `WristError` if a model or a recording cannot be
    used.
    """
    names = unique_names(models)
    loaded = [(name, load_model(path)) for name, path in zip(names, models, strict=True)]
    table = loaded[0][1].table
    sessions = read_sessions(recordings, [model for _, model in loaded], progress("reading"))
    comparison = compare_models(loaded, list(sessions.values()), progress("comparing"))
    hashes = sha256_by_name(sessions)
    notes = [
        *remarks_of(sessions.values()),
        *(
            f"{name} was fitted to {', '.join(fitted)}: its error there flatters it"
            for name, model in loaded
            if (fitted := fitted_among(model, sessions))
        ),
    ]
    if not loaded[-1][1].lineage and comparison.over_noise(comparison.models[-1]) >= WORTH_ASKING:
        notes.append(
            f"{names[-1]} was never fitted to a wrist, and each is built a little off its drawing: "
            "calibrate first, then compare again"
        )
    files = {name: file_sha256(path) for name, path in zip(names, models, strict=True)}
    return Compared(
        comparison,
        table.workspace.operative_border,
        tuple(notes),
        tuple(f"{each.name}: {each.damage}" for each in sessions.values() if each.damage),
        Provenance(run.command, run.date, files, hashes),
    )


def unique_names(paths: Sequence[str | Path]) -> list[str]:
    """Return file names without suffix, whole paths where two are alike."""
    stems = [Path(path).stem for path in paths]
    count = Counter(stems)
    return [
        stem if count[stem] == 1 else str(path) for stem, path in zip(stems, paths, strict=True)
    ]
