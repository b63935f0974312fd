"""Long work in small slices of the one thread, between which commands are answered."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from wrist_stiffness.errors import InputError

SLICE_S = 0.002
"""A command that comes meanwhile waits for one slice, and for one step that is under way."""

PERIOD_S = 0.001

MOST_WAITING = 8


class SlicedWork:
    """A queue of generators, each run a little at a time, in the order in which they came.

    `node`: runs them by a timer; `on_fault`: takes what one of them raises.
    """

    def __init__(self, node: Node, on_fault: Callable[[Exception], None]) -> None:
        self._on_fault = on_fault
        self._waiting: deque[Generator[None, None, Any]] = deque()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self._run_slice, clock=steady)
        self._timer.cancel()

    def __len__(self) -> int:
        """Return how many are not finished."""
        return len(self._waiting)

    def add(self, work: Generator[None, None, Any]) -> None:
        """Begin work once what came before is done.

        Raises `InputError` if too much waits already.
        """
        if len(self._waiting) >= MOST_WAITING:
            raise InputError(f"{len(self._waiting)} trajectories wait to be corrected; refused")
        self._waiting.append(work)
        self._timer.reset()

    def forget(self) -> None:
        """Drop what is not finished."""
        self._waiting.clear()

    def _run_slice(self) -> None:
        end = time.monotonic() + SLICE_S
        while self._waiting and time.monotonic() < end:
            work = self._waiting[0]
            try:
                next(work)
                continue
            except StopIteration:
                pass
            except Exception as error:
                self._on_fault(error)
            # Not the first one any more, if all was dropped meanwhile.
            if self._waiting and self._waiting[0] is work:
                self._waiting.popleft()
        if not self._waiting:
            self._timer.cancel()
