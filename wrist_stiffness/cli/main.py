"""The command `wrist-stiffness`: runs one command, turns errors into exit codes."""

import argparse
import errno
import os
import signal
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from types import FrameType, ModuleType

from wrist_stiffness import __version__
from wrist_stiffness.atomic_file import require_room
from wrist_stiffness.cli import table
from wrist_stiffness.cli.csv_tables import export, import_
from wrist_stiffness.cli.fit import calibrate, extend
from wrist_stiffness.cli.judge import compare, diagnose
from wrist_stiffness.cli.parser import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_PIPE_CLOSED,
    PROG,
    Command,
    OneLineParser,
)
from wrist_stiffness.cli.plan import plan
from wrist_stiffness.cli.pose import explain, predict
from wrist_stiffness.cli.progress import bars_ended
from wrist_stiffness.cli.replay import replay
from wrist_stiffness.cli.simulate import cell, simulate
from wrist_stiffness.cli.tolerances import tolerances
from wrist_stiffness.cli.workbench import workbench
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.model.python_laws import python_laws

EXIT_TERMINATED = 128 + signal.SIGTERM

DESCRIPTION = """\
Predict, correct and explain the pose error of a flexible two-degree-of-freedom wrist."""

EPILOG = """\
Three commands to begin with (each uses the shipped wrist where none is named):
  wrist-stiffness table show                     how stiff is it, and where?
  wrist-stiffness simulate -o first_recording    a virtual cell to practise on
  wrist-stiffness replay first_recording -o corrected
                                                 predicted error and corrected commands

'wrist-stiffness COMMAND --help' explains a command.
Exit codes: 0 done, 1 the answer is no, 2 wrong use or bad input."""


EXTRA_OF = {
    "netgen": "fem",
    "skfem": "fem",
    "pymetis": "fem",
    "matplotlib": "plot",
    "nicegui": "web",
}
"""The extra that installs a library which a robot does without."""


RESULTS = {"report": b"<", "json": b"{["}
"""Options that name a file to write a result to, and how such a file begins."""

PLACES = ("output", "record", "diagnosis", *RESULTS)
"""Options that name what is written, or a result that is read: each needs a place of its own."""


COMMANDS: tuple[Command | ModuleType, ...] = (
    table,
    predict,
    explain,
    simulate,
    replay,
    import_,
    export,
    calibrate,
    compare,
    diagnose,
    extend,
    plan,
    tolerances,
    workbench,
    cell,
)
"""Each function imports what it needs, so that `--help` and the other commands do not wait."""


def build_parser(commands: Iterable[Command | ModuleType]) -> OneLineParser:
    """Return the parser of commands, listed in their order; its result has a function `run`."""
    parser = OneLineParser(
        prog=PROG,
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"{PROG} {__version__}")
    subparsers = parser.add_subparsers(metavar="COMMAND", title="commands", required=True)
    for command in commands:
        command.add_parser(subparsers)
    for each in subparsers.choices.values():
        each.add_argument(
            "--allow-python-laws",
            action="store_true",
            help="run the Python files that a model names as laws; only for models that you trust",
        )
    return parser


def main(
    argv: Sequence[str] | None = None, commands: Iterable[Command | ModuleType] = COMMANDS
) -> int:
    """Run one command.

    `argv`: arguments without the program name; those of the process if None.  `commands`: the
    commands on offer.  Gives 0 done, 1 the answer is no, 2 bad input, 130 interrupted, 141 the
    reader of stdout left.  Raises `SystemExit` from argparse: 0 after `--help` and `--version`, 2
    on wrong use; 143 after SIGTERM.
    """
    _show_every_name()
    arguments = build_parser(commands).parse_args(argv)
    try:
        for option, begins in RESULTS.items():
            _require_place(getattr(arguments, option, None), option, begins)
        _require_places_apart(arguments)
        _require_new(arguments)
        with cleaned_up_on_sigterm(), python_laws(arguments.allow_python_laws), bars_ended():
            code: int = arguments.run(arguments)
        for option in RESULTS:
            path = getattr(arguments, option, None)
            if path is not None and Path(path).is_file():  # A pipe has its reader.
                print(f"written: {path}")
        if sys.stdout is not None:  # None where the caller closed it
            sys.stdout.flush()
    except WristError as error:
        return _refuse(str(error))
    except ModuleNotFoundError as error:
        library = str(error.name).partition(".")[0]
        if library not in EXTRA_OF:
            raise
        advice = f"pip install 'wrist_stiffness[{EXTRA_OF[library]}]'"
        return _refuse(f"{library} is not installed; {advice}")
    except KeyboardInterrupt as stop:
        if str(stop):  # What it leaves behind
            print(f"{PROG}: {stop}", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        _discard_output()
        return EXIT_PIPE_CLOSED
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return _refuse(f"{error.filename}: {error.strerror}")
        if error.errno != errno.ENOSPC:
            raise
        # Workflows turn errors of their own files into a WristError: this one is of stdout.
        _discard_output()
        return _refuse(f"the output cannot be written: {error.strerror}")
    return code


def _show_every_name() -> None:
    """Let a terminal that lacks a letter of a file's name show its number, as stderr does."""
    if isinstance(sys.stdout, TextIOWrapper):  # None where the caller closed it
        sys.stdout.reconfigure(errors="backslashreplace")


def _require_place(path: str | None, option: str, begins: bytes) -> None:
    """Refuse a result's file that cannot be written or is something else, before the work for it.

    `compare --json monday.mcap tuesday.mcap` would put its result in the place of a recording.
    """
    if path is None:
        return
    require_room(path)
    if Path(path).is_file():
        try:
            with open(path, "rb") as old:
                first = old.read(1)
        except OSError as error:
            raise InputError(f"{path}: cannot be replaced: {error.strerror}") from error
        if first and first not in begins:
            raise InputError(f"{path} is no earlier result of --{option}: it is not replaced")


def _require_places_apart(arguments: argparse.Namespace) -> None:
    """Refuse two results in one file, of which the last one written would be left."""
    named: dict[Path, str] = {}
    for option in PLACES:
        path = getattr(arguments, option, None)
        if path is None or (Path(path).exists() and not Path(path).is_file()):
            continue  # A device takes everything.
        other = named.setdefault(Path(path).resolve(), option)
        if other != option:
            raise InputError(
                f"{path}: --{other} and --{option} name the same file; give each its own"
            )


def _require_new(arguments: argparse.Namespace) -> None:
    """Refuse to replace an output that nobody asked to replace, where `--overwrite` would do so."""
    if getattr(arguments, "overwrite", True) or arguments.output is None:
        return
    from wrist_stiffness.recording.bag_folder import METADATA_FILE

    output = Path(arguments.output)
    if output.is_file() or (output / METADATA_FILE).is_file():
        raise InputError(
            f"{output} exists already and is not overwritten; choose another name, or --overwrite"
        )


def _refuse(reason: str) -> int:
    # A file's name may hold a line break.
    line = reason.replace("\n", "\\n")
    print(f"{PROG}: error: {line}", file=sys.stderr)
    return EXIT_BAD_INPUT


def _discard_output() -> None:
    # Python flushes stdout once more at exit, which would print a traceback.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def cleaned_up_on_sigterm() -> Iterator[None]:
    """Turn SIGTERM into SystemExit inside the `with` block: temporary files are removed."""
    before = signal.signal(signal.SIGTERM, _leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _leave(number: int, frame: FrameType | None) -> None:
    raise SystemExit(EXIT_TERMINATED)
