"""Declare a node's parameters to ROS, with type, range and text."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from wrist_stiffness.compensation.parameters import (
    COMMON,
    CORRECTION,
    MONITOR,
    PREDICTION,
    ParameterEntry,
)
from wrist_stiffness.errors import InputError, meant
from wrist_stiffness.shipped import shipped_file

EVERY_ENTRY = (*COMMON, *PREDICTION, *CORRECTION, *MONITOR)
"""A params file may give one node's parameters to all (`/**`)."""

OF_RCLPY = {"use_sim_time", "start_type_description_service"}
QOS_OVERRIDES = "qos_overrides."

SHIPPED_MODEL = "config/palmieri2015_model.yaml"


def descriptor(entry: ParameterEntry) -> ParameterDescriptor:
    """Return what ROS tools show and check of a parameter."""
    descriptor = ParameterDescriptor(description=entry.text, read_only=entry.fixed)
    if entry.choices:
        descriptor.additional_constraints = f"one of {', '.join(entry.choices)}"
    if entry.limits is None:
        return descriptor
    lower, upper = entry.limits
    if isinstance(entry.default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=lower, to_value=upper)]
    else:
        descriptor.integer_range = [IntegerRange(from_value=int(lower), to_value=int(upper))]
    return descriptor


def declare(node: Node, entries: Sequence[ParameterEntry]) -> None:
    """Declare parameters.

    `node`: gets them, with the values it was started with.  Raises `InputError` if the node was
    started with a parameter that no node of the wrist has: rclpy ignores it; `ParameterException`
    if a value that the node was started with has another type or is out of range.
    """
    known = {entry.name for entry in (*entries, *EVERY_ENTRY)} | OF_RCLPY
    for name in node._parameter_overrides:
        if name not in known and not name.startswith(QOS_OVERRIDES):
            raise InputError(f"unknown parameter {name!r}{_guess(name, known)}")
    for entry in entries:
        node.declare_parameter(entry.name, entry.default, descriptor(entry))


def _guess(name: str, known: Collection[str]) -> str:
    """Return what was meant, as far as that can be said."""
    first = name.split(".")[0]
    if "." in name and first in known:
        return f": {first} is one text (YAML in quotes), not a mapping"
    return meant(name, known)


def values_of(node: Node, entries: Sequence[ParameterEntry]) -> Mapping[str, Any]:
    """Return the present values by name."""
    return {entry.name: node.get_parameter(entry.name).value for entry in entries}


def model_path(named: str) -> Path:
    """Return the path of the model file that a parameter names, or of the shipped one."""
    return Path(named) if named else shipped_file(SHIPPED_MODEL)
