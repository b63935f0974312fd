"""What a command says of its result, and of the run that made it."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wrist_stiffness.atomic_file import writing
from wrist_stiffness.cli.parser import EXIT_DONE, PROG

if TYPE_CHECKING:
    from wrist_stiffness.commands.provenance import Run


def say(arguments: argparse.Namespace, lines: Iterable[str], values: Any) -> int:
    """Print the answer, write it where `--json` asks for that, and return the exit code."""
    print("\n".join(lines))
    if arguments.json:
        write_json(arguments.json, values)
    return EXIT_DONE


def write_json(path: str | Path, content: Any) -> None:
    """Write a result for programs, complete or not at all (InputError if that fails)."""
    with writing(path) as written:
        written.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def this_run() -> Run:
    """Return the command of this process and the time."""
    from wrist_stiffness.commands.provenance import Run

    command = shlex.join([PROG, *sys.argv[1:]])
    return Run(command, datetime.now(UTC).isoformat(timespec="seconds"))
