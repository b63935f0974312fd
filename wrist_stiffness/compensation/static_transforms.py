"""Sensor frames from `/tf_static`: chains of fixed transforms that end at base or platform."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import SensorFrame, frame_name
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME

UNIT_TOLERANCE = 1e-3
"""Largest deviation of a quaternion's norm from one."""


@dataclass(frozen=True)
class StaticTransform:
    """Where a child frame stands in its parent."""

    parent: str
    child: str
    rotation: Array  # (3, 3), turns the child's components into the parent's
    position: Array  # (3,), the child's origin in the parent [m]


def static_transform(
    parent: str, child: str, position: Sequence[float], quaternion: Sequence[float]
) -> StaticTransform:
    """Return a transform as geometry_msgs/TransformStamped states it.

    `parent`, `child`: `header.frame_id` and `child_frame_id`; `position`, `quaternion` (sequence of
    3 and 4 float) [m], x y z w.  Raises `InputError` if a number is not finite or the quaternion is
    no unit quaternion.
    """
    numbers = np.array([*position, *quaternion], dtype=float)
    norm = float(np.linalg.norm(numbers[3:]))
    if not np.all(np.isfinite(numbers)) or abs(norm - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"static transform {parent} -> {child}: {numbers.tolist()} is none")
    names = frame_name(parent), frame_name(child)
    return StaticTransform(*names, Rotation.from_quat(numbers[3:]).as_matrix(), numbers[:3])


def transform_of(message: Any) -> StaticTransform:
    """Return a geometry_msgs/TransformStamped, of ROS or of a recording, as `static_transform`."""
    place, turn = message.transform.translation, message.transform.rotation
    return static_transform(
        message.header.frame_id,
        message.child_frame_id,
        (place.x, place.y, place.z),
        (turn.x, turn.y, turn.z, turn.w),
    )


def sensor_frames(transforms: Iterable[StaticTransform]) -> dict[str, SensorFrame]:
    """Return every frame that hangs at `wrist_base` or `wrist_platform`, over any number of steps.

    `transforms`: in any order, followed in both directions.  Gives frames by name.  A sensor's own
    transform does not say on what its wrench acts: on the platform.  Between base and platform
    there is nothing fixed, so a chain ends at either.
    """
    found = {name: SensorFrame(name) for name in (BASE_FRAME, PLATFORM_FRAME)}
    left = list(transforms)
    while True:
        rest = []
        for step in left:
            if step.parent in found and step.child not in found:
                at = found[step.parent]
                turn, place = at.rotation @ step.rotation, at.rotation @ step.position
                found[step.child] = SensorFrame(at.parent, turn, at.position + place)
            elif step.child in found and step.parent not in found:
                at = found[step.child]
                turn = at.rotation @ step.rotation.T
                place = at.position - turn @ step.position
                found[step.parent] = SensorFrame(at.parent, turn, place)
            else:
                rest.append(step)
        if len(rest) == len(left):
            return {name: frame for name, frame in found.items() if name != frame.parent}
        left = rest
