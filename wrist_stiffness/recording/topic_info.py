"""The topics of a recording."""

from __future__ import annotations

from dataclasses import dataclass

from wrist_stiffness.recording.mcap_chunk import Span
from wrist_stiffness.recording.mcap_index import McapIndex


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a recording."""

    # `name`, `ros_type`: topic and ``package/msg/Type``
    name: str
    ros_type: str
    count: int  # number of messages
    # `first_ns`, `last_ns`: log time of the first and last message; None without messages
    first_ns: int | None
    last_ns: int | None
    is_readable: bool  # whether the type is one that this project decodes


def topics_of(indices: list[McapIndex]) -> tuple[TopicInfo, ...]:
    """Return the topics of files that belong together, by name."""
    spans: dict[tuple[str, str, bool], Span | None] = {}
    for index in indices:
        own = index.spans
        for channel_id, channel in index.channels.items():
            key = (channel.topic, channel.ros_type, channel.message_type is not None)
            span, known = own.get(channel_id), spans.get(key)
            spans[key] = span.joined(known) if span and known else span or known
    return tuple(
        TopicInfo(
            name=name,
            ros_type=ros_type,
            count=span.count if span else 0,
            first_ns=span.first_ns if span else None,
            last_ns=span.last_ns if span else None,
            is_readable=is_readable,
        )
        for (name, ros_type, is_readable), span in sorted(spans.items(), key=lambda item: item[0])
    )
