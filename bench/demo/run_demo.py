"""The main job from end to end: table, live nodes, recording, replay, before and after."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from before_after import Pass, before_and_after
from compare_runs import RunComparison, compare_runs

from wrist_stiffness.commands.cell import Tell, check_numbers, run_cell
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.progress import Progress
from wrist_stiffness.recording.writer import is_only_recording

LIVE, REPLAYED = "live", "replayed"


@dataclass(frozen=True)
class DemoResult:
    """What the demo showed.

    Parameters
    ----------
    table : Table
        That the nodes used.
    comparison : RunComparison
        Live against replayed.
    before, after : Pass
        True errors without and with correction.
    """

    table: Table
    comparison: RunComparison
    before: Pass
    after: Pass


def run_demo(
    folder: str | Path,
    model: str | Path,
    seconds: float,
    progress: Callable[[str], Progress],
    tell: Tell,
) -> DemoResult:
    """Run the main job and leave its recordings in a folder.

    Parameters
    ----------
    folder : path
        Made if missing; what an earlier demo left there is replaced.
    model : path
        Model file of nodes and virtual wrist.
    seconds : float
        About how long the live run takes [s].
    progress : callable
        Given a label, returns what is called with steps done and in all.
    tell : callable
        Called with a line for every node that had to be killed.

    Returns
    -------
    DemoResult
        Counts and errors.

    Raises
    ------
    WristError
        If a step fails or a live node fell silent, or the folder holds something else under a
        recording's name.
    """
    check_numbers(seconds)
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from error
    left_over = [folder / name for name in (LIVE, REPLAYED) if (folder / name).exists()]
    for left in left_over:
        if not left.is_dir() or not is_only_recording(left):
            raise InputError(f"{left} is not only a recording and is never overwritten")
    for left in left_over:
        shutil.rmtree(left)
    table = load_model(model).table
    sound = run_cell(
        Path(model), seconds, folder / LIVE, progress=progress("live nodes"), tell=tell
    )
    if not sound:
        raise InputError(f"demo: not every node answered and ended; {folder / LIVE} is kept")
    replay(folder / LIVE, model, folder / REPLAYED, progress=progress("replay"))
    before, after = before_and_after(folder / LIVE, table)
    return DemoResult(
        table=table,
        comparison=compare_runs(folder / LIVE, folder / REPLAYED, model),
        before=before,
        after=after,
    )


def beyond(error: float, floor: float) -> float:
    """Return the part of an RMS error that is independent of the encoder step.

    Parameters
    ----------
    error, floor : float
        RMS of the whole and of the encoder step alone, in one unit.

    Returns
    -------
    float
        Root of the difference of squares; 0 where the error is below the floor.
    """
    return float(np.sqrt(max(error**2 - floor**2, 0.0)))
