"""trajectory_msgs/JointTrajectory between bytes and planned points, one at a step.

rclpy makes ten thousand points into objects at one go, in a tenth of a second in which no command
is answered.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

from wrist_stiffness.compensation.trajectory import PlannedPoint, planned_point
from wrist_stiffness.recording.cdr import decode_in_steps, encode_in_steps
from wrist_stiffness.recording.messages import JointTrajectory


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
