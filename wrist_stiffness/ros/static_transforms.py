"""`/tf_static`, where the messages of tf2 are installed; ROS from PyPI comes without them."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec


def message_type() -> type | None:
    """Return tf2_msgs/TFMessage, None where it is not installed."""
    if find_spec("tf2_msgs") is None:
        return None
    found: type = import_module("tf2_msgs.msg").TFMessage
    return found
