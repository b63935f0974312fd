"""The recordings that a command names, as measured sessions in the order of time."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.calibration import CALIBRATED
from wrist_stiffness.model.contribution import left_out
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import file_sha256
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.reading.folder import recordings_in
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.refitted import BUILT, SET_UP


@dataclass(frozen=True)
class Recordings:
    """Which recordings to read, and how they name things.

    Parameters
    ----------
    paths : sequence of path
        Recordings, or folders of recordings.
    topics : dict of str to str
        Actual by standard topic name.
    settings : StreamSettings
        Names of the motors, sensor frames and the age limit of loads, as the nodes have them.
    """

    paths: Sequence[str | Path]
    topics: Mapping[str, str]
    settings: StreamSettings = field(default_factory=StreamSettings)


def read_sessions(
    recordings: Recordings, models: Sequence[ErrorModel], progress: Progress = silent
) -> dict[Path, MeasuredSession]:
    """Read recordings with measured poses, each a session with a name of its own.

    Parameters
    ----------
    recordings : Recordings
        What to read.
    models : sequence of ErrorModel
        What the command works with.  The table is that of the first; what a recording has no signal
        for is said of all.
    progress : callable, optional
        Told recordings done and in all.

    Returns
    -------
    dict of Path to MeasuredSession
        In the order of time.  A copy of another one, also by way of `replay` or of a table, is no
        second session, and is said.

    Raises
    ------
    WristError
        If there is no model, or a recording cannot be used.
    """
    if not models:
        raise InputError("read_sessions needs a model: its table says of which wrist they are")
    given = recordings_in(recordings.paths)
    found: dict[Path, MeasuredSession] = {}
    first: dict[str, Path] = {}
    for done, path in enumerate(given):
        progress(done, len(given))
        table, settings = models[0].table, recordings.settings
        session = read_session(path, table, remaps=recordings.topics, settings=settings)
        same = first.setdefault(measured_sha256(session), path)
        if same == path:
            twice = ["given more than once: used once"] if given[path] > 1 else []
            found[path] = _with_remarks(
                session, [*twice, *_without_meaning(session), *_without_signal(session, models)]
            )
        else:
            said = f"{path} holds the same measurements: used once"
            found[same] = _with_remarks(found[same], [said])
    progress(len(given), len(given))
    names = Counter(session.name for session in found.values())
    named = {
        path: session if names[session.name] == 1 else replace(session, name=str(path))
        for path, session in found.items()
    }
    return dict(sorted(named.items(), key=lambda item: float(item[1].block.time[0])))


def _with_remarks(session: MeasuredSession, remarks: Sequence[str]) -> MeasuredSession:
    return replace(session, remarks=(*session.remarks, *remarks))


def _without_meaning(session: MeasuredSession) -> list[str]:
    """Return a warning where the notes call something calibrated that no fit refits."""
    said = session.notes.get(CALIBRATED)
    known = [law for law, _ in (*SET_UP, *BUILT)]
    names = [name for name in said if name not in known] if isinstance(said, list) else []
    if not names:
        return []
    return [
        f"note {CALIBRATED!r} names {', '.join(map(str, names))}, without effect; what is refitted "
        f"are {', '.join(known)}"
    ]


def _without_signal(session: MeasuredSession, models: Sequence[ErrorModel]) -> list[str]:
    """Return a warning for each effect that the models must leave out, for want of a signal.

    A signal is there in all samples or in none, so the first one tells, put where any table holds.
    """
    first = session.block.take(slice(0, 1))
    first = replace(first, theta=np.zeros((1, 2)), load=np.zeros((1, 6)))
    lacking = (lack for model in models for lack in model.batch(first).lacking.items())
    return [left_out(*lack) for lack in dict.fromkeys(lacking)]


def remarks_of(sessions: Iterable[MeasuredSession]) -> tuple[str, ...]:
    """Return what the sessions say of themselves, each with its session's name."""
    return tuple(f"{session.name}: {remark}" for session in sessions for remark in session.remarks)


def was_fitted_to(model: ErrorModel, sessions: Mapping[Path, MeasuredSession]) -> bool:
    """Tell whether a model was fitted to one of these sessions, or to a copy or replay of one."""
    return bool(fitted_among(model, sessions))


def fitted_among(model: ErrorModel, sessions: Mapping[Path, MeasuredSession]) -> list[str]:
    """Return the names of those sessions to which, or to a copy or replay, a model was fitted."""
    known = {
        sha256
        for step in model.lineage
        for sha256 in (*step.recordings.values(), *step.measured.values())
    }
    return [
        session.name
        for path, session in sessions.items()
        if known and (measured_sha256(session) in known or recording_sha256(path) in known)
    ]


def measured_sha256(session: MeasuredSession) -> str:
    """Return the SHA-256 of what no other session has: when which pose was measured, to the bit."""
    rows = session.measured.any(axis=1)
    poses = np.hstack([session.shift[rows], session.rotation[rows].reshape(-1, 9)])
    if session.readings is not None:
        poses = session.readings[rows]
    said = np.column_stack([session.block.time[rows], np.nan_to_num(poses)])
    return hashlib.sha256(said.tobytes()).hexdigest()


def sha256_by_name(sessions: Mapping[Path, MeasuredSession]) -> dict[str, str]:
    """Return the SHA-256 of each session's recording by the session's name."""
    return {session.name: recording_sha256(path) for path, session in sessions.items()}


def recording_sha256(path: Path) -> str:
    """Return the SHA-256 of a recording's file, or of the checksums of several (InputError)."""
    if not path.is_dir():
        return file_sha256(path)
    files = sorted(path.glob("*.mcap"))
    if len(files) == 1:
        return file_sha256(files[0])
    return hashlib.sha256("".join(file_sha256(file) for file in files).encode()).hexdigest()
