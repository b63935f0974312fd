"""Channels and schemas, as an MCAP file has them: in its data, and again in its summary."""

from __future__ import annotations

import struct
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Schema

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.channel import Channel
from wrist_stiffness.recording.mcap_chunk import Contents

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
