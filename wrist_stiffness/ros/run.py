"""Run a node as a process, with a clean end on SIGINT and SIGTERM, and an end in any case."""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from wrist_stiffness.commands.node_list import PARENT_PID
from wrist_stiffness.errors import WristError
from wrist_stiffness.ros.executor import StreamExecutor

PR_SET_PDEATHSIG = 1
"""From linux/prctl.h; ctypes is the standard library's way to it."""

EXIT_BAD_INPUT = 2

END_S = 8.0
"""A node that has not ended so long after it was told to ends by force, and says where it hung."""


def run(make_node: Callable[[], Node]) -> NoReturn:
    """Make a node, spin it until it is told to stop, and end the process.

    One thread: the multi-threaded executor loses messages under load.

    `make_node`: makes the node once ROS is initialised.

    Ends with 0, with 2 if the node cannot start, go on or end as asked (one line on stderr says
    why), or as the node says with a SystemExit.
    """
    end_with_parent()
    told_to_end = _listen_to_signals()
    code = 0
    try:
        rclpy.init()
        if not told_to_end:
            _spin(make_node)
    except (WristError, ParameterException) as error:
        code = _refuse(str(error))
    except RuntimeError as error:
        # What rclpy raises for ROS arguments that cannot be read has no other public class; and a
        # context that a signal has shut down fails wherever the node happens to be.
        if not told_to_end:
            code = _refuse(f"ROS 2 cannot start: {error}")
    except SystemExit as ending:
        code = int(ending.code or 0)
    finally:
        rclpy.try_shutdown()
    _leave(code)


def _leave(code: int) -> NoReturn:
    """End the process without the middleware's own clearing up at exit.

    All has been said and written by now; after a peer was killed, Fast DDS may crash there.
    """
    # Where a signal has shut the context down, rclpy leaves the log file open.
    rclpy.get_default_context()._logging_fini()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def tell(error: str) -> None:
    """Say what is wrong in one line on stderr."""
    print(f"wrist-stiffness node: error: {' '.join(error.split())}", file=sys.stderr)


def _refuse(error: str) -> int:
    tell(error)
    return EXIT_BAD_INPUT


def _spin(make_node: Callable[[], Node]) -> None:
    """Make a node, run it until the context is shut down, and destroy it."""
    executor = StreamExecutor()
    try:
        executor.add_node(make_node())
        # What a node starts with stays: the collector need not go through it again and again.
        gc.collect()
        gc.freeze()
        executor.spin()
    except ExternalShutdownException:
        pass
    except (WristError, ParameterException):
        raise
    except Exception:
        # Told to stop while it was still starting: ROS then fails wherever the node happens to be.
        if rclpy.ok():
            raise
    finally:
        for node in executor.get_nodes():
            node.destroy_node()


def _listen_to_signals() -> list[int]:
    """Let SIGINT and SIGTERM end the node, and see to it that they do.

    rclpy's own handlers shut the context down, and call those that were there before.  Python's of
    SIGINT raises a KeyboardInterrupt wherever the program happens to be; inside a `__del__` it is
    printed as a traceback.  A callback that never returns, of a user's law or of the middleware,
    never sees that the context is shut down.

    Gives a list that is not empty after a signal, also one that comes before rclpy listens.  No
    event: the next signal may come while its lock is held.
    """
    told_to_end: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        if not told_to_end:
            faulthandler.dump_traceback_later(END_S, exit=True)
        told_to_end.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    return told_to_end


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
