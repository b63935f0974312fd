"""A topic in a recording together with what is needed to understand its payloads.

An MCAP file has its channels and schemas in its data, and again in its summary.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Schema

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.mcap_chunk import Contents
from wrist_stiffness.recording.messages import MESSAGE_TYPES, Message
from wrist_stiffness.recording.schema import definition_text, type_hash


@dataclass(frozen=True)
class Channel:
    """Topic, type and encodings, as an MCAP channel and its schema state them."""

    topic: str  # absolute topic name
    ros_type: str  # ``package/msg/Type``
    message_encoding: str  # ``cdr`` for everything that ROS 2 writes
    schema_encoding: str  # ``ros2msg`` or ``ros2idl``
    schema_text: bytes  # the type's definition in that encoding
    type_hash: str  # RIHS01 hash, empty where the recording does not state it

    @property
    def message_type(self) -> type[Message] | None:
        """Class of the messages, None where this project does not know the type."""
        return MESSAGE_TYPES.get(self.ros_type) if self.message_encoding == "cdr" else None


def channel_of(topic: str, message_type: type[Message]) -> Channel:
    """Return the channel of a topic that carries one of this project's messages.

    Gives `Channel`: with the official definition and its hash.
    """
    return _channel_of(topic, message_type.ros_type)


@cache
def _channel_of(topic: str, ros_type: str) -> Channel:
    text = definition_text(ros_type).encode()
    return Channel(topic, ros_type, "cdr", "ros2msg", text, type_hash(ros_type))


UNREADABLE = (McapError, struct.error, ValueError)
"""What reading a damaged record may raise."""

Definition = Schema | McapChannel
Key = tuple[int, int]
"""Opcode and number."""
Definitions = dict[Key, Definition]

READERS = {Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: McapChannel.read}


def definition(opcode: int, content: bytes) -> tuple[Key, Definition]:
    """Read a channel or schema; raise one of `UNREADABLE` where it is damaged."""
    found = READERS[Opcode(opcode)](ReadDataStream(BytesIO(content)))
    return (opcode, found.id), found


def definitions_in(contents: Contents) -> Definitions:
    """Return the channels and schemas of a chunk; raise RecordingError where one is damaged."""
    try:
        return dict(
            definition(opcode, content) for opcode, content in contents.others if opcode in READERS
        )
    except UNREADABLE as error:
        raise RecordingError(f"a channel or schema cannot be read ({error})") from error


def named(found: Definition) -> str:
    """Return a channel or schema as messages call it."""
    if isinstance(found, McapChannel):
        return f"channel {found.id} is {found.topic!r}"
    return f"schema {found.id} is {found.name!r}"


def channels_of(definitions: Definitions) -> dict[int, Channel]:
    """Return the channels by number, each with its schema where there is one."""
    channels = {}
    for channel in definitions.values():
        if isinstance(channel, McapChannel):
            schema = definitions.get((Opcode.SCHEMA, channel.schema_id))
            schema = schema if isinstance(schema, Schema) else Schema(0, b"", "", "")
            channels[channel.id] = Channel(
                topic=channel.topic,
                ros_type=_ros_type(schema.name),
                message_encoding=channel.message_encoding,
                schema_encoding=schema.encoding,
                schema_text=schema.data,
                type_hash=channel.metadata.get("topic_type_hash", ""),
            )
    return channels


def _ros_type(schema_name: str) -> str:
    """Return ``package/msg/Type`` where a writer left out the middle."""
    package, *_, name = schema_name.split("/") if "/" in schema_name else ("", schema_name)
    return f"{package}/msg/{name}" if package else schema_name
