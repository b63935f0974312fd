"""Convert in: motor angles by name, wrenches from any sensor frame to O.

Sensor frames come from a mapping (YAML) or from `/tf_static`: chains of fixed transforms that end
at base or platform.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import isfinite
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.inputs.document import yaml_node
from wrist_stiffness.inputs.schema import Quantity, mapping_of, record, text, vector
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.block import Load
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME

JOINT_STATE, COMMAND = "joint state", "command"


@dataclass(frozen=True)
class MotorNames:
    """The two motor joints among the names of a joint state."""

    motor_1: str = "motor_1_joint"
    motor_2: str = "motor_2_joint"

    def places(self, names: Sequence[str], what: str = JOINT_STATE) -> tuple[int, int]:
        """Return where the motors stand in a list of joint names.

        `names`: in any order, other joints ignored; `what`: what the names are of, for the message.
        Raises `InputError` if a motor is missing or named twice.
        """
        return _places((self.motor_1, self.motor_2), tuple(names), what)

    def angles(
        self, names: Sequence[str], positions: Sequence[float], what: str = JOINT_STATE
    ) -> Array:
        """Return the motor angles of a joint state or command.

        `names`: in any order, other joints ignored; `positions`: one a name [rad]; `what`: what the
        angles are of, for the message.  Gives (2,): motor angles [rad].  Raises `InputError` if a
        motor is missing, named twice, without a position or not finite.
        """
        places = self.places(names, what)
        if len(positions) != len(names):
            raise InputError(f"{what}: {len(positions)} positions for {len(names)} names")
        first, second = float(positions[places[0]]), float(positions[places[1]])
        if not (isfinite(first) and isfinite(second)):
            raise InputError(f"{what}: motor angles ({first}, {second}) are not finite")
        return np.array([first, second])

    def speeds(self, names: Sequence[str], velocities: Sequence[float]) -> Array | None:
        """Return the motor speeds of a joint state or command whose angles are usable.

        `names`: in any order, other joints ignored; `velocities`: one a name, or none at all, as
        many drivers send it [rad/s].  Gives (2,): motor speeds [rad/s]; None where the message does
        not have both of them.
        """
        if len(velocities) != len(names):
            return None
        speeds = np.array([velocities[place] for place in self.places(names)], dtype=float)
        return speeds if np.all(np.isfinite(speeds)) else None


# A stream says the same names in every message.
@lru_cache(maxsize=32)
def _places(motors: tuple[str, str], names: tuple[str, ...], what: str) -> tuple[int, int]:
    for motor in motors:
        count = names.count(motor)
        if count != 1:
            count_text = "is missing" if count == 0 else f"is named {count} times"
            listed = ", ".join(names) or "no names"
            raise InputError(f"{what}: {motor} {count_text} among {listed}")
    return names.index(motors[0]), names.index(motors[1])


FRAME_PREFIX = re.compile("([A-Za-z0-9_][A-Za-z0-9_/]*)?")


def checked_prefix(prefix: str) -> str:
    """Return a prefix of frames (InputError if it cannot be one)."""
    if not FRAME_PREFIX.fullmatch(prefix):
        raise InputError(
            f"frame_prefix: {prefix!r} is not made of letters, digits, _ and, not at its start, /"
        )
    return prefix


def frame_name(frame_id: str) -> str:
    """Return the name of a frame: ROS 1 and what was written for it begin it with a slash."""
    return frame_id.removeprefix("/")


@dataclass(frozen=True)
class SensorFrame:
    """A fixed transform from a sensor's frame to `wrist_base` or `wrist_platform`."""

    parent: str  # `wrist_base` or `wrist_platform`
    # (3, 3), turns sensor components into the parent's
    rotation: Array = field(default_factory=lambda: np.eye(3))
    # (3,), the sensor's origin in the parent [m]
    position: Array = field(default_factory=lambda: np.zeros(3))
    # `platform`, or `environment` where the sensor reports the reaction
    acts_on: Literal["platform", "environment"] = "platform"


IN_BASE = SensorFrame(BASE_FRAME)
ON_PLATFORM = SensorFrame(PLATFORM_FRAME)
FIXED = {BASE_FRAME: IN_BASE, PLATFORM_FRAME: ON_PLATFORM}


@dataclass(frozen=True)
class Frames:
    """The frames in which a wrench, a pose or markers may arrive."""

    # by `frame_name`, beside `wrist_base` and `wrist_platform`
    sensors: Mapping[str, SensorFrame] = field(default_factory=dict)
    prefix: str = ""  # which may stand before the name of every frame, as tf2 tells robots apart

    def own_name(self, frame_id: str) -> str:
        """Return the name of a frame without the prefix."""
        return frame_name(frame_id).removeprefix(self.prefix)

    def load(self, frame_id: str, force: Sequence[float], moment: Sequence[float]) -> Load:
        """Move a wrench to O.

        `frame_id`: frame of the message; its origin is the point of the moment.  `force`, `moment`
        [N], [N m].  Gives `Load`: at O, in F or U.  Raises `FrameError` if the frame is neither
        known nor mapped; `InputError` if a component is not finite.
        """
        frame = self._frame(frame_id)
        if frame is None:
            names = ", ".join([*FIXED, *self.sensors])
            raise FrameError(f"load: frame '{frame_id}' is not known (known: {names})")
        components = [*map(float, force), *map(float, moment)]
        if not all(map(isfinite, components)):
            raise InputError(f"load: wrench {components} is not finite")
        wrench = np.array(components)
        if frame is IN_BASE or frame is ON_PLATFORM:
            return Load(wrench, frame is ON_PLATFORM)
        sign = 1.0 if frame.acts_on == "platform" else -1.0
        turned_force = sign * (frame.rotation @ wrench[:3])
        turned_moment = sign * (frame.rotation @ wrench[3:]) + cross(frame.position, turned_force)
        return Load(np.concatenate([turned_force, turned_moment]), frame.parent == PLATFORM_FRAME)

    def _frame(self, frame_id: str) -> SensorFrame | None:
        name = self.own_name(frame_id)
        return self.sensors.get(name) or FIXED.get(name)

    def is_at_origin(self, frame_id: str) -> bool:
        """Tell whether loads of a frame are at O as they come."""
        frame = self._frame(frame_id)
        return frame is IN_BASE or frame is ON_PLATFORM

    def turns(self, frame_id: str) -> bool:
        """Tell whether loads of a frame that is at O turn with the platform."""
        return self.own_name(frame_id) == PLATFORM_FRAME

    def on_platform(
        self, frame_id: str, point: Sequence[float], what: str
    ) -> tuple[float, float, float]:
        """Return the place in U of a point in a frame of the platform [m].

        Raises `FrameError` if the frame is neither `wrist_platform` nor mapped to it.
        """
        frame = self._mapped(frame_id, PLATFORM_FRAME, what)
        x, y, z = (frame.rotation @ np.array(point) + frame.position).tolist()
        return x, y, z

    def in_base(self, frame_id: str, what: str) -> tuple[Array, Array]:
        """Return how to turn and move what was measured in a frame to F.

        `frame_id`: frame of the message; `what`: what was measured, for the message.  Gives
        `rotation` (3, 3): from the frame to F, and `position` (3,): the frame's origin in F [m].
        Raises `FrameError` if the frame is neither `wrist_base` nor mapped to it.
        """
        frame = self._mapped(frame_id, BASE_FRAME, what)
        return frame.rotation, frame.position

    def _mapped(self, frame_id: str, parent: str, what: str) -> SensorFrame:
        """Return a frame that is the parent or mapped to it (FrameError if neither)."""
        frame = self._frame(frame_id)
        if frame is None or frame.parent != parent:
            known = [parent, *(name for name, own in self.sensors.items() if own.parent == parent)]
            raise FrameError(
                f"{what}: frame '{frame_id}' is neither {parent} nor mapped to it "
                f"(known: {', '.join(known)})"
            )
        return frame


FRAME = record(
    {"parent": text(BASE_FRAME, PLATFORM_FRAME)},
    {
        "position_mm": Quantity(vector()),
        "rpy_deg": Quantity(vector()),
        "acts_on": text("platform", "environment"),
    },
    make=lambda rpy=(0.0, 0.0, 0.0), **others: SensorFrame(
        rotation=Rotation.from_euler("xyz", rpy).as_matrix(), **others
    ),
)


def frames_from_yaml(mapping: str) -> Frames:
    """Read sensor frames from a YAML mapping by frame_id.

    For example ``{ft: {parent: wrist_platform, position_mm: [0, 0, 40], rpy_deg: [0, 0, 90],
    acts_on: environment}}``; roll, pitch and yaw turn about the parent's fixed x, y and z.

    `mapping`: empty for none.  Raises `InputError` if it is no such mapping; the message names the
    frame and the key.
    """
    root = yaml_node(mapping, "frames", InputError)
    if root.value is None:
        return Frames()
    frames = {}
    for key, frame in mapping_of(FRAME)(root).items():
        name = frame_name(key)
        if name in (BASE_FRAME, PLATFORM_FRAME):
            raise root[key].refuse("is fixed and cannot be mapped")
        frames[name] = frame
    return Frames(frames)


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
