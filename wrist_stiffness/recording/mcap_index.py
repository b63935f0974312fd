"""What an MCAP file holds, found by walking over its record heads.

The walk does not need the summary at the end of the file, so a file that was cut (power lost, disk
full, copy interrupted) is read by the same code as a whole one.  Contents of chunks are skipped;
they are decompressed here only where nothing else states which channels and how many messages they
hold.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import mcap.records
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.channel import Channel
from wrist_stiffness.recording.mcap_chunk import (
    MESSAGE_HEAD,
    RECORD_HEAD,
    Chunk,
    chunk_bytes,
    records_in,
)

_CHUNK_HEAD = struct.Struct("<QQQII")
_INDEX_HEAD = struct.Struct("<HI")
_LONGEST_COMPRESSION_NAME = 16
# Loose messages are read in runs of about the size of a chunk.
_LOOSE_RUN_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Span:
    """Number of messages, first and last log time."""

    count: int
    first_ns: int
    last_ns: int

    def joined(self, other: Span) -> Span:
        """Return the span over both."""
        return Span(
            self.count + other.count,
            min(self.first_ns, other.first_ns),
            max(self.last_ns, other.last_ns),
        )


@dataclass(frozen=True)
class McapIndex:
    """Contents of one MCAP file.

    Attributes
    ----------
    chunks : list[Chunk]
        In the order of the file.
    channels : dict[int, Channel]
        By channel id.
    spans : dict[int, Span]
        By channel id, of the channels that have messages.
    damage : str
        Empty, or where and why the file ends early.
    """

    chunks: list[Chunk]
    channels: dict[int, Channel]
    spans: dict[int, Span]
    damage: str


def index_mcap(path: Path) -> McapIndex:
    """Walk over an MCAP file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    McapIndex
        What it holds; a cut file gives what stands before the cut.

    Raises
    ------
    RecordingError
        If the file is empty, no MCAP file, or cannot be opened.
    """
    try:
        with path.open("rb") as stream:
            return _Walk(path, stream).index()
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error


@dataclass
class _Walk:
    path: Path
    stream: BinaryIO
    chunks: list[Chunk] = field(default_factory=list)
    chunk_spans: list[dict[int, Span]] = field(default_factory=list)
    schemas: dict[int, mcap.records.Schema] = field(default_factory=dict)
    channels: dict[int, mcap.records.Channel] = field(default_factory=dict)
    loose_run_is_open: bool = False

    def index(self) -> McapIndex:
        size = os.fstat(self.stream.fileno()).st_size
        if size == 0:
            raise RecordingError(f"{self.path} is empty: no recording")
        if self.stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            hint = "; 'wrist-stiffness import' makes one of a table"
            raise RecordingError(
                f"{self.path} is no recording: it does not begin as an MCAP file"
                + (hint if self.path.suffix.lower() == ".csv" else "")
            )
        damage = self._walk(size)
        if damage and self.chunk_spans:
            # The cut may have taken a part of the last chunk's index.
            self.chunk_spans[-1].clear()
        self._look_into_chunks()
        spans: dict[int, Span] = {}
        for chunk_spans in self.chunk_spans:
            for channel_id, span in chunk_spans.items():
                spans[channel_id] = spans[channel_id].joined(span) if channel_id in spans else span
        if damage:
            readable = sum(span.count for span in spans.values())
            damage = f"{self.path.name}: {damage}; {readable} messages stand before that"
        return McapIndex(self.chunks, self._named_channels(), spans, damage)

    def _walk(self, size: int) -> str:
        """Visit every record; return why the walk ended early, or an empty text."""
        handlers: dict[int, Callable[[int, int], None]] = {
            Opcode.SCHEMA: self._schema,
            Opcode.CHANNEL: self._channel,
            Opcode.CHUNK: self._chunk,
            Opcode.MESSAGE_INDEX: self._message_index,
            Opcode.MESSAGE: self._loose_message,
        }
        position = len(MCAP0_MAGIC)
        while True:
            head = self.stream.read(RECORD_HEAD.size)
            if len(head) < RECORD_HEAD.size:
                return f"ends at byte {size} without a footer"
            opcode, length = RECORD_HEAD.unpack(head)
            content = position + RECORD_HEAD.size
            if opcode == 0 or content + length > size:
                return f"damaged or cut within the record at byte {position} (file of {size} bytes)"
            if opcode != Opcode.MESSAGE:
                self.loose_run_is_open = False
            if opcode in handlers:
                try:
                    handlers[opcode](content, length)
                except (McapError, struct.error, ValueError) as error:
                    return f"unreadable record at byte {position} ({error})"
            position = content + length
            self.stream.seek(position)
            if opcode == Opcode.FOOTER:
                closed = self.stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
                return "" if closed else f"closing magic missing at byte {position}"

    def _record_stream(self, length: int) -> ReadDataStream:
        return ReadDataStream(BytesIO(self.stream.read(length)))

    def _schema(self, _: int, length: int) -> None:
        schema = mcap.records.Schema.read(self._record_stream(length))
        self.schemas[schema.id] = schema

    def _channel(self, _: int, length: int) -> None:
        channel = mcap.records.Channel.read(self._record_stream(length))
        self.channels[channel.id] = channel

    def _chunk(self, content: int, length: int) -> None:
        start_ns, end_ns, uncompressed_size, crc, name_length = _CHUNK_HEAD.unpack(
            self.stream.read(_CHUNK_HEAD.size)
        )
        if name_length > _LONGEST_COMPRESSION_NAME:
            raise ValueError(f"compression name of {name_length} characters")
        compression = self.stream.read(name_length).decode()
        (size,) = struct.unpack("<Q", self.stream.read(8))
        head_size = _CHUNK_HEAD.size + name_length + 8
        if head_size + size > length:
            raise ValueError(f"{size} bytes stated in a chunk record of {length} bytes")
        self.chunks.append(
            Chunk(
                path=self.path,
                offset=content + head_size,
                size=size,
                compression=compression,
                uncompressed_size=uncompressed_size,
                crc=crc,
                start_ns=start_ns,
                end_ns=end_ns,
            )
        )
        self.chunk_spans.append({})

    def _message_index(self, _: int, length: int) -> None:
        data = self.stream.read(length)
        channel_id, size = _INDEX_HEAD.unpack_from(data)
        entries = np.frombuffer(data, "<u8", size // 8, _INDEX_HEAD.size)
        times = entries[::2]
        if self.chunks:
            self.chunks[-1].indexed[channel_id] = entries[1::2].astype(np.int64)
        if times.size and self.chunk_spans:
            span = Span(times.size, int(times.min()), int(times.max()))
            self.chunk_spans[-1][channel_id] = span

    def _loose_message(self, content: int, length: int) -> None:
        channel_id, _, time_ns, _ = MESSAGE_HEAD.unpack(self.stream.read(MESSAGE_HEAD.size))
        begin, end = content - RECORD_HEAD.size, content + length
        if self.loose_run_is_open and self.chunks[-1].size < _LOOSE_RUN_BYTES:
            last = self.chunks.pop()
            begin = last.offset
            times = (min(last.start_ns, time_ns), max(last.end_ns, time_ns))
        else:
            self.chunk_spans.append({})
            times = (time_ns, time_ns)
        size = end - begin
        self.chunks.append(Chunk(self.path, begin, size, "", size, 0, *times))
        spans = self.chunk_spans[-1]
        span = Span(1, time_ns, time_ns)
        spans[channel_id] = spans[channel_id].joined(span) if channel_id in spans else span
        self.loose_run_is_open = True

    def _look_into_chunks(self) -> None:
        """Decompress the chunks that alone can say what they hold.

        A chunk that turns out to be unreadable is left for the reader, which reports it.
        """
        indexed = {channel_id for spans in self.chunk_spans for channel_id in spans}
        channels_are_missing = not indexed <= self.channels.keys()
        for chunk, spans in zip(self.chunks, self.chunk_spans, strict=True):
            if spans and not channels_are_missing:
                continue
            try:
                self._look_into(chunk, spans)
            except (RecordingError, McapError, struct.error, ValueError):
                continue

    def _look_into(self, chunk: Chunk, spans: dict[int, Span]) -> None:
        buffer = chunk_bytes(chunk)
        times: dict[int, list[int]] = {}
        for opcode, start, end in records_in(buffer, self.path.name):
            if opcode == Opcode.MESSAGE:
                channel_id, _, time_ns, _ = MESSAGE_HEAD.unpack_from(buffer, start)
                times.setdefault(channel_id, []).append(time_ns)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                record = ReadDataStream(BytesIO(buffer[start:end]))
                if opcode == Opcode.SCHEMA:
                    schema = mcap.records.Schema.read(record)
                    self.schemas[schema.id] = schema
                else:
                    channel = mcap.records.Channel.read(record)
                    self.channels[channel.id] = channel
        for channel_id, found in times.items():
            spans[channel_id] = Span(len(found), min(found), max(found))

    def _named_channels(self) -> dict[int, Channel]:
        named = {}
        for channel in self.channels.values():
            schema = self.schemas.get(channel.schema_id)
            named[channel.id] = Channel(
                topic=channel.topic,
                ros_type=_ros_type(schema.name) if schema else "",
                message_encoding=channel.message_encoding,
                schema_encoding=schema.encoding if schema else "",
                schema_text=schema.data if schema else b"",
                type_hash=channel.metadata.get("topic_type_hash", ""),
            )
        return named


def _ros_type(schema_name: str) -> str:
    """Return ``package/msg/Type`` where a writer left out the middle."""
    package, *_, name = schema_name.split("/") if "/" in schema_name else ("", schema_name)
    return f"{package}/msg/{name}" if package else schema_name
