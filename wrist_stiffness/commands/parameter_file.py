"""The nodes' parameters from a ROS 2 parameter file, read without ROS.

/**:
  ros__parameters: {frames: "{ft: {parent: wrist_platform}}"}
angle_corrector:
  ros__parameters: {load_policy: follow}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

from wrist_stiffness.compensation.parameters import (
    COMMON,
    CORRECTION,
    PREDICTION,
    ParameterEntry,
    stream_settings,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError
from wrist_stiffness.inputs.document import Node, read_yaml
from wrist_stiffness.inputs.schema import Schema, mapping_of, number, record, text, truth

EVERY_NODE = "/**"
KEY = "ros__parameters"
PREDICTOR, CORRECTOR = "pose_error_predictor", "angle_corrector"


def node_settings(
    path: str | Path | None, joints: Sequence[str] = ()
) -> tuple[StreamSettings, StreamSettings]:
    """Return the settings of the sample path of predictor and corrector.

    `path`: parameter file as `ros2 run --ros-args --params-file` takes it; None for the defaults.
    `joints`: joint names of motor 1 and 2, which override the file's; empty for those.  Gives
    `prediction`, `correction`: in SI units.  Raises `InputError` if the file is no parameter file,
    or a parameter is unknown, of another type or out of range.
    """
    nodes: Mapping[str, Node] = {}
    if path is not None:
        root = read_yaml(path, InputError)
        nodes = mapping_of(lambda node: node)(root)
        if not any(isinstance(each.value, dict) and KEY in each.value for each in nodes.values()):
            raise root.refuse(f"not a ROS 2 parameter file, no node in it has {KEY}")
    names = dict(zip(("motor_1_joint", "motor_2_joint"), joints, strict=False))
    predictor = _values(nodes, PREDICTOR, (*COMMON, *PREDICTION))
    corrector = _values(nodes, CORRECTOR, (*COMMON, *CORRECTION))
    return stream_settings(predictor | names), stream_settings(corrector | names)


def _values(
    nodes: Mapping[str, Node], node: str, entries: Sequence[ParameterEntry]
) -> dict[str, Any]:
    """Defaults, then what the file says of every node, then of this one."""
    values: dict[str, Any] = {entry.name: entry.default for entry in entries}
    schemas = {entry.name: _schema_of(entry) for entry in entries}
    for name, block in nodes.items():
        if name == EVERY_NODE or name.lstrip("/") == node:
            # What every node is told may be meant for another one.
            of_all = record({}, schemas, others=name == EVERY_NODE)
            values |= record({KEY: of_all}, others=True)(block)[KEY]
    return values


def _schema_of(entry: ParameterEntry) -> Schema[Any]:
    if isinstance(entry.default, bool):
        return truth
    if isinstance(entry.default, str):
        return text()
    lower, upper = entry.limits or (-inf, inf)
    return number(at_least=lower, at_most=upper)
