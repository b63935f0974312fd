"""A topic in a recording together with what is needed to understand its payloads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

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
    return Channel(
        topic=topic,
        ros_type=ros_type,
        message_encoding="cdr",
        schema_encoding="ros2msg",
        schema_text=definition_text(ros_type).encode(),
        type_hash=type_hash(ros_type),
    )
