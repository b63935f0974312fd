"""Messages of the streams between bytes and numbers.

At a thousand messages a second the making of rclpy's message objects costs as much as a third of a
prediction.  So joint states, loads and answers go to and from rclpy as CDR payloads.  So do plans,
one point at a step: rclpy makes ten thousand points into objects at one go, in a tenth of a second
in which no command is answered.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.trajectory_plan import PlannedPoint, planned_point
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.recording.cdr import decode_in_steps, encode_in_steps
from wrist_stiffness.recording.fixed_layout import FixedLayout, FixedReader
from wrist_stiffness.recording.messages import (
    Float64MultiArray,
    Header,
    JointState,
    JointTrajectory,
    PoseWithCovarianceStamped,
    Vector3Stamped,
    WrenchStamped,
)
from wrist_stiffness.topics import BASE_FRAME


class JointSample(NamedTuple):
    """A joint state: stamp [ns], frame, names, positions [rad], velocities, efforts."""

    stamp_ns: int
    frame_id: str
    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    efforts: tuple[float, ...]


class WrenchSample(NamedTuple):
    """A wrench: stamp [ns], frame, force (3,) [N] and moment (3,) [N m]."""

    stamp_ns: int
    frame_id: str
    force: tuple[float, ...]
    moment: tuple[float, ...]


def joint_reader() -> Callable[[bytes], JointSample]:
    """Return a function that reads the sensor_msgs/JointState of one topic.

    It raises RecordingError where a payload cannot be decoded.
    """
    messages = FixedReader(JointState)

    def read(payload: bytes) -> JointSample:
        like, numbers = messages.read(payload)
        speeds = 2 + len(like.position)
        efforts = speeds + len(like.velocity)
        return JointSample(
            _stamp_ns(numbers),
            like.header.frame_id,
            like.name,
            numbers[2:speeds],
            numbers[speeds:efforts],
            numbers[efforts:],
        )

    return read


def wrench_reader() -> Callable[[bytes], WrenchSample]:
    """Return a function that reads the geometry_msgs/WrenchStamped of one topic.

    It raises RecordingError where a payload cannot be decoded.
    """
    messages = FixedReader(WrenchStamped)

    def read(payload: bytes) -> WrenchSample:
        like, numbers = messages.read(payload)
        return WrenchSample(_stamp_ns(numbers), like.header.frame_id, numbers[2:5], numbers[5:])

    return read


def joint_payload(sample: JointSample) -> bytes:
    """Return a sensor_msgs/JointState."""
    _, frame_id, names, positions, velocities, efforts = sample
    layout = _joint_layout(frame_id, names, len(positions), len(velocities), len(efforts))
    return layout.payload(*divmod(sample.stamp_ns, NANOSECONDS), *positions, *velocities, *efforts)


def error_payload(
    stamp_ns: int, twist: Array, covariance: Array, frame_id: str = BASE_FRAME
) -> bytes:
    """Return a pose error as geometry_msgs/PoseWithCovarianceStamped.

    `stamp_ns` [ns]; `twist` (6,): of the error, at O in F [m, rad]; `covariance` (6, 6): of the
    twist.
    """
    place, turn = pose_of_twist(twist)
    return _in_frame(PoseWithCovarianceStamped, frame_id).payload(
        *divmod(stamp_ns, NANOSECONDS),
        *place.tolist(),
        *turn.tolist(),
        *covariance.ravel().tolist(),
    )


def angles_payload(theta: Array) -> bytes:
    """Return two motor angles (2,) [rad] as std_msgs/Float64MultiArray without dimensions."""
    return TWO_NUMBERS.payload(NO_OFFSET, *theta.tolist())


def vector_payload(stamp_ns: int, vector: Array, frame_id: str = BASE_FRAME) -> bytes:
    """Return a vector (3,) in a frame as geometry_msgs/Vector3Stamped."""
    layout = _in_frame(Vector3Stamped, frame_id)
    return layout.payload(*divmod(stamp_ns, NANOSECONDS), *vector.tolist())


TWO_NUMBERS = FixedLayout.of(Float64MultiArray(data=(0.0, 0.0)))
NO_OFFSET = 0
"""`data_offset` of the array's layout."""


@lru_cache(maxsize=8)
def _in_frame(kind: type, frame_id: str) -> FixedLayout:
    return FixedLayout.of(kind(Header(frame_id=frame_id)))


@lru_cache(maxsize=8)
def _joint_layout(
    frame_id: str, names: tuple[str, ...], positions: int, velocities: int, efforts: int
) -> FixedLayout:
    return FixedLayout.of(
        JointState(
            Header(frame_id=frame_id),
            names,
            (0.0,) * positions,
            (0.0,) * velocities,
            (0.0,) * efforts,
        )
    )


def _stamp_ns(numbers: tuple[float, ...]) -> int:
    return int(numbers[0]) * NANOSECONDS + int(numbers[1])


def read_plan(payload: bytes) -> Generator[None, None, tuple[JointTrajectory, list[PlannedPoint]]]:
    """Return a trajectory as it came, and its points.

    Raises `RecordingError` if the bytes are no such message; `InputError` if a point cannot be used
    (see `planned_point`).
    """
    plan = yield from decode_in_steps(JointTrajectory, payload)
    count, points = len(plan.joint_names), []
    for each in plan.points:
        points.append(planned_point(count, each.positions, each.velocities, each.accelerations))
        yield
    return plan, points


def plan_payload(
    plan: JointTrajectory, frame_id: str, points: Sequence[PlannedPoint]
) -> Generator[None, None, bytes]:
    """Return a trajectory with other points, as many as came, and another frame in its header."""
    written = []
    for before, point in zip(plan.points, points, strict=True):
        written.append(replace(before, **vars(point)))
        yield
    header = replace(plan.header, frame_id=frame_id)
    return (yield from encode_in_steps(replace(plan, header=header, points=tuple(written))))
