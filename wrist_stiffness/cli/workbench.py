"""`wrist-stiffness workbench`: the analysis as a page in the browser."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, Commands, add_command

DESCRIPTION = """\
Open a page on this machine: drop a recording, see where the error is, which effect is missing and
what it would explain, add it and watch the error fall.  Nothing leaves the machine; the page reads
and writes in its workspace folder only."""

EPILOG = """\
examples:
  wrist-stiffness workbench
  wrist-stiffness workbench --folder my_wrist --port 8123 --no-browser
  wrist-stiffness workbench --host 0.0.0.0     other machines too; the address has a token"""


def add_parser(commands: Commands) -> None:
    """Add the parser of `workbench`."""
    what = "the same in the browser, on this machine"
    parser = add_command(commands, "workbench", what, (DESCRIPTION, EPILOG), _run, json=False)
    where = "workspace: recordings and models that the page offers, and what it writes"
    parser.option("--folder", "workbench", where)
    parser.option("--host", "127.0.0.1", "address")
    parser.option("--port", 8080, "port")
    parser.option("--largest-upload", 1024, "largest file that the page takes", "MB")
    parser.flag("--no-browser", "only print the address")


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.web.server import serve

    serve(
        arguments.folder,
        arguments.host,
        arguments.port,
        arguments.largest_upload,
        not arguments.no_browser,
    )
    return EXIT_DONE
