"""What the package is for, in two minutes: correct a wrist live, then find what its model lacks."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from before_after import Pass, before_and_after
from compare_runs import RunComparison, compare_runs

from wrist_stiffness.analysis import Analysis, Version
from wrist_stiffness.commands.cell import Tell, check_numbers, run_cell
from wrist_stiffness.commands.read_sessions import Recordings, read_sessions
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.answer import Diagnosis
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.progress import Progress
from wrist_stiffness.recording.writer import is_only_recording
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

LIVE, REPLAYED = "live", "replayed"

FAULT = HiddenEffect("backlash", "motor_2", "single", float(np.radians(0.060)), 0)
"""Play of a drive, four encoder steps."""

DAYS = ("fault_day_1", "fault_day_2")
DAY_S, DAY_HZ = 60.0, 10.0
PATIENCE_S = 30.0
"""After that no further fit of the diagnosis begins."""


@dataclass(frozen=True)
class Fault:
    """How the hidden fault was found.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of both days, the second one held out.
    before, after : Version
        Model without and with what was found; None after where nothing was named.
    noise : dict of str to float
        Noise of one unit and drift of the instrument, RMS by the key of the quantity.
    """

    diagnosis: Diagnosis
    before: Version
    after: Version | None
    noise: dict[str, float]


@dataclass(frozen=True)
class DemoResult:
    """What the demo showed.

    Parameters
    ----------
    comparison : RunComparison
        Live against replayed.
    before, after : Pass
        True errors under 3 N, without and with correction.
    fault : Fault
        The second half.
    """

    comparison: RunComparison
    before: Pass
    after: Pass
    fault: Fault


def run_demo(
    folder: str | Path,
    model: str | Path,
    seconds: float,
    progress: Callable[[str], Progress],
    tell: Tell,
) -> DemoResult:
    """Correct a wrist under 3 N, find a hidden fault, and leave the recordings in a folder.

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
    names = (LIVE, REPLAYED, *DAYS)
    left_over = [folder / name for name in names if (folder / name).exists()]
    for left in left_over:
        if not left.is_dir() or not is_only_recording(left):
            raise InputError(f"{left} is not only a recording and is never overwritten")
    for left in left_over:
        shutil.rmtree(left)
    live, again, known = folder / LIVE, folder / REPLAYED, load_model(model)
    sound = run_cell(
        Path(model), seconds, live, experiment="heavy", progress=progress("live nodes"), tell=tell
    )
    if not sound:
        raise InputError(f"demo: not every node answered and ended; {live} is kept")
    replay(live, model, again, progress=progress("replay"))
    before, after = before_and_after(live, known.table)
    fault = find_fault(known, folder, progress)
    return DemoResult(compare_runs(live, again, model), before, after, fault)


def find_fault(model: ErrorModel, folder: Path, progress: Callable[[str], Progress]) -> Fault:
    """Record two days of a wrist with `FAULT`, ask what is missing, and add what is named.

    Parameters
    ----------
    model : ErrorModel
        Knows nothing of the fault.
    folder : Path
        For the recordings.
    progress : callable
        As for `run_demo`.

    Returns
    -------
    Fault
        Answer, and the models without and with it.
    """
    paths = [folder / name for name in DAYS]
    for day, path in enumerate(paths, start=1):
        cell = CellSettings(
            rate_hz=DAY_HZ, program_seconds=DAY_S, program_seed=day, hidden=(FAULT,), session=day
        )
        simulate_recording(path, model.table, cell, DAY_S, seed=day)
    sessions = read_sessions(Recordings(paths, {}), [model])
    analysis = Analysis(model, list(sessions.values()), progress("fault"))
    diagnosis = analysis.rank(seconds=PATIENCE_S).diagnosis
    noise = dict(analysis.view().noise)
    before = analysis.versions[-1]
    named = [finding.names[0] for finding in diagnosis.findings]
    return Fault(diagnosis, before, analysis.add(named[0]) if named else None, noise)
