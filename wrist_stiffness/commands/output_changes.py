"""What changed between two runs over one recording: which topic, when, and by how much.

The runs are replays of two versions of the code, the model or the parameters, or a replay and a
live run.  Messages are matched by their stamp, those without one by their log time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.commands.replay import OUTPUTS
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.messages import (
    MESSAGE_TYPES,
    Float64MultiArray,
    JointState,
    JointTrajectory,
    Message,
    PoseWithCovarianceStamped,
)
from wrist_stiffness.recording.reader import RawMessage, Recording, open_recording
from wrist_stiffness.topics import MILLIDEGREES

SHIFT, TURN, COVARIANCE = "s [um]", "rotation [mdeg]", "covariance [%]"
ANGLE, SPEED, ACCELERATION = "angle [mdeg]", "speed [mdeg/s]", "acceleration [mdeg/s^2]"

TOLERANCES = {
    SHIFT: 1e-6,
    TURN: 1e-4,
    COVARIANCE: 1e-3,
    ANGLE: 1e-4,
    SPEED: 1e-2,
    ACCELERATION: 10.0,
}
"""What another processor or linear algebra may change.  Predictions are solved to rounding; the
search for corrected angles ends within 1e-10 rad, 6e-6 mdeg; at 1 rad/s a speed is the difference
of two such angles over 10 ms, an acceleration of three over 5 ms each."""


Key = tuple[int, int]
"""Stamp [ns] and how many messages of that stamp came before."""


@dataclass(frozen=True)
class LargestChange:
    """By how much one quantity changed at most, and at which stamp [ns]."""

    quantity: str
    size: float
    stamp_ns: int


@dataclass(frozen=True)
class TopicChanges:
    """Changes of one topic."""

    topic: str
    # `common`, `only_old`, `only_new`: messages that both runs have, and those that one of them
    # lacks
    common: int
    only_old: int
    only_new: int
    # common ones that differ by more than `TOLERANCES`, or in a name or a number of values
    changed: int
    first_ns: int | None  # stamp of the first of these [ns]
    largest: tuple[LargestChange, ...]  # of every quantity that changed by more than its tolerance

    @property
    def same(self) -> bool:
        """Whether there is no change at all."""
        return not (self.changed or self.only_old or self.only_new)


def output_changes(
    old: str | Path, new: str | Path, topics: Sequence[str] = OUTPUTS
) -> tuple[TopicChanges, ...]:
    """Compare the outputs of two runs.

    Gives of every topic that one of them has.  Raises `RecordingError` if a recording cannot be
    read, the old one has no outputs, or one has a foreign type.
    """
    first, second = open_recording(old), open_recording(new)
    present = {topic.name for topic in first.topics}
    if present.isdisjoint(topics):
        raise RecordingError(f"{old}: holds no output of a replay ({', '.join(topics)})")
    present |= {topic.name for topic in second.topics}
    # One topic at a time, to hold less in memory.
    return tuple(_changes(first, second, topic) for topic in topics if topic in present)


def _payloads(source: Recording, topic: str) -> dict[Key, RawMessage]:
    """Return the stored messages of a topic: much smaller than decoded ones."""
    found: dict[Key, RawMessage] = {}
    seen: Counter[int] = Counter()
    for raw in source.raw_messages([topic]):
        header = getattr(_decoded(raw), "header", None)
        stamp_ns = raw.log_time_ns if header is None else header.stamp_ns
        found[stamp_ns, seen[stamp_ns]] = raw
        seen[stamp_ns] += 1
    return found


def _decoded(raw: RawMessage) -> Message:
    kind = raw.channel.ros_type
    if kind not in MESSAGE_TYPES:
        raise RecordingError(f"{raw.channel.topic} carries {kind}, which no replay writes")
    return decode(MESSAGE_TYPES[kind], raw.payload)


def _changes(first: Recording, second: Recording, topic: str) -> TopicChanges:
    before, after = _payloads(first, topic), _payloads(second, topic)
    common = sorted(before.keys() & after.keys())
    changed: list[int] = []
    largest: dict[str, LargestChange] = {}
    for key in common:
        if before[key].payload == after[key].payload:
            continue
        old, new = _decoded(before[key]), _decoded(after[key])
        if _form(old) != _form(new):
            changed.append(key[0])
            continue
        beyond = [(name, size) for name, size in _sizes(old, new) if not size <= TOLERANCES[name]]
        changed += [key[0]] if beyond else []
        for name, size in beyond:
            if name not in largest or size > largest[name].size:
                largest[name] = LargestChange(name, size, key[0])
    return TopicChanges(
        topic,
        len(common),
        len(before.keys() - after.keys()),
        len(after.keys() - before.keys()),
        len(changed),
        changed[0] if changed else None,
        tuple(largest.values()),
    )


def _form(message: Message) -> tuple[object, ...]:
    """Everything in a message that is no quantity."""
    if isinstance(message, PoseWithCovarianceStamped):
        return PoseWithCovarianceStamped, message.header.frame_id
    if isinstance(message, JointState):
        counts = len(message.position), len(message.velocity), len(message.effort)
        return JointState, message.header.frame_id, message.name, *counts
    if isinstance(message, JointTrajectory):
        sizes = [
            (len(point.positions), len(point.velocities), len(point.accelerations))
            for point in message.points
        ]
        return JointTrajectory, message.header.frame_id, message.joint_names, *sizes
    if isinstance(message, Float64MultiArray):
        return Float64MultiArray, len(message.data)
    return (type(message),)


def _sizes(old: Message, new: Message) -> Iterable[tuple[str, float]]:
    """By how much each quantity of two messages of one form differs; NaN where one is NaN."""
    if isinstance(old, PoseWithCovarianceStamped) and isinstance(new, PoseWithCovarianceStamped):
        places, turns = zip(_pose(old), _pose(new), strict=True)
        yield SHIFT, 1e6 * float(np.linalg.norm(places[1] - places[0]))
        # Unit quaternions differ by half the angle between them, to second order.
        apart = min(np.linalg.norm(turns[1] - turns[0]), np.linalg.norm(turns[1] + turns[0]))
        yield TURN, MILLIDEGREES * 2.0 * float(apart)
        before, after = (np.reshape(m.pose.covariance, (6, 6)) for m in (old, new))
        scale = np.sqrt(np.abs(before.diagonal()))
        relative = np.abs(after - before) / np.maximum(np.outer(scale, scale), 1e-300)
        yield COVARIANCE, 1e2 * float(relative.max())
        return
    second = _of_motors(new)
    for name, first in _of_motors(old).items():
        yield name, MILLIDEGREES * _apart(first, second[name])


def _of_motors(message: Message) -> dict[str, Sequence[float]]:
    """Return what a message says of the motors, by quantity [rad, rad/s, rad/s^2]."""
    if isinstance(message, JointState):
        return {ANGLE: message.position, SPEED: message.velocity}
    if isinstance(message, JointTrajectory):
        points = message.points
        return {
            ANGLE: [value for point in points for value in point.positions],
            SPEED: [value for point in points for value in point.velocities],
            ACCELERATION: [value for point in points for value in point.accelerations],
        }
    return {ANGLE: message.data} if isinstance(message, Float64MultiArray) else {}


def _pose(message: PoseWithCovarianceStamped) -> tuple[Array, Array]:
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    return np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w])


def _apart(first: Sequence[float], second: Sequence[float]) -> float:
    """Largest difference; NaN that both have are equal."""
    a, b = np.array(first, dtype=float), np.array(second, dtype=float)
    differences = np.abs(b - a)[~(np.isnan(a) & np.isnan(b))]
    return float(differences.max(initial=0.0))
