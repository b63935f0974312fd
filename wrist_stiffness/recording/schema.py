"""What a message type is made of: its fields, its schema text and its type hash."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from wrist_stiffness.recording.messages import MESSAGE_TYPES, MSG_LINE

SECONDS_NANOSECONDS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
"""Types that the dataclasses hold as one integer of nanoseconds."""


class Primitive(NamedTuple):
    """A type of numbers: as `struct` and NumPy write it, bytes, and as rosidl numbers it."""

    format: str
    size: int
    type_id: int


# Numbers of rosidl's type description (type_description_interfaces/msg/FieldType), and what is
# added to them for a fixed-size array and an unbounded sequence.
PRIMITIVES = {
    "uint8": Primitive("B", 1, 3),
    "int32": Primitive("i", 4, 6),
    "uint32": Primitive("I", 4, 7),
    "float32": Primitive("f", 4, 10),
    "float64": Primitive("d", 8, 11),
    "bool": Primitive("?", 1, 15),
    "byte": Primitive("B", 1, 16),
}
_NESTED_ID, _STRING_ID = 1, 17
_ARRAY_ID, _SEQUENCE_ID = 48, 144

_LINE = re.compile(r"(?P<element>[\w/]+)(?P<bracket>\[(?P<count>\d*)\])? (?P<name>\w+)")


@dataclass(frozen=True)
class Field:
    """One field of a message type."""

    name: str  # name in ROS
    attribute: str  # name of the dataclass attribute
    element: str  # one of `PRIMITIVES`, ``string``, or ``package/msg/Type``
    is_sequence: bool  # whether the field is an unbounded sequence
    count: int  # number of elements of a fixed-size array, 0 for anything else


@cache
def fields_of(ros_type: str) -> tuple[Field, ...]:
    """Return the fields of a message type in the order of the wire.

    `ros_type`: full name of a type in `wrist_stiffness.recording.messages`.
    """
    return tuple(_field(line, ros_type.split("/")[0]) for line in _field_lines(ros_type))


def _field(line: str, package: str) -> Field:
    match = _LINE.match(line)
    assert match is not None  # the lines are those of `messages`
    name, element = match["name"], match["element"]
    if element not in PRIMITIVES and element != "string":
        *given, type_name = element.split("/")
        element = f"{given[0] if given else package}/msg/{type_name}"
    attribute = f"{name}_ns" if element in SECONDS_NANOSECONDS else name
    return Field(name, attribute, element, match["bracket"] == "[]", int(match["count"] or 0))


def _field_lines(ros_type: str) -> list[str]:
    if ros_type in SECONDS_NANOSECONDS:
        return ["int32 sec", "uint32 nanosec"]
    return [item.metadata[MSG_LINE] for item in dataclasses.fields(MESSAGE_TYPES[ros_type])]


def _nested_types(ros_type: str) -> list[str]:
    """Return the names of all types below a type, each once, in order of first use."""
    found: list[str] = []
    waiting = [ros_type]
    while waiting:
        for item in fields_of(waiting.pop(0)):
            if "/" in item.element and item.element not in found:
                found.append(item.element)
                waiting.append(item.element)
    return found


@cache
def definition_text(ros_type: str) -> str:
    """Return the ``ros2msg`` schema: the definition and, behind separators, what it uses.

    `ros_type`: full name of a type in `wrist_stiffness.recording.messages`.  Gives text as rosbag2
    writes it into a recording, comments left out.
    """
    text = ""
    for name in (ros_type, *_nested_types(ros_type)):
        if text:
            text += f"{'=' * 80}\nMSG: {name.replace('/msg/', '/')}\n"
        constants = MESSAGE_TYPES[name].constants if name in MESSAGE_TYPES else ()
        text += "\n".join((*constants, *_field_lines(name))) + "\n"
    return text


def _description(ros_type: str) -> dict[str, Any]:
    described = []
    for item in fields_of(ros_type):
        nested = item.element if "/" in item.element else ""
        if item.element in PRIMITIVES:
            type_id = PRIMITIVES[item.element].type_id
        else:
            type_id = _NESTED_ID if nested else _STRING_ID
        if item.is_sequence:
            type_id += _SEQUENCE_ID
        elif item.count:
            type_id += _ARRAY_ID
        described.append(
            {
                "name": item.name,
                "type": {
                    "type_id": type_id,
                    "capacity": item.count,
                    "string_capacity": 0,
                    "nested_type_name": nested,
                },
            }
        )
    return {"type_name": ros_type, "fields": described}


@cache
def type_hash(ros_type: str) -> str:
    """Return the type hash that ROS 2 compares at discovery (REP-2016, version RIHS01).

    `ros_type`: full name of a type in `wrist_stiffness.recording.messages`.  Gives ``RIHS01_`` and
    the SHA-256 of the type description in canonical JSON.
    """
    canonical = json.dumps(
        {
            "type_description": _description(ros_type),
            "referenced_type_descriptions": [
                _description(name) for name in sorted(_nested_types(ros_type))
            ],
        }
    )
    return "RIHS01_" + hashlib.sha256(canonical.encode()).hexdigest()
