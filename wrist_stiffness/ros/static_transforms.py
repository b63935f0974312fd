"""`/tf_static`, where the messages of tf2 are installed; ROS from PyPI comes without them."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from geometry_msgs.msg import TransformStamped

from wrist_stiffness.compensation.static_transforms import StaticTransform, static_transform
from wrist_stiffness.ros.conversions import three


def message_type() -> type | None:
    """Return tf2_msgs/TFMessage, None where it is not installed."""
    if find_spec("tf2_msgs") is None:
        return None
    found: type = import_module("tf2_msgs.msg").TFMessage
    return found


def converted(message: TransformStamped) -> StaticTransform:
    """Return a transform from its message (see `static_transform` for the errors)."""
    turn = message.transform.rotation
    return static_transform(
        message.header.frame_id,
        message.child_frame_id,
        three(message.transform.translation),
        (turn.x, turn.y, turn.z, turn.w),
    )
