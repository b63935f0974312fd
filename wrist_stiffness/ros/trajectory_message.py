"""trajectory_msgs/JointTrajectory between bytes and numbers, a point at a time.

rclpy makes ten thousand points into objects at one go, in a tenth of a second in which no command
is answered.
"""

from __future__ import annotations

import struct
from collections.abc import Generator
from dataclasses import dataclass

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.trajectory import PlannedPoint, planned_point
from wrist_stiffness.errors import RecordingError

ENCAPSULATION = 4
LITTLE, BIG = b"\x00\x01", b"\x00\x00"


@dataclass
class Plan:
    """A trajectory as it came.

    Parameters
    ----------
    stamp_ns : int
        Of its header [ns].
    frame_id : str
        Of its header.
    names : tuple of str
        Joints.
    points : list of PlannedPoint
        The angles and their derivatives.
    rest : list of tuple
        Of each point its efforts, and seconds and nanoseconds from the start.
    """

    stamp_ns: int
    frame_id: str
    names: tuple[str, ...]
    points: list[PlannedPoint]
    rest: list[tuple[tuple[float, ...], int, int]]


class _Reader:
    def __init__(self, payload: bytes) -> None:
        order = {LITTLE: "<", BIG: ">"}.get(payload[:2])
        if order is None or len(payload) < ENCAPSULATION:
            raise RecordingError("trajectory: the payload is no CDR")
        self._payload, self._order, self._at = payload, order, ENCAPSULATION

    def take(self, code: str, size: int, count: int = 1) -> tuple[float, ...]:
        at = ENCAPSULATION + -(-(self._at - ENCAPSULATION) // size) * size if count else self._at
        try:
            values = struct.unpack_from(f"{self._order}{count}{code}", self._payload, at)
        except (struct.error, MemoryError, OverflowError) as error:
            raise RecordingError("trajectory: the payload ends too early") from error
        self._at = at + count * size
        return values

    def whole(self, code: str = "I") -> int:
        return int(self.take(code, 4)[0])

    def numbers(self) -> tuple[float, ...]:
        count = self.whole()
        self._require(8 * count)
        return self.take("d", 8, count)

    def text(self) -> str:
        length = self.whole()
        self._require(length)
        start, self._at = self._at, self._at + length
        return self._payload[start : self._at].rstrip(b"\0").decode(errors="replace")

    def count(self, least: int) -> int:
        """Return a count of things of which each has that many bytes at least."""
        count = self.whole()
        self._require(least * count)
        return count

    def _require(self, size: int) -> None:
        if size > len(self._payload) - self._at:
            raise RecordingError("trajectory: the payload ends too early")


def stamp_of(payload: bytes) -> int:
    """Return the stamp [ns], or raise RecordingError where there is none."""
    reader = _Reader(payload)
    return reader.whole("i") * NANOSECONDS + reader.whole()


def read_plan(payload: bytes) -> Generator[None, None, Plan]:
    """Read a trajectory, a point at a step.

    Returns
    -------
    Plan
        When all is read.

    Raises
    ------
    RecordingError
        If the bytes are no such message.
    InputError
        If a point cannot be used (see `planned_point`).
    """
    reader = _Reader(payload)
    plan = Plan(reader.whole("i") * NANOSECONDS + reader.whole(), reader.text(), (), [], [])
    plan.names = tuple(reader.text() for _ in range(reader.count(5)))
    for _ in range(reader.count(24)):
        positions, velocities, accelerations = (reader.numbers() for _ in range(3))
        plan.points.append(planned_point(len(plan.names), positions, velocities, accelerations))
        plan.rest.append((reader.numbers(), reader.whole("i"), reader.whole()))
        yield
    return plan


def plan_payload(
    plan: Plan, frame_id: str, points: tuple[PlannedPoint, ...]
) -> Generator[None, None, bytes]:
    """Write a trajectory with other points, a point at a step.

    Parameters
    ----------
    plan : Plan
        As it came.
    frame_id : str
        Of the header.
    points : tuple of PlannedPoint
        As many as came.

    Returns
    -------
    bytes
        The message, when all is written.
    """
    out = bytearray()

    def put(code: str, size: int, *values: float) -> None:
        if values:
            out.extend(bytes(-len(out) % size))
            out.extend(struct.pack(f"<{len(values)}{code}", *values))

    def text(value: str) -> None:
        encoded = value.encode() + b"\0"
        put("I", 4, len(encoded))
        out.extend(encoded)

    seconds, nanoseconds = divmod(plan.stamp_ns, NANOSECONDS)
    put("i", 4, seconds)
    put("I", 4, nanoseconds)
    text(frame_id)
    put("I", 4, len(plan.names))
    for name in plan.names:
        text(name)
    put("I", 4, len(points))
    for point, (efforts, sec, nanosec) in zip(points, plan.rest, strict=True):
        for values in (point.positions, point.velocities, point.accelerations):
            put("I", 4, len(values))
            put("d", 8, *values.tolist())
        put("I", 4, len(efforts))
        put("d", 8, *efforts)
        put("i", 4, sec)
        put("I", 4, nanosec)
        yield
    return LITTLE + b"\0\0" + bytes(out)
