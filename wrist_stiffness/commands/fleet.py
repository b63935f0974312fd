"""One function over many recordings or other items: processors of this machine, or Dask's.

For a command that takes a folder of recordings, each of a wrist of its own::

    def summary(path: Path, model: str) -> dict[str, float]:     # at the top of a module
        session = read_session(path, load_model(model).table)
        return {"poses": len(session)}

    rows = map_recordings(partial(summary, model="wrist.yaml"), recordings_in([folder]), ...)

Workers are processes of their own: function and result are pickled, so the function is one of a
module and everything else reaches it by `functools.partial`.  Paths are opened where the worker
runs; a cluster needs them on a file system that all see.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from itertools import islice
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.reading.folder import recordings_in

Item = TypeVar("Item")
Result = TypeVar("Result")

CONNECT_S = 10.0

NAME = "wrist_stiffness"


class Answer(NamedTuple, Generic[Result]):
    """What a function returned, None where it failed, and why it did, in one line."""

    result: Result | None
    error: str


@dataclass(frozen=True)
class FleetRow(Generic[Result]):
    """What one recording gave.

    Parameters
    ----------
    path : Path
        The recording.
    result : any
        What the function returned; None where it failed.
    error : str
        Why it failed, one line; empty where it did not.
    """

    path: Path
    result: Result | None
    error: str = ""

    @property
    def reason(self) -> str:
        """The error without the path, which a table has before it."""
        return self.error.removeprefix(f"{self.path}: ").removeprefix(f"{self.path} ")


def table_values(rows: Sequence[FleetRow[dict[str, Any]]], what: str) -> dict[str, Any]:
    """Return what programs read of rows: under this name each result, or None and the error."""
    return {
        "schema": 1,
        "recordings": [
            {"recording": str(row.path), "error": row.error or None, what: row.result}
            for row in rows
        ],
    }


class Told(Protocol):
    """What a command returns."""

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""


def each_recording(
    command: Callable[[Recordings], Told],
    recordings: Recordings,
    scheduler_address: str | None,
    progress: Progress,
) -> list[FleetRow[dict[str, Any]]]:
    """Run a command on every recording by itself, as of a wrist of its own, in parallel.

    Parameters
    ----------
    command : callable
        Of recordings; can be pickled.
    recordings : Recordings
        Recordings, or folders of them.
    scheduler_address, progress
        As those of `map_recordings`.

    Returns
    -------
    list of FleetRow
        With what the command gives for a program.

    Raises
    ------
    InputError
        If there is no recording, or no scheduler answers.
    """
    one = partial(_values, command=command, recordings=recordings)
    paths = recordings_in(recordings.paths)
    return map_recordings(one, paths, scheduler_address, progress=progress)


def _values(
    path: Path, command: Callable[[Recordings], Told], recordings: Recordings
) -> dict[str, Any]:
    return command(replace(recordings, paths=[path])).as_values()


def map_recordings(
    function: Callable[[Path], Result],
    paths: Sequence[Path],
    scheduler_address: str | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> list[FleetRow[Result]]:
    """Call a function of one recording for each of many.

    Parameters
    ----------
    function : callable
        Of a path; can be pickled.
    paths : sequence of Path
        Recordings (see `sessions.reading.folder.recordings_in`).
    scheduler_address : str, optional
        Of a running Dask scheduler, `tcp://HOST:PORT`; processes of this machine if None.
    workers : int, optional
        Processes on this machine; one for each processor, at most one for each recording, if None.
    progress : callable
        Told recordings done and in all.

    Returns
    -------
    list of FleetRow
        In the order of the paths.  A recording that fails is a row with its error, not a stop.

    Raises
    ------
    InputError
        If no scheduler answers at the address, or its workers have not this package's version.
    ModuleNotFoundError
        Without the extra `fleet`, where more than one recording is given or a scheduler.
    """
    answers = spread(function, paths, scheduler_address, workers, progress)
    return [FleetRow(path, *answer) for path, answer in zip(paths, answers, strict=True)]


def spread(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    scheduler_address: str | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> list[Answer[Result]]:
    """Call a function of one item for each of many, as `map_recordings` does for paths.

    A worker that dies loses nothing: what it had in hand goes to another one, up to three times.

    Returns
    -------
    list of Answer
        In the order of the items.
    """
    if len(items) <= 1 and scheduler_address is None:
        return [attempt(function, item) for item in items]
    import cloudpickle
    from distributed import as_completed

    answers: list[Answer[Result]] = [Answer(None, "") for _ in items]
    # As bytes: a worker that cannot load the function says so instead of dying over it.
    pickled = cloudpickle.dumps(function)
    with _client(scheduler_address, workers or _processors(len(items))) as client:
        waiting = iter(range(len(items)))
        number: dict[Any, int] = {}

        def submitted(count: int) -> list[Any]:
            new = {
                client.submit(_answer, pickled, items[i], pure=False): i
                for i in islice(waiting, count)
            }
            number.update(new)
            return list(new)

        # One item for each thread at a time: a worker that dies over one takes no other along.
        running = as_completed(submitted(sum(client.nthreads().values())))
        for done, future in enumerate(running, 1):
            i = number.pop(future)
            answers[i] = _answered(future)
            progress(done, len(items))
            running.update(submitted(1))
    return answers


def attempt(function: Callable[[Item], Result], item: Item) -> Answer[Result]:
    """Call a function of one item; whatever goes wrong becomes the answer's error."""
    try:
        return Answer(function(item), "")
    except WristError as error:
        return Answer(None, " ".join(str(error).split()))
    except Exception as error:
        # A fault of one wrist's code path must not take the rest of the fleet's table with it.
        return Answer(None, f"{type(error).__name__}: {' '.join(str(error).split())}")


def _processors(most: int) -> int:
    return min(most, len(os.sched_getaffinity(0)))


@contextmanager
def _client(scheduler_address: str | None, workers: int) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    if scheduler_address is None:
        with _deaf_to_interrupts():
            local = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",
                # What befalls a recording is told in its row.
                silence_logs=logging.CRITICAL,
            )
        with local, Client(local) as client:
            yield client
        return
    try:
        client = Client(scheduler_address, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {scheduler_address} within {CONNECT_S:g} s"
        ) from error
    with client:
        _require_same_version(client, scheduler_address)
        yield client


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Let processes that start here ignore Ctrl-C, which a terminal sends to all of them.

    This process ends them; on their own each would do so with a traceback.
    """
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _require_same_version(client: Any, scheduler_address: str) -> None:
    """Refuse a cluster without workers, or with workers that compute something else."""
    try:
        found = set(client.run(version, NAME).values())
    except PackageNotFoundError as error:
        raise InputError(f"{scheduler_address}: {NAME} is not installed at its workers") from error
    if not found:
        raise InputError(f"{scheduler_address}: the Dask scheduler has no workers")
    if found != {version(NAME)}:
        raise InputError(
            f"{scheduler_address}: its workers have {NAME} {', '.join(sorted(found))}, this "
            f"machine has {version(NAME)}"
        )


def _answer(pickled: bytes, item: Any) -> Answer[Any]:
    return attempt(lambda one: pickle.loads(pickled)(one), item)


def _answered(future: Any) -> Answer[Any]:
    """Return what a worker answered; one item that workers die over is its error."""
    if future.status == "finished":
        answer: Answer[Any] = future.result()
        return answer
    return Answer(None, f"the worker died: {' '.join(str(future.exception()).split())}")
