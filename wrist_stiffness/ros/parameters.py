"""Parameters, declared once with type, range, unit and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node

ParameterValue = bool | int | float | str


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter of a node.

    Parameters
    ----------
    name : str
        With its unit at the end where it has one.
    default : bool, int, float or str
        Also says the type.
    text : str
        What it does, one line.
    lower, upper : float or None
        Range of a float.
    choices : tuple of str
        Allowed texts; empty for any.
    fixed : bool
        Can only be set at the start.
    """

    name: str
    default: ParameterValue
    text: str
    lower: float | None = None
    upper: float | None = None
    choices: tuple[str, ...] = ()
    fixed: bool = False

    @property
    def descriptor(self) -> ParameterDescriptor:
        """What ROS tools show and check."""
        descriptor = ParameterDescriptor(description=self.text, read_only=self.fixed)
        if self.choices:
            descriptor.additional_constraints = f"one of {', '.join(self.choices)}"
        if self.lower is not None and self.upper is not None:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=self.lower, to_value=self.upper)
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
        node.declare_parameter(entry.name, entry.default, entry.descriptor)


def values_of(node: Node, entries: Sequence[ParameterEntry]) -> Mapping[str, Any]:
    """Return the present values by name."""
    return {entry.name: node.get_parameter(entry.name).value for entry in entries}
