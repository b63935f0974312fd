"""Joint states that wait for the load that belongs to them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.ros.stream_messages import JointSample


class LoadWait:
    """A queue in order of arrival.

    A joint state is ready when a load with its own or a later stamp has arrived, for then no other
    load can belong to it, or when it has waited for long enough.

    `limit_s`: longest wait [s]; `clock_ns`: a clock that never jumps [ns].
    """

    def __init__(self, limit_s: float, clock_ns: Callable[[], int]) -> None:
        self._limit_ns = round(limit_s * NANOSECONDS)
        self._clock_ns = clock_ns
        self._waiting: deque[tuple[int, JointSample]] = deque()

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._waiting)

    def forget(self) -> None:
        """Drop all."""
        self._waiting.clear()

    def put(self, joints: JointSample) -> None:
        """Add a joint state."""
        self._waiting.append((self._clock_ns() + self._limit_ns, joints))

    def ready(self, newest_load_ns: int | None) -> Iterator[JointSample]:
        """Take out and yield what need not wait any longer.

        Parameters
        ----------
        newest_load_ns : int or None
            Newest stamp of the loads [ns].

        Yields
        ------
        JointSample
            In order of arrival.
        """
        now_ns = self._clock_ns()
        while self._waiting:
            deadline_ns, joints = self._waiting[0]
            has_load = newest_load_ns is not None and joints.stamp_ns <= newest_load_ns
            if not has_load and now_ns < deadline_ns:
                return
            self._waiting.popleft()
            yield joints
