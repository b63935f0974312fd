"""What a written model says of the command that made it."""

from __future__ import annotations

import shlex
import sys
from datetime import UTC, datetime

from wrist_stiffness.cli.parser import PROG
from wrist_stiffness.commands.provenance import Run


def this_run() -> Run:
    """Return the command of this process and the time."""
    command = shlex.join([PROG, *sys.argv[1:]])
    return Run(command, datetime.now(UTC).isoformat(timespec="seconds"))
