"""The nodes' parameters from a ROS 2 parameter file, read without ROS.

/**:
  ros__parameters: {frames: "{ft: {parent: wrist_platform}}"}
angle_corrector:
  ros__parameters: {load_policy: follow}

Names are matched as ROS 2 does: absolute, nested, `*` for one part of a name, `**` for any number.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
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
from wrist_stiffness.inputs.schema import Schema, number, record, text, truth

KEY = "ros__parameters"
ENTRIES = {
    "pose_error_predictor": (*COMMON, *PREDICTION),
    "angle_corrector": (*COMMON, *CORRECTION),
}

ANY = {"*": "/[^/]+", "**": "(/[^/]+)*"}
"""What stands for one part of a node's name, and for any number of them."""


def node_settings(
    path: str | Path | None, joints: Sequence[str] = ()
) -> tuple[StreamSettings, StreamSettings]:
    """Return the settings of the sample path of predictor and corrector.

    `path`: parameter file as `ros2 run --ros-args --params-file` takes it; None for the defaults.
    The nodes are those of the namespace of which it says most.  `joints`: joint names of motor 1
    and 2, which override the file's; empty for those.  Gives `prediction`, `correction`: in SI
    units.  Raises `InputError` if the file is no parameter file, a parameter is unknown, of another
    type or out of range, or the nodes of two namespaces have different values.
    """
    said = [] if path is None else list(_said(read_yaml(path, InputError)))
    names = dict(zip(("motor_1_joint", "motor_2_joint"), joints, strict=False))
    heard = {
        space: {
            (n, node)
            for n, (name, _) in enumerate(said)
            for node in ENTRIES
            if _is_for(name, f"{space}/{node}")
        }
        for space in dict.fromkeys(["", *(_namespace(name) for name, _ in said)])
    }
    values = {
        space: [_values(said, f"{space}/{node}", ENTRIES[node]) | names for node in ENTRIES]
        for space, own in heard.items()
        if not any(own < other for other in heard.values())
    }
    first, *others = values.values()
    if any(other != first for other in others):
        spaces = " and ".join(space or "/" for space in values)
        raise InputError(
            f"{path}: {spaces} give the nodes different values: name a file for one wrist"
        )
    prediction, correction = map(stream_settings, first)
    return prediction, correction


def not_meant(path: str | Path, nodes: Iterable[str]) -> list[str]:
    """Return a warning for each name in a parameter file that misses a node by its namespace.

    `nodes`: full names of those that are started.  Raises `InputError` if the file is no parameter
    file.
    """
    by_name = {node.rpartition("/")[2]: node for node in nodes}
    warnings = []
    for name, _ in _said(read_yaml(path, InputError)):
        node = by_name.get(name.rpartition("/")[2])
        if node and not _is_for(name, node):
            warnings.append(
                f"WARNING: {path}: {name} is not for {node}, which keeps its defaults; write {node}"
            )
    return warnings


def _said(node: Node, name: str = "") -> Iterator[tuple[str, Node]]:
    """Give the parameters in a file, in its order, each with the name of the nodes they are for."""
    if not isinstance(node.value, dict):
        raise node.refuse(f"is not below the name of a node and {KEY}: no ROS 2 parameter file")
    if name and KEY in node.value:
        yield name, record({KEY: lambda parameters: parameters})(node)[KEY]
        return
    for key, inner in node.value.items():
        yield from _said(inner, re.sub("/+", "/", f"{name}/{key}"))


def _namespace(name: str) -> str:
    """Return the shortest namespace of the nodes that a name is for."""
    return "/".join(part for part in name.split("/")[:-1] if part != "**")


def _is_for(name: str, node: str) -> bool:
    """Tell whether the name in a file is for a node, as ROS 2 matches them."""
    pattern = "".join(ANY.get(part, f"/{re.escape(part)}") for part in name.split("/")[1:])
    return re.fullmatch(pattern, node) is not None


def _values(
    said: Iterable[tuple[str, Node]], node: str, entries: Sequence[ParameterEntry]
) -> dict[str, Any]:
    """Return the defaults and what the file says of a node; what stands further down counts."""
    values: dict[str, Any] = {entry.name: entry.default for entry in entries}
    schemas = {entry.name: _schema_of(entry) for entry in entries}
    for name, parameters in said:
        if _is_for(name, node):
            # What any node is told may be meant for another one.
            values |= record({}, schemas, others=name.endswith("*"))(parameters)
    return values


def _schema_of(entry: ParameterEntry) -> Schema[Any]:
    if isinstance(entry.default, bool):
        return truth
    if isinstance(entry.default, str):
        return text()
    lower, upper = entry.limits or (-inf, inf)
    return number(at_least=lower, at_most=upper)
