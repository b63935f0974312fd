"""Between messages and numbers."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    TransformStamped,
    Vector3,
    WrenchStamped,
)
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.urdf import FRAMES
from wrist_stiffness.topics import BASE_FRAME


def nanoseconds(stamp: Time) -> int:
    """Return a stamp as nanoseconds."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def time_message(stamp_ns: int) -> Time:
    """Return nanoseconds as a stamp."""
    seconds, rest = divmod(stamp_ns, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def three(vector: Vector3 | Point) -> tuple[float, float, float]:
    """Return the components of a vector or point message."""
    return vector.x, vector.y, vector.z


def pose_numbers(pose: Pose) -> tuple[tuple[float, float, float], tuple[float, ...]]:
    """Return position and quaternion x y z w of a pose message."""
    turn = pose.orientation
    return three(pose.position), (turn.x, turn.y, turn.z, turn.w)


def pose_message(position: Array, quaternion: Array) -> Pose:
    """Return a pose from a position (3,) [m] and a quaternion (4,) x y z w."""
    x, y, z = position.tolist()
    a, b, c, w = quaternion.tolist()
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=a, y=b, z=c, w=w))


def pose_message_stamped(
    stamp_ns: int, rotation: Array, position: Array, frame_id: str = BASE_FRAME
) -> PoseStamped:
    """Return a platform pose in the base from a rotation (3, 3) and the place of O (3,) [m]."""
    message = PoseStamped()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    message.pose = pose_message(position, Rotation.from_matrix(rotation).as_quat(canonical=True))
    return message


def wrench_message(stamp_ns: int, frame_id: str, wrench: Array) -> WrenchStamped:
    """Return a wrench message from force and moment (6,) [N, N m]."""
    message = WrenchStamped()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    fx, fy, fz, mx, my, mz = wrench.tolist()
    message.wrench.force = Vector3(x=fx, y=fy, z=fz)
    message.wrench.torque = Vector3(x=mx, y=my, z=mz)
    return message


def joint_message(
    stamp_ns: int,
    frame_id: str,
    names: Sequence[str],
    positions: Array,
    velocities: Array | None = None,
) -> JointState:
    """Return a joint state from names, positions (n,) [rad] and, if known, speeds (n,) [rad/s]."""
    message = JointState(name=list(names), position=positions.tolist())
    if velocities is not None:
        message.velocity = velocities.tolist()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    return message


def body_transforms(
    stamp_ns: int, configuration: Configuration, prefix: str = ""
) -> list[TransformStamped]:
    """Return where the rigid wrist's bodies are in `wrist_base`, by prefix and names of its URDF.

    The platform's frame is the nominal one: the error is `/pose_error_predicted`, in `wrist_base`.
    """
    found = []
    for body, rotation in zip(BODIES, configuration.bodies, strict=True):
        if FRAMES[body] == BASE_FRAME:
            continue
        message = TransformStamped(child_frame_id=prefix + FRAMES[body])
        message.header.frame_id = prefix + BASE_FRAME
        message.header.stamp = time_message(stamp_ns)
        quaternion = Rotation.from_matrix(rotation).as_quat(canonical=True)
        message.transform.rotation = pose_message(np.zeros(3), quaternion).orientation
        found.append(message)
    return found


def transforms_type() -> type | None:
    """Return tf2_msgs/TFMessage, None where it is not installed: ROS from PyPI is without it."""
    if find_spec("tf2_msgs") is None:
        return None
    found: type = import_module("tf2_msgs.msg").TFMessage
    return found
