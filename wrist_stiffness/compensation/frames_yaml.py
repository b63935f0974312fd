"""Read the mapping of sensor frames, as a node's parameter or a command's option states it."""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import Frames, SensorFrame, frame_name
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME

KEYS = {"parent", "position_mm", "rpy_deg", "acts_on"}


def frames_from_yaml(text: str) -> Frames:
    """Read sensor frames from a YAML mapping by frame_id.

    For example ``{ft: {parent: wrist_platform, position_mm: [0, 0, 40], rpy_deg: [0, 0, 90],
    acts_on: environment}}``; roll, pitch and yaw turn about the parent's fixed x, y and z.

    Parameters
    ----------
    text : str
        Empty for none.

    Returns
    -------
    Frames
        By frame_id.

    Raises
    ------
    InputError
        If it is no such mapping; the message names the frame and the key.
    """
    try:
        values = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InputError(f"frames: not YAML: {' '.join(str(error).split())}") from error
    if values is None:
        return Frames()
    if not isinstance(values, dict):
        raise InputError(f"frames: {text!r} is no mapping by frame_id")
    named = {frame_name(str(key)): entry for key, entry in values.items()}
    return Frames({name: _frame(name, entry) for name, entry in named.items()})


def _frame(name: str, entry: Any) -> SensorFrame:
    if name in (BASE_FRAME, PLATFORM_FRAME):
        raise InputError(f"frames: {name} is fixed and cannot be mapped")
    if not isinstance(entry, dict):
        raise InputError(f"frames: {name}: {entry!r} is no mapping")
    if unknown := set(entry) - KEYS:
        raise InputError(f"frames: {name}: unknown key {', '.join(sorted(map(str, unknown)))}")
    parent = entry.get("parent")
    if parent not in (BASE_FRAME, PLATFORM_FRAME):
        raise InputError(
            f"frames: {name}: parent {parent!r} is not {BASE_FRAME} or {PLATFORM_FRAME}"
        )
    acts_on = entry.get("acts_on", "platform")
    if acts_on not in ("platform", "environment"):
        raise InputError(f"frames: {name}: acts_on {acts_on!r} is not platform or environment")
    return SensorFrame(
        parent,
        Rotation.from_euler("xyz", _three(name, entry, "rpy_deg"), degrees=True).as_matrix(),
        1e-3 * _three(name, entry, "position_mm"),
        acts_on,
    )


def _three(name: str, entry: dict[str, Any], key: str) -> Array:
    value = entry.get(key, [0.0, 0.0, 0.0])
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"frames: {name}: {key}: {value!r} is not three numbers") from error
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InputError(f"frames: {name}: {key}: {value!r} is not three finite numbers")
    return array
