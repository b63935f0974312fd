"""What every command of `wrist-stiffness` shares: name, exit codes, one-line errors, its answer."""

from __future__ import annotations

import argparse
import inspect
import json
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from wrist_stiffness.atomic_file import writing
from wrist_stiffness.errors import InputError, meant, with_a_point

if TYPE_CHECKING:
    from wrist_stiffness.commands.provenance import Run

PROG = "wrist-stiffness"

EXIT_DONE = 0
EXIT_NO = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
EXIT_PIPE_CLOSED = 141


class _StoreOnce(argparse._StoreAction):
    """Refuses a second value: the first would be gone without a word, as one of two models."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        given = vars(namespace).setdefault("given", set())
        if self.dest in given:
            raise argparse.ArgumentError(self, "given twice; the first would not count")
        if option_string is not None:
            given.add(self.dest)
        super().__call__(parser, namespace, values, option_string)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no number{with_a_point(text)}") from error


class OneLineParser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, without the usage text before it.

    An option whose second value would replace its first is refused.  Negative numbers may have an
    exponent, or a comma to be told of: Python 3.11 and 3.12 take -1e-6 for an option.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.register("action", None, _StoreOnce)
        self.register("type", float, _number)
        self._negative_number_matcher = re.compile(r"-(\d+[.,]?\d*|\.\d+)(e[-+]?\d+)?$", re.I)

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Refuse what the command itself does not know: argparse would leave it to the program."""
        found, left = super().parse_known_args(args, namespace)
        if left:
            advice = "".join(meant(each, self._option_string_actions) for each in left)
            if "--model" in left and any(each.dest == "model" for each in self._actions):
                advice = "; here the model file stands without --model"
            self.error(f"unrecognized arguments: {' '.join(left)}{advice}")
        return found, left

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            raise argparse.ArgumentError(
                action, f"{error.message}{meant(str(value), map(str, action.choices or ()))}"
            ) from error

    def error(self, message: str) -> NoReturn:
        """Exit with code 2 and one line on stderr."""
        self.exit(EXIT_BAD_INPUT, f"{PROG}: error: {message} (see '{self.prog} --help')\n")


Commands: TypeAlias = "argparse._SubParsersAction[OneLineParser]"

Option: TypeAlias = Callable[[argparse._ActionsContainer], object]
"""Adds itself to a parser, or to a group of one."""


def option(
    name: str, what: str, metavar: str | tuple[str, ...] | None = None, **settings: Any
) -> Option:
    """Return an option or an argument; `settings`: as of `ArgumentParser.add_argument`."""
    return lambda parser: parser.add_argument(*name.split(), metavar=metavar, help=what, **settings)


def flag(name: str, what: str) -> Option:
    """Return an option without a value."""
    return lambda parser: parser.add_argument(name, action="store_true", help=what)


def value(name: str, default: float | int | str, what: str, metavar: str | None = None) -> Option:
    """Return an option with a value like the default, which its help tells."""
    shown = f"{default:g}" if isinstance(default, float) else default
    told = f"{what} (default: {shown})"
    return option(name, told, metavar, type=type(default), default=default)


def repeated(name: str, metavar: str, what: str) -> Option:
    """Return an option that may be given several times."""
    return option(name, f"{what}; may be repeated", metavar, action="append", default=[])


def output(metavar: str, what: str, **settings: Any) -> Option:
    """Return the option that says where to write."""
    return option("-o --output", what, metavar, **{"required": True, **settings})


def one_of(*options: Option, required: bool = False) -> Option:
    """Return options that exclude each other."""
    return lambda parser: _add(parser.add_mutually_exclusive_group(required=required), options)


def group(title: str, *options: Option) -> Option:
    """Return options that stand under a title in the help."""
    return lambda parser: _add(parser.add_argument_group(title), options)


def _add(parser: argparse._ActionsContainer, options: Iterable[Option]) -> None:
    for each in options:
        each(parser)


@dataclass(frozen=True)
class Command:
    """A command: the function that runs it and returns the exit code, and its options.

    The function's docstring is the help: what it does in a line, then what is told before the
    options, and from `example` on what is told after them.
    """

    run: Callable[[argparse.Namespace], int]
    options: tuple[Option, ...]

    def add_parser(self, commands: Commands) -> None:
        """Add the parser of the command."""
        what, _, text = (inspect.getdoc(self.run) or "").partition("\n\n")
        description, *epilog = re.split(r"\n\n(?=(?:for )?example)", text, maxsplit=1)
        parser = commands.add_parser(
            self.run.__name__.strip("_"),
            help=what[:1].lower() + what[1:].rstrip("."),
            description=description,
            epilog="".join(epilog),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        _add(parser, self.options)
        parser.set_defaults(run=self.run)


def command(
    *options: Option, json: bool = True
) -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Make a function a command; `json`: whether it gives its result to programs as well."""
    if json:
        told = option("--json", "write the result here as well", "FILE")
        options = told, *options
    return lambda run: Command(run, options)


def named_numbers(texts: Iterable[str], option: str) -> dict[str, float]:
    """Return the numbers of NAME=NUMBER options by name (InputError for others, or twice)."""
    values: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        try:
            value = float(number)
        except ValueError as error:
            advice = with_a_point(number) or ": write NAME=NUMBER"
            raise InputError(f"{option} {text}{advice}") from error
        if not name:
            raise InputError(f"{option} {text}: write NAME=NUMBER")
        if name in values:
            raise InputError(f"{option} {text}: {name} is {values[name]:g} already")
        values[name] = value
    return values


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
