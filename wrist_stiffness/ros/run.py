"""Run a node as a process, with a clean end on SIGINT and SIGTERM."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from wrist_stiffness.errors import WristError
from wrist_stiffness.ros.executor import StreamExecutor
from wrist_stiffness.ros.parent import end_with_parent

EXIT_BAD_INPUT = 2


def run(make_node: Callable[[], Node]) -> int:
    """Make a node and spin it until it is told to stop.

    One thread: the multi-threaded executor loses messages under load.

    Parameters
    ----------
    make_node : callable
        Makes the node once ROS is initialised.

    Returns
    -------
    int
        0, or 2 if the node cannot start, go on or end as asked; one line on stderr says why.
    """
    end_with_parent()
    interrupted = _interrupts_without_raising()
    try:
        rclpy.init()
    # What rclpy raises for ROS arguments that cannot be read has no other public class.
    except RuntimeError as error:
        tell(f"ROS 2 cannot start: {error}")
        return EXIT_BAD_INPUT
    executor = StreamExecutor()
    try:
        if not interrupted:
            _spin(executor, make_node)
    except (WristError, ParameterException) as error:
        tell(str(error))
        return EXIT_BAD_INPUT
    finally:
        rclpy.try_shutdown()
    return 0


def tell(error: str) -> None:
    """Say what is wrong in one line on stderr."""
    print(f"wrist-stiffness node: error: {' '.join(error.split())}", file=sys.stderr)


def _spin(executor: StreamExecutor, make_node: Callable[[], Node]) -> None:
    """Make a node, run it until the context is shut down, and destroy it."""
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


def _interrupts_without_raising() -> list[int]:
    """Let SIGINT end the node as SIGTERM does: by the shutdown of its context, which rclpy sees to.

    rclpy calls the handler that was there before its own. Python's raises a KeyboardInterrupt
    wherever the program happens to be, and inside a `__del__` it is printed as a traceback.

    Returns
    -------
    list of int
        Not empty after a SIGINT, also one that comes before rclpy listens. No event: the next
        signal may come while its lock is held.
    """
    interrupted: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    return interrupted
