"""`wrist-stiffness workbench`: the analysis as a page in the browser."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, command, flag, value


@command(
    value(
        "--folder",
        "workbench",
        "workspace: recordings and models that the page offers, and what it writes",
    ),
    value("--host", "127.0.0.1", "address"),
    value("--port", 8080, "port"),
    value("--largest-upload", 1024, "largest file that the page takes", "MB"),
    flag("--no-browser", "only print the address"),
    json=False,
)
def workbench(arguments: argparse.Namespace) -> int:
    """Do the same in the browser, on this machine.

    Open a page on this machine: drop a recording, see where the error is, which effect is missing
    and what it would explain, add it and watch the error fall.  Nothing leaves the machine; the
    page reads and writes in its workspace folder only.

    for example:
      wrist-stiffness workbench
      wrist-stiffness workbench --folder my_wrist --port 8123 --no-browser
      wrist-stiffness workbench --host 0.0.0.0     other machines too; the address has a token
    """
    from wrist_stiffness.web.server import serve

    serve(
        arguments.folder,
        arguments.host,
        arguments.port,
        arguments.largest_upload,
        not arguments.no_browser,
    )
    return EXIT_DONE
