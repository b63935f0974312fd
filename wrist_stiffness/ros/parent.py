"""End with the process that started a node, even if that is killed and cannot say so."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

from wrist_stiffness.commands.node_list import PARENT_PID

PR_SET_PDEATHSIG = 1
"""From linux/prctl.h; ctypes is the standard library's way to it."""


def end_with_parent() -> None:
    """Ask the kernel for a SIGTERM when the parent ends, where the environment names one.

    Only on Linux; elsewhere a killed `cell` leaves its nodes running.
    """
    parent = os.environ.get(PARENT_PID)
    if parent is None or sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if str(os.getppid()) != parent:
        # It had ended before the kernel was asked.
        raise SystemExit(0)
