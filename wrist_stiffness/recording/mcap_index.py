"""What an MCAP file holds, found by walking over its record heads.

The walk does not need the summary at the end of the file, so a file that was cut (power lost, disk
full, copy interrupted) is read by the same code as a whole one.  Behind a damaged record it goes on
at the next that can be one.  Contents of chunks are skipped; they are unpacked here only where
nothing else states which channels and how many messages they hold.

What stands twice in a file is compared: the summary's channels, schemas and counts with those of
the data, the checksums of both sections with their bytes.  What differs is told, and the data is
taken.  For 200,000 messages in 7.6 MB the walk takes 5 ms, mcap's reading of the summary, which it
believes, 1 ms; reading the messages in blocks takes 90 ms.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import mcap.records
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.inputs.opening import open_input
from wrist_stiffness.recording.channel import (
    UNREADABLE,
    Channel,
    Definition,
    Definitions,
    Key,
    channels_of,
    definition,
    definitions_in,
    named,
)
from wrist_stiffness.recording.mcap_chunk import (
    MESSAGE_HEAD_SIZE,
    RECORD_HEAD,
    Chunk,
    Contents,
    Span,
    Spans,
    contents_of,
    from_each_byte,
)

_CHUNK_HEAD = struct.Struct("<QQQII")
_INDEX_HEAD = struct.Struct("<HI")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_LONGEST_COMPRESSION_NAME = 16
# Loose messages are read in runs of about the size of a chunk.
_LOOSE_RUN_BYTES = 1 << 20
_MOST_FLAWS = 100
"""A file with more damaged places than this is given up behind the last."""
_HEAD = np.dtype([("opcode", "u1"), ("length", "<u8")])
_LEAST_BYTES = np.full(256, 2**63, dtype=np.uint64)
"""Length of a record by opcode; none of one that is not known."""
for _opcode, _least in {
    Opcode.FOOTER: 20,
    Opcode.SCHEMA: 14,
    Opcode.CHANNEL: 16,
    Opcode.MESSAGE: MESSAGE_HEAD_SIZE,
    Opcode.CHUNK: 40,
    Opcode.MESSAGE_INDEX: 6,
    Opcode.CHUNK_INDEX: 64,
    Opcode.ATTACHMENT: 36,
    Opcode.ATTACHMENT_INDEX: 48,
    Opcode.STATISTICS: 46,
    Opcode.METADATA: 8,
    Opcode.METADATA_INDEX: 20,
    Opcode.SUMMARY_OFFSET: 17,
    Opcode.DATA_END: 4,
}.items():
    _LEAST_BYTES[_opcode] = _least
_WINDOW_BYTES = 1 << 20
_MOST_CANDIDATES = 10_000


@dataclass(frozen=True)
class McapIndex:
    """Contents of one MCAP file."""

    chunks: list[Chunk]  # in the order of the file
    definitions: Definitions  # channels and schemas as the file has them
    channels: dict[int, Channel]  # by channel id
    flaws: list[str]  # what is wrong with it, as far as the walk sees

    @property
    def spans(self) -> Spans:
        """Messages of the whole file."""
        total: Spans = {}
        for chunk in self.chunks:
            for number, span in chunk.spans.items():
                total[number] = span.joined(total.get(number))
        return total

    def told(self, spans: Spans) -> str:
        """Return messages as a text: how many, of which topic, when."""
        parts = []
        for number, span in spans.items():
            topic = self.channels[number].topic if number in self.channels else f"channel {number}"
            parts.append(f"{span.count} of {topic} ({span.first_ns} to {span.last_ns} ns)")
        return ", ".join(parts) or "unknown messages"

    def disagreement(self, contents: Contents, chunk: Chunk) -> str:
        """Return how the content of a chunk differs from what the file says of it, or nothing."""
        place, stated = chunk.place, chunk.spans
        if (last_ns := max((s.last_ns for s in contents.spans.values()), default=0)) > chunk.end_ns:
            return f"{place} is stated to end at {chunk.end_ns} ns, it ends at {last_ns} ns"
        if stated != contents.spans:
            return f"{place} lists {self.told(stated)}; it holds {self.told(contents.spans)}"
        if orphans := contents.spans.keys() - self.channels.keys():
            return f"{place} holds messages of no channel ({sorted(orphans)})"
        for key, own in definitions_in(contents).items():
            if (known := self.definitions.get(key, own)) != own:
                return f"{place} says {named(own)}, not {named(known)}"
        return ""


def index_mcap(path: Path) -> McapIndex:
    """Walk over an MCAP file.

    Gives what it holds; a damaged file gives what stands before and behind the damage.  Raises
    `RecordingError` if the file is empty, no MCAP file, or cannot be opened.
    """
    with open_input(path, RecordingError) as stream:
        try:
            return _Walk(path, stream).index()
        except OSError as error:
            raise RecordingError(f"{path} cannot be read: {error.strerror}") from error


@dataclass
class _Walk:
    path: Path
    stream: BinaryIO
    chunks: list[Chunk] = field(default_factory=list)
    data: Definitions = field(default_factory=dict)
    summary: Definitions = field(default_factory=dict)
    stated: mcap.records.Statistics | None = None
    flaws: list[str] = field(default_factory=list)
    loose_run_is_open: bool = False
    data_end: int = 0
    summary_start: int = 0
    # Of chunks that were not understood, as far as their index tells.
    lost: list[Spans] = field(default_factory=list)
    # Of the chunk to which an index would belong.
    indexed: Spans = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)

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
        self._walk(size)
        self._look_into_chunks()
        for key, found in self.summary.items():
            self._define(key, found, "the summary")
        index = McapIndex(self.chunks, self.data, channels_of(self.data), [])
        self._compare_counts(index)
        if self.flaws:
            readable = sum(span.count for span in index.spans.values())
            self.flaws.append(f"{readable} messages can be read")
            index.flaws.append(f"{self.path.name}: {'; '.join(self.flaws)}")
        return index

    def _walk(self, size: int) -> None:
        position = len(MCAP0_MAGIC)
        while True:
            try:
                self.stream.seek(position)
                opcode, end = self._record(position, size)
            except UNREADABLE as error:
                self._forget_last_index()
                following = _next_record(self.stream, position + 1, size)
                if position + RECORD_HEAD.size > size:
                    self.flaws.append(f"ends at byte {size} without a footer")
                    return
                if following is None or len(self.flaws) >= _MOST_FLAWS:
                    self.flaws.append(
                        f"damaged or cut within the record at byte {position} (file of {size} "
                        f"bytes; {error})"
                    )
                    return
                self.flaws.append(f"damaged from byte {position} to {following} ({error})")
                position = following
                continue
            if position == len(MCAP0_MAGIC) and opcode != Opcode.HEADER:
                self.flaws.append(f"it begins with a record of kind {opcode}, not with its header")
            if opcode == Opcode.FOOTER:
                if end + len(MCAP0_MAGIC) != size or self.stream.read(8) != MCAP0_MAGIC:
                    self.flaws.append(f"closing magic missing at byte {end}")
                return
            position = end

    def _record(self, position: int, size: int) -> tuple[int, int]:
        """Take one record; return its opcode and where it ends."""
        opcode, length = RECORD_HEAD.unpack(self.stream.read(RECORD_HEAD.size))
        content = position + RECORD_HEAD.size
        if opcode == 0 or content + length > size:
            raise ValueError(f"{length} bytes of kind {opcode}")
        if opcode != Opcode.MESSAGE:
            self.loose_run_is_open = False
        handlers: dict[int, Callable[[int, int], None]] = {
            Opcode.SCHEMA: partial(self._definition, opcode),
            Opcode.CHANNEL: partial(self._definition, opcode),
            Opcode.CHUNK: self._chunk,
            Opcode.MESSAGE_INDEX: self._message_index,
            Opcode.MESSAGE: self._loose_message,
            Opcode.DATA_END: self._data_end,
            Opcode.STATISTICS: self._statistics,
            Opcode.FOOTER: self._footer,
        }
        if opcode in handlers:
            handlers[opcode](content, length)
        elif opcode > Opcode.DATA_END:
            self._lose_chunk()
            self.unknown.append(f"a record of unknown kind {opcode} at byte {position} was skipped")
        self.stream.seek(content + length)
        return opcode, content + length

    def _forget_last_index(self) -> None:
        """Leave the last chunk to be looked into: the damage may have taken a part of its index."""
        if self.chunks and self.indexed is self.chunks[-1].spans:
            self.indexed.clear()
        self._lose_chunk()

    def _lose_chunk(self) -> None:
        self.indexed = {}
        self.lost.append(self.indexed)

    def _definition(self, opcode: int, _: int, length: int) -> None:
        key, found = definition(opcode, self.stream.read(length))
        if self.data_end:
            self.summary[key] = found
        else:
            self._define(key, found, "a later record")

    def _define(self, key: Key, found: Definition, where: str) -> None:
        known = self.data.setdefault(key, found)
        if known != found:
            self.flaws.append(f"{named(known)}; {where} differs: {named(found)}")

    def _chunk(self, content: int, length: int) -> None:
        start_ns, end_ns, uncompressed_size, crc, name_length = _CHUNK_HEAD.unpack(
            self.stream.read(_CHUNK_HEAD.size)
        )
        if name_length > _LONGEST_COMPRESSION_NAME:
            raise ValueError(f"compression name of {name_length} characters")
        compression = self.stream.read(name_length).decode()
        (size,) = struct.unpack("<Q", self.stream.read(8))
        head_size = _CHUNK_HEAD.size + name_length + 8
        if head_size + size != length:
            raise ValueError(f"{size} bytes stated in a chunk record of {length} bytes")
        offset = content + head_size
        chunk = Chunk(
            self.path, offset, size, compression, uncompressed_size, crc, start_ns, end_ns
        )
        self.chunks.append(chunk)
        self.indexed = chunk.spans

    def _message_index(self, _: int, length: int) -> None:
        data = self.stream.read(length)
        channel_id, size = _INDEX_HEAD.unpack_from(data)
        entries = np.frombuffer(data, "<u8", size // 8, _INDEX_HEAD.size)
        if _INDEX_HEAD.size + size != length or size % 16:
            raise ValueError(f"index of {size} bytes in a record of {length} bytes")
        times = entries[::2]
        if times.size:
            self.indexed[channel_id] = Span(times.size, int(times.min()), int(times.max()))

    def _loose_message(self, content: int, length: int) -> None:
        channel_id, _, time_ns, _ = _MESSAGE_HEAD.unpack(self.stream.read(_MESSAGE_HEAD.size))
        begin, end, span = content - RECORD_HEAD.size, content + length, Span(1, time_ns, time_ns)
        if self.loose_run_is_open and self.chunks[-1].size < _LOOSE_RUN_BYTES:
            last = self.chunks.pop()
            begin, spans = last.offset, last.spans
            times = (min(last.start_ns, time_ns), max(last.end_ns, time_ns))
        else:
            spans, times = {}, (time_ns, time_ns)
        spans[channel_id] = span.joined(spans.get(channel_id))
        size = end - begin
        self.chunks.append(Chunk(self.path, begin, size, "", size, 0, *times, spans))
        self.indexed, self.loose_run_is_open = spans, True

    def _data_end(self, content: int, _: int) -> None:
        (crc,) = struct.unpack("<I", self.stream.read(4))
        self.data_end = content - RECORD_HEAD.size
        self.summary_start = content + 4
        if crc and self._crc(0, self.data_end) != crc:
            self.flaws.append(f"the data section does not match its checksum {crc:#010x}")

    def _statistics(self, _: int, length: int) -> None:
        record = ReadDataStream(BytesIO(self.stream.read(length)))
        self.stated = mcap.records.Statistics.read(record)

    def _footer(self, content: int, _: int) -> None:
        start, _, crc = struct.unpack("<QQI", self.stream.read(20))
        here = content - RECORD_HEAD.size
        if not self.data_end:
            self.flaws.append("the end of the data is not marked")
        elif start != (0 if here == self.summary_start else self.summary_start):
            self.flaws.append(f"the footer states the summary at {start}, not {self.summary_start}")
        if crc and self._crc(self.summary_start, content + 16) != crc:
            self.flaws.append(f"the summary does not match its checksum {crc:#010x}")
            self.summary.clear()
            self.stated = None

    def _crc(self, begin: int, end: int) -> int:
        self.stream.seek(begin)
        crc = 0
        for position in range(begin, end, _LOOSE_RUN_BYTES):
            crc = zlib.crc32(self.stream.read(min(_LOOSE_RUN_BYTES, end - position)), crc)
        return crc

    def _compare_counts(self, index: McapIndex) -> None:
        for spans in self.lost:
            if spans:
                self.flaws.append(f"lost with its chunk: {index.told(spans)}")
        if self.stated is None:
            # Such records are allowed, but one may be a damaged chunk, and nothing counts messages.
            self.flaws.extend(self.unknown)
            return
        found, stated = index.spans, self.stated.channel_message_counts
        for number in sorted({*found, *stated}):
            there, count = found[number].count if number in found else 0, stated.get(number, 0)
            if there != count:
                topic = index.channels[number].topic if number in index.channels else number
                self.flaws.append(f"{topic}: {count} messages stated, {there} found")

    def _look_into_chunks(self) -> None:
        """Unpack the chunks that alone can say what they hold.

        A chunk that turns out to be unreadable is left for the reader, which reports it.
        """
        known = {number for kind, number in (*self.data, *self.summary) if kind == Opcode.CHANNEL}
        indexed = {channel_id for chunk in self.chunks for channel_id in chunk.spans}
        for chunk in self.chunks:
            if chunk.spans and indexed <= known:
                continue
            try:
                contents = contents_of(chunk)
                definitions = definitions_in(contents)
            except RecordingError:
                continue
            for key, found in definitions.items():
                self._define(key, found, chunk.place)
            chunk.spans.update(contents.spans)


def _next_record(stream: BinaryIO, position: int, size: int) -> int | None:
    """Return where the next record begins: one that is followed by another, or by the end.

    `position`, `size`: from which byte to search, and how many the file has.
    """
    left = _MOST_CANDIDATES
    while position + RECORD_HEAD.size <= size and left > 0:
        stream.seek(position)
        window = stream.read(_WINDOW_BYTES)
        heads = from_each_byte(window, _HEAD)
        ends = np.arange(len(heads)) + position + RECORD_HEAD.size + heads["length"].astype(float)
        possible = (heads["length"] >= _LEAST_BYTES[heads["opcode"]]) & (ends <= size)
        for place in np.flatnonzero(possible)[:left].tolist():
            left -= 1
            if _goes_on(stream, int(ends[place]), int(heads["opcode"][place]), size):
                return position + place
        position += len(heads)
    return None


def _goes_on(stream: BinaryIO, end: int, opcode: int, size: int) -> bool:
    """Tell whether a record may stand at the end of another one, or nothing has to."""
    if opcode == Opcode.FOOTER or end == size:
        return True
    stream.seek(end)
    head = stream.read(RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size:
        return False
    opcode, length = RECORD_HEAD.unpack(head)
    return _LEAST_BYTES[opcode] <= length <= size
