"""Cases asked in processes, their lines kept in a file: a second start asks what is missing."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from cases import Case

from wrist_stiffness.cli.progress import Progress

Lines = list[dict[str, Any]]


def asked(
    ask: Callable[[Case], Lines], cases: Sequence[Case], path: Path, version: str, processes: int
) -> Lines:
    """Return the lines of a version that a file holds, and those of the cases it has none of.

    Parameters
    ----------
    ask : callable
        Gives the lines of a case, each with its ``key`` and ``version``; a function of a module.
    cases : sequence of Case
        To be asked.
    path : path
        JSON lines; what is new is appended as soon as it is known.
    version : str
        Lines of another one do not count.
    processes : int
        That ask side by side.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    kept = path.read_text().splitlines() if path.exists() else []
    lines: Lines = [line for line in map(json.loads, kept) if line["version"] == version]
    done = {line["key"] for line in lines}
    todo = [case for case in cases if case.key not in done]
    progress = Progress("cases")
    with ProcessPoolExecutor(processes) as pool, path.open("a") as out:
        futures = [pool.submit(ask, case) for case in todo]
        for number, future in enumerate(as_completed(futures)):
            found = future.result()
            out.write("".join(json.dumps(line) + "\n" for line in found))
            out.flush()
            lines += found
            progress(number + 1, len(todo))
    return lines
