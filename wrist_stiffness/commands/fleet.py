"""One function over many recordings or other items, on the processors of this machine.

For a command that takes a folder of recordings, each of a wrist of its own::

    def summary(path: Path, model: str) -> dict[str, float]:     # at the top of a module
        session = read_session(path, load_model(model).table)
        return {"poses": len(session)}

    rows = spread(partial(summary, model="wrist.yaml"), list(recordings_in([folder])))

Workers are processes of their own: function and result are pickled, so the function is one of a
module and everything else reaches it by `functools.partial`.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.reading.folder import recordings_in

Item = TypeVar("Item")
Result = TypeVar("Result")

ATTEMPTS = 3
"""Workers that may die over one item."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of libraries that would use every processor in every worker."""

SPAWN = get_context("spawn")


class Answer(NamedTuple, Generic[Item, Result]):
    """What a function made of one item."""

    item: Item
    result: Result | None  # what it returned; None where it failed
    error: str = ""  # why it failed, one line; empty where it did not


Row: TypeAlias = "Answer[Path, dict[str, Any]]"
"""What a command gives a program of one recording."""


def table_values(rows: Sequence[Row], what: str) -> dict[str, Any]:
    """Return what programs read of rows: under this name each result, or None and the error."""
    return {
        "schema": 1,
        "recordings": [
            {"recording": str(row.item), "error": row.error or None, what: row.result}
            for row in rows
        ],
    }


def each_recording(
    command: Callable[[Recordings], Any], recordings: Recordings, progress: Progress
) -> list[Row]:
    """Run a command on every recording by itself, as of a wrist of its own, in parallel.

    `command`: of recordings, its answer has `as_values`; can be pickled.  Raises `InputError` if
    there is no recording, or one is given more than once.
    """
    given = recordings_in(recordings.paths)
    if twice := [str(path) for path, times in given.items() if times > 1]:
        raise InputError(f"{', '.join(twice)}: given more than once; each is a wrist of its own")
    one = partial(_values, command=command, recordings=recordings)
    return spread(one, list(given), progress=progress)


def _values(path: Path, command: Callable[[Recordings], Any], recordings: Recordings) -> Any:
    return command(replace(recordings, paths=[path])).as_values()


def spread(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int | None = None,
    progress: Progress = silent,
) -> list[Answer[Item, Result]]:
    """Call a function of one item for each of many, in their order, on several processes.

    `function`: can be pickled.  `workers`: processes; one for each processor, at most one for each
    item, if None.  An item that fails is an answer with its error, not a stop.  A worker that dies
    loses nothing: what it had in hand goes to another one, up to three times.
    """
    if len(items) <= 1:
        return [attempt(function, item) for item in items]
    # As bytes: a worker that cannot load the function says so instead of dying over it.
    pickled = pickle.dumps(function)
    answers: dict[int, Answer[Item, Result]] = {}
    waiting = list(reversed(range(len(items))))
    deaths = Counter[int]()
    in_hand: dict[_Worker, int] = {}
    most = workers or len(os.sched_getaffinity(0))
    crew = [_Worker(pickled) for _ in range(min(most, len(items)))]
    try:
        while len(answers) < len(items):
            for worker in crew:
                if waiting and worker not in in_hand:
                    in_hand[worker] = waiting.pop()
                    worker.ask(items[in_hand[worker]])
            ready = wait([worker.pipe for worker in in_hand])
            # They have answered or died.
            for worker in [each for each in in_hand if each.pipe in ready]:
                i = in_hand.pop(worker)
                try:
                    answers[i] = worker.pipe.recv()
                except (EOFError, ConnectionError):
                    deaths[i] += 1
                    crew[crew.index(worker)] = _Worker(pickled)
                    died = f"the worker died: exit code {worker.end()}"
                    if deaths[i] < ATTEMPTS:
                        waiting.append(i)
                        continue
                    answers[i] = Answer(items[i], None, died)
                progress(len(answers), len(items))
    finally:
        for worker in crew:
            worker.end()
    return [answers[i] for i in range(len(items))]


def attempt(function: Callable[[Item], Result], item: Item) -> Answer[Item, Result]:
    """Call a function of one item; whatever goes wrong becomes the answer's error."""
    try:
        return Answer(item, function(item))
    except WristError as error:
        return Answer(item, None, " ".join(str(error).split()))
    except Exception as error:
        # A fault of one wrist's code path must not take the rest of the fleet's table with it.
        return Answer(item, None, f"{type(error).__name__}: {' '.join(str(error).split())}")


class _Worker:
    """A process that answers one item after another."""

    def __init__(self, pickled: bytes) -> None:
        self.pipe, theirs = SPAWN.Pipe()
        self._process = SPAWN.Process(target=_serve, args=(pickled, theirs), daemon=True)
        with _worker_surroundings():
            self._process.start()
        theirs.close()

    def ask(self, item: Any) -> None:
        """Hand over an item; where the worker is dead, its pipe says so."""
        with suppress(ConnectionError):
            self.pipe.send(item)

    def end(self) -> int | None:
        """End the process, whatever it does, and return its exit code."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return self._process.exitcode


def _serve(pickled: bytes, pipe: Connection) -> None:
    with suppress(EOFError):
        while True:
            pipe.send(attempt(lambda item: pickle.loads(pickled)(item), pipe.recv()))


@contextmanager
def _worker_surroundings() -> Iterator[None]:
    """Let processes that start here compute in one thread each, and ignore Ctrl-C.

    A terminal sends it to all of them.  This process ends them; on their own each would do so with
    a traceback.
    """
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    unset = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(unset, "1"))
    try:
        yield
    finally:
        for name in unset:
            del os.environ[name]
        signal.signal(signal.SIGINT, before)
