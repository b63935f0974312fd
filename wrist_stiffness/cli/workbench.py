"""`wrist-stiffness workbench`: the analysis as a page in the browser."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser

DESCRIPTION = """\
Open a page on this machine: drop a recording, see where the error is, which effect is missing and
what it would explain, add it and watch the error fall.  Nothing leaves the machine; the page reads
and writes in its workspace folder only."""

EPILOG = """\
examples:
  wrist-stiffness workbench
  wrist-stiffness workbench --folder my_wrist --port 8123 --no-browser
  wrist-stiffness workbench --host 0.0.0.0     other machines too; the address has a token"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `workbench`."""
    parser = commands.add_parser(
        "workbench",
        help="the same in the browser, on this machine",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--folder",
        default="workbench",
        help="workspace: recordings and models that the page offers, and what it writes "
        "(default: %(default)s)",
    )
    parser.add_argument("--host", default="127.0.0.1", help="address (default: %(default)s)")
    parser.add_argument("--port", type=int, default=8080, help="port (default: %(default)s)")
    parser.add_argument(
        "--largest-upload", type=int, default=1024, metavar="MB", help="(default: %(default)s)"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.web.server import Served, serve

    serve(
        Served(
            arguments.folder,
            arguments.host,
            arguments.port,
            arguments.largest_upload,
            not arguments.no_browser,
        )
    )
    return EXIT_DONE
