"""What a message type is made of: its fields, its schema text and its type hash."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from wrist_stiffness.recording.message import MSG_LINE
from wrist_stiffness.recording.messages import MESSAGE_TYPES

SECONDS_NANOSECONDS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
"""Types that the dataclasses hold as one integer of nanoseconds."""

# Numbers of rosidl's type description (type_description_interfaces/msg/FieldType): element
# types, and what is added for a fixed-size array and an unbounded sequence.
_NESTED_ID = 1
_ELEMENT_IDS = {
    "uint8": 3,
    "int32": 6,
    "uint32": 7,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
_ARRAY_ID = 48
_SEQUENCE_ID = 144

_LINE = re.compile(r"(?P<element>[\w/]+)(?P<bracket>\[(?P<count>\d*)\])? (?P<name>\w+)")


@dataclass(frozen=True)
class Field:
    """One field of a message type."""

    name: str  # name in ROS
    attribute: str  # name of the dataclass attribute
    element: str  # primitive type, or ``package/msg/Type``
    is_sequence: bool = False  # whether the field is an unbounded sequence
    count: int = 0  # number of elements of a fixed-size array, 0 for anything else


@cache
def fields_of(ros_type: str) -> tuple[Field, ...]:
    """Return the fields of a message type in the order of the wire.

    `ros_type`: full name of a type in `wrist_stiffness.recording.messages`.
    """
    if ros_type in SECONDS_NANOSECONDS:
        return (Field("sec", "sec", "int32"), Field("nanosec", "nanosec", "uint32"))
    package = ros_type.split("/")[0]
    parsed = []
    for item in dataclasses.fields(MESSAGE_TYPES[ros_type]):  # type: ignore[arg-type]
        match = _LINE.match(item.metadata[MSG_LINE])
        if match is None:
            raise ValueError(f"{ros_type}: {item.metadata[MSG_LINE]!r} is no .msg line")
        parsed.append(
            Field(
                name=match["name"],
                attribute=item.name,
                element=_full_name(match["element"], package),
                is_sequence=match["bracket"] == "[]",
                count=int(match["count"] or 0),
            )
        )
    return tuple(parsed)


def _full_name(element: str, package: str) -> str:
    if element in _ELEMENT_IDS:
        return element
    *given, name = element.split("/")
    return f"{given[0] if given else package}/msg/{name}"


def _lines_of(ros_type: str) -> list[str]:
    if ros_type in SECONDS_NANOSECONDS:
        return ["int32 sec", "uint32 nanosec"]
    message_type = MESSAGE_TYPES[ros_type]
    lines = [item.metadata[MSG_LINE] for item in dataclasses.fields(message_type)]  # type: ignore[arg-type]
    return [*message_type.constants, *lines]


def _nested_types(ros_type: str) -> list[str]:
    """Return the names of all types below a type, each once, in order of first use."""
    found: list[str] = []
    waiting = [ros_type]
    while waiting:
        for item in fields_of(waiting.pop(0)):
            if item.element not in _ELEMENT_IDS and item.element not in found:
                found.append(item.element)
                waiting.append(item.element)
    return found


@cache
def definition_text(ros_type: str) -> str:
    """Return the ``ros2msg`` schema: the definition and, behind separators, what it uses.

    `ros_type`: full name of a type in `wrist_stiffness.recording.messages`.  Gives text as rosbag2
    writes it into a recording, comments left out.
    """
    parts = ["\n".join(_lines_of(ros_type)) + "\n"]
    for name in _nested_types(ros_type):
        heading = f"{'=' * 80}\nMSG: {name.replace('/msg/', '/')}\n"
        parts.append(heading + "\n".join(_lines_of(name)) + "\n")
    return "".join(parts)


def _description(ros_type: str) -> dict[str, Any]:
    described = []
    for item in fields_of(ros_type):
        nested = item.element not in _ELEMENT_IDS
        type_id = _NESTED_ID if nested else _ELEMENT_IDS[item.element]
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
                    "nested_type_name": item.element if nested else "",
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
