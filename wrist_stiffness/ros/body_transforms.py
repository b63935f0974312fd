"""Where the rigid wrist's bodies are, for viewers of its URDF."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TransformStamped
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.urdf import FRAMES
from wrist_stiffness.ros.conversions import pose_message, time_message
from wrist_stiffness.topics import BASE_FRAME


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
