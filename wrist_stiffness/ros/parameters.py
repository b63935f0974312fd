"""Parameters, declared once with type, range, unit and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from wrist_stiffness.errors import InputError

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
        Range of a number.
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
        if self.lower is None or self.upper is None:
            return descriptor
        if isinstance(self.default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=self.lower, to_value=self.upper)
            ]
        else:
            descriptor.integer_range = [
                IntegerRange(from_value=int(self.lower), to_value=int(self.upper))
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


def check_choices(entries: Sequence[ParameterEntry], values: Mapping[str, Any]) -> None:
    """Refuse a text that is not among its choices, which ROS itself cannot check.

    Raises
    ------
    InputError
        With the parameter, its value and the choices.
    """
    for entry in entries:
        if entry.choices and values[entry.name] not in entry.choices:
            raise InputError(
                f"{entry.name}: {values[entry.name]!r} is not one of {', '.join(entry.choices)}"
            )
