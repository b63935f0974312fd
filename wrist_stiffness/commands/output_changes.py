"""What changed between two runs over one recording: which topic, when, and by how much.

The runs are replays of two versions of the code, the model or the parameters, or a replay and a
live run.  Messages are matched by their stamp, those without one by their log time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.commands.replay import OUTPUTS
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.recording import messages as msg
from wrist_stiffness.recording.cdr import decode
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


def _decoded(raw: RawMessage) -> msg.Message:
    kind = raw.channel.ros_type
    if kind not in msg.MESSAGE_TYPES:
        raise RecordingError(f"{raw.channel.topic} carries {kind}, which no replay writes")
    return decode(msg.MESSAGE_TYPES[kind], raw.payload)


def _changes(first: Recording, second: Recording, topic: str) -> TopicChanges:
    before, after = _payloads(first, topic), _payloads(second, topic)
    common = sorted(before.keys() & after.keys())
    changed: list[int] = []
    largest: dict[str, LargestChange] = {}
    for key in common:
        if before[key].payload == after[key].payload:
            continue
        (old, old_form), (new, new_form) = _said(_decoded(before[key])), _said(_decoded(after[key]))
        if old_form != new_form or any(len(old[name]) != len(new[name]) for name in old):
            changed.append(key[0])
            continue
        sizes = {name: _change(name, np.array(old[name]), np.array(new[name])) for name in old}
        beyond = {name: size for name, size in sizes.items() if not size <= TOLERANCES[name]}
        changed += [key[0]] if beyond else []
        for name, size in beyond.items():
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


def _said(message: msg.Message) -> tuple[dict[str, Sequence[float]], tuple[object, ...]]:
    """Return the numbers of a message by quantity [m, rad, s], and everything else in it."""
    if isinstance(message, msg.PoseWithCovarianceStamped):
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        numbers: dict[str, Sequence[float]] = {
            SHIFT: (place.x, place.y, place.z),
            TURN: (turn.x, turn.y, turn.z, turn.w),
            COVARIANCE: message.pose.covariance,
        }
        return numbers, (message.header.frame_id,)
    if isinstance(message, msg.JointState):
        form = message.header.frame_id, message.name, len(message.effort)
        return {ANGLE: message.position, SPEED: message.velocity}, form
    if isinstance(message, msg.JointTrajectory):
        points = message.points
        numbers = {
            ANGLE: [value for point in points for value in point.positions],
            SPEED: [value for point in points for value in point.velocities],
            ACCELERATION: [value for point in points for value in point.accelerations],
        }
        return numbers, (message.header.frame_id, message.joint_names, len(points))
    return ({ANGLE: message.data} if isinstance(message, msg.Float64MultiArray) else {}), ()


def _change(quantity: str, old: Array, new: Array) -> float:
    """Return by how much a quantity differs, in its unit; NaN where one alone is NaN."""
    if quantity == SHIFT:
        return 1e6 * float(np.linalg.norm(new - old))
    if quantity == TURN:
        # Unit quaternions differ by half the angle between them, to second order.
        apart = min(np.linalg.norm(new - old), np.linalg.norm(new + old))
        return MILLIDEGREES * 2.0 * float(apart)
    if quantity == COVARIANCE:
        scale = np.sqrt(np.abs(old.reshape(6, 6).diagonal()))
        limits = np.maximum(np.outer(scale, scale), 1e-300).ravel()
        return 1e2 * float((np.abs(new - old) / limits).max())
    changes = np.abs(new - old)[~(np.isnan(old) & np.isnan(new))]
    return MILLIDEGREES * float(changes.max(initial=0.0))
