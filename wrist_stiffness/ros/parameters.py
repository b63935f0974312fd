"""Declare a node's parameters to ROS, with type, range and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from wrist_stiffness.compensation.parameters import ParameterEntry
from wrist_stiffness.shipped import shipped_file

SHIPPED_MODEL = "config/palmieri2015_model.yaml"


def descriptor(entry: ParameterEntry) -> ParameterDescriptor:
    """Return what ROS tools show and check of a parameter."""
    descriptor = ParameterDescriptor(description=entry.text, read_only=entry.fixed)
    if entry.choices:
        descriptor.additional_constraints = f"one of {', '.join(entry.choices)}"
    if entry.lower is None or entry.upper is None:
        return descriptor
    if isinstance(entry.default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=entry.lower, to_value=entry.upper)
        ]
    else:
        descriptor.integer_range = [
            IntegerRange(from_value=int(entry.lower), to_value=int(entry.upper))
        ]
    return descriptor


def declare(node: Node, entries: Sequence[ParameterEntry]) -> None:
    """Declare parameters.

    Parameters
    ----------
    node : Node
        Gets them, with the values it was started with.
    entries : sequence of ParameterEntry
        What to declare.

    Raises
    ------
    rclpy.exceptions.ParameterException
        If a value that the node was started with has another type or is out of range.
    """
    for entry in entries:
        node.declare_parameter(entry.name, entry.default, descriptor(entry))


def values_of(node: Node, entries: Sequence[ParameterEntry]) -> Mapping[str, Any]:
    """Return the present values by name."""
    return {entry.name: node.get_parameter(entry.name).value for entry in entries}


def model_path(named: str) -> Path:
    """Return the path of the model file that a parameter names, or of the shipped one."""
    return Path(named) if named else shipped_file(SHIPPED_MODEL)
