"""The nodes' parameters from a ROS 2 parameter file, read without ROS.

/**:
  ros__parameters: {frames: "{ft: {parent: wrist_platform}}"}
angle_corrector:
  ros__parameters: {contact_policy: gain, contact_gain: 1.0}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wrist_stiffness.compensation.parameters import (
    COMMON,
    CORRECTION,
    PREDICTION,
    ParameterEntry,
    correction_settings,
    prediction_settings,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.yaml_block import read_yaml

EVERY_NODE = "/**"
KEY = "ros__parameters"
PREDICTOR, CORRECTOR = "pose_error_predictor", "angle_corrector"


def node_settings(
    path: str | Path | None, joints: Sequence[str] = ()
) -> tuple[StreamSettings, StreamSettings]:
    """Return the settings of the sample path of predictor and corrector.

    Parameters
    ----------
    path : path or None
        Parameter file as `ros2 run --ros-args --params-file` takes it; None for the defaults.
    joints : sequence of str
        Joint names of motor 1 and 2, which override the file's; empty for those.

    Returns
    -------
    prediction, correction : StreamSettings
        In SI units.

    Raises
    ------
    InputError
        If the file is no parameter file, or a parameter is unknown, of another type or out of
        range.
    """
    content = {} if path is None else read_yaml(path, InputError)
    if not isinstance(content, Mapping):
        raise InputError(f"{path}: not a ROS 2 parameter file, expected nodes by name")
    if path is not None and not any(
        isinstance(block, Mapping) and KEY in block for block in content.values()
    ):
        raise InputError(f"{path}: not a ROS 2 parameter file, no node in it has {KEY}")
    names = dict(zip(("motor_1_joint", "motor_2_joint"), joints, strict=False))
    predictor = _values(path, content, PREDICTOR, (*COMMON, *PREDICTION))
    corrector = _values(path, content, CORRECTOR, (*COMMON, *CORRECTION))
    return prediction_settings(predictor | names), correction_settings(corrector | names)


def _values(
    path: str | Path | None,
    content: Mapping[Any, Any],
    node: str,
    entries: Sequence[ParameterEntry],
) -> dict[str, Any]:
    """Defaults, then what the file says of every node, then of this one."""
    values: dict[str, Any] = {entry.name: entry.default for entry in entries}
    known = {entry.name: entry for entry in entries}
    for name, block in content.items():
        key = str(name).lstrip("/") if name != EVERY_NODE else EVERY_NODE
        if key not in (EVERY_NODE, node):
            continue
        if not isinstance(block, Mapping) or not isinstance(block.get(KEY), Mapping):
            raise InputError(f"{path}: {name}: expected {KEY} with values by name")
        for parameter, value in block[KEY].items():
            if parameter in known:
                values[parameter] = _checked(f"{path}: {name}", known[parameter], value)
            elif key == node:
                raise InputError(f"{path}: {name}: unknown parameter {parameter}")
    return values


def _checked(place: str, entry: ParameterEntry, value: Any) -> Any:
    kind = type(entry.default)
    # YAML writes 1 for 1.0; ROS itself is stricter.
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        raise InputError(f"{place}: {entry.name}: {value!r} is no {kind.__name__}")
    if isinstance(value, str):
        return value
    if entry.lower is not None and not value >= entry.lower:
        raise InputError(f"{place}: {entry.name}: {value} is below {entry.lower:g}")
    if entry.upper is not None and not value <= entry.upper:
        raise InputError(f"{place}: {entry.name}: {value} is above {entry.upper:g}")
    return value
