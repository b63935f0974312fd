"""Options of commands that take many wrists at once."""

from __future__ import annotations

import argparse


def add_fleet_options(parser: argparse.ArgumentParser) -> None:
    """Add `--each` and `--scheduler`."""
    parser.add_argument(
        "--each",
        action="store_true",
        help="every recording is of a wrist of its own: one line for each, in parallel",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="with --each: a running Dask scheduler, tcp://HOST:PORT (default: this machine)",
    )


def for_each(arguments: argparse.Namespace) -> bool:
    """Tell whether every recording is taken by itself.

    Raises
    ------
    InputError
        If another option does not go with that.
    """
    from wrist_stiffness.errors import InputError

    if arguments.each and arguments.report:
        raise InputError("--report draws one wrist; leave out --each")
    if arguments.scheduler and not arguments.each:
        raise InputError("--scheduler spreads many recordings over machines: add --each")
    return bool(arguments.each)
