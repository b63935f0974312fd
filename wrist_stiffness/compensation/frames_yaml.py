"""Read the mapping of sensor frames, as a node's parameter or a command's option states it."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import Frames, SensorFrame, frame_name
from wrist_stiffness.errors import InputError
from wrist_stiffness.inputs.document import yaml_node
from wrist_stiffness.inputs.schema import Quantity, mapping_of, record, text, vector
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME


def _sensor_frame(
    parent: str,
    position: Array | None = None,
    rpy: Array | None = None,
    acts_on: Literal["platform", "environment"] = "platform",
) -> SensorFrame:
    turned = Rotation.from_euler("xyz", np.zeros(3) if rpy is None else rpy)
    return SensorFrame(
        parent, turned.as_matrix(), np.zeros(3) if position is None else position, acts_on
    )


FRAME = record(
    {"parent": text(BASE_FRAME, PLATFORM_FRAME)},
    {
        "position_mm": Quantity(vector()),
        "rpy_deg": Quantity(vector()),
        "acts_on": text("platform", "environment"),
    },
    make=_sensor_frame,
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
