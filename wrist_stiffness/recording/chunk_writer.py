"""MCAP files, message by message or a block of messages at once.

mcap's own writer takes one message at a time, about 10 us each: five times what a whole block of
them costs here (`bench/recording_speed.py`).  Its records serve for everything but the messages.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, deque
from concurrent.futures import Future, ThreadPoolExecutor
from io import BytesIO
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import (
    Chunk,
    ChunkIndex,
    DataEnd,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from wrist_stiffness.recording.channel import Channel
from wrist_stiffness.recording.mcap_chunk import (
    MESSAGE,
    MESSAGE_HEAD_SIZE,
    RECORD_HEAD,
    Integers,
    Payloads,
)

CHUNK_BYTES = 128 * 1024
"""Of messages before compression.  A cut file keeps its whole chunks: MCAP's usual 1 MiB is minutes
of a slow sensor, and the file is 1 % smaller for it."""

BLOCK_CHUNK_BYTES = 1 << 20
"""Of messages that come by the thousand, before compression: MCAP's usual size, and in three hours
at 1 kHz an eighth of the chunks that smaller ones would be."""

COMPRESSION_LEVEL = -1
"""Of zstandard: the size of level 1, for 85 % of its time."""

MOST_PACKED = 2
"""So many chunks wait to be written."""

MESSAGE_RECORD = struct.Struct("<BQHIQQ")
"""The same as `MESSAGE`."""


Packing = tuple[Future[tuple[bytes, int]], int, Integers, Integers, Integers]
"""Compressed records and their checksum, their size, channels, log times and places."""


class Messages:
    """Messages of many channels, gathered in any order and written in one."""

    def __init__(self) -> None:
        self.count = 0  # how many there are
        self._groups: list[tuple[int, Integers, Integers, Payloads]] = []

    def add(
        self, channel_id: int, order: Integers, log_time_ns: Integers, payloads: Payloads
    ) -> None:
        """Add messages of a channel.

        `order` (k,): their places among all messages; no two are the same.  `log_time_ns` (k,)
        [ns].  `payloads`: k of them.
        """
        if len(order):
            self.count += len(order)
            self._groups.append((channel_id, order, log_time_ns, payloads))

    def records(self) -> tuple[NDArray[np.uint8], Integers, Integers, Integers]:
        """Return the records in their order.

        Gives (size,) uint8, (n + 1,) int, (n,) int, (n,) int: all bytes, where each record begins
        and the last one ends, channels, log times [ns].
        """
        sizes = [
            np.full(len(order), payloads.shape[1])
            if isinstance(payloads, np.ndarray)
            else np.array([len(each) for each in payloads])
            for _, order, _, payloads in self._groups
        ]
        every = np.argsort(np.concatenate([order for _, order, _, _ in self._groups]))
        channel = np.concatenate([np.full(len(group[1]), group[0]) for group in self._groups])
        times = np.concatenate([group[2] for group in self._groups])
        length = np.concatenate(sizes) + MESSAGE.itemsize
        begins = np.zeros(self.count + 1, dtype=np.int64)
        np.cumsum(length[every], out=begins[1:])
        place = np.empty(self.count, dtype=np.int64)
        place[every] = begins[:-1]
        out = np.empty(int(begins[-1]), dtype=np.uint8)
        heads = np.empty(self.count, dtype=MESSAGE)
        heads["opcode"], heads["length"] = Opcode.MESSAGE, length - RECORD_HEAD.size
        heads["channel"], heads["sequence"] = channel, 0
        heads["log_time"] = heads["publish_time"] = times
        _at_each_byte(out, MESSAGE.itemsize)[place] = heads.view(f"V{MESSAGE.itemsize}")
        start = 0
        for _, order, _, payloads in self._groups:
            own = place[start : start + len(order)] + MESSAGE.itemsize
            start += len(order)
            if isinstance(payloads, np.ndarray):
                rows = np.ascontiguousarray(payloads).view(f"V{payloads.shape[1]}")
                _at_each_byte(out, payloads.shape[1])[own] = rows[:, 0]
                continue
            for begin, payload in zip(own.tolist(), payloads, strict=True):
                out[begin : begin + len(payload)] = np.frombuffer(payload, np.uint8)
        return out, begins, channel[every], times[every]


def _at_each_byte(out: NDArray[np.uint8], size: int) -> NDArray[np.void]:
    """Return what of a size begins at each byte, to be written."""
    return np.ndarray((max(0, len(out) - size + 1),), f"V{size}", out.data, strides=(1,))


class ChunkWriter:
    """Writes one MCAP file in chunks with their indexes, checksums and a summary.

    `stream`: a file to write to from its beginning.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        # One thread: chunks come back in their order, and their bytes are the same as without it.
        self._packer = ThreadPoolExecutor(1)
        self._packing: deque[Packing] = deque()
        self._schemas: list[Schema] = []
        self._channels: list[McapChannel] = []
        self._indexes: list[ChunkIndex] = []
        self.counts: Counter[int] = Counter()  # messages by channel, of all chunks written
        self.times_ns = 0, 0  # first and last log time of these [ns]
        self._open = BytesIO()
        self._messages: list[tuple[int, int, int]] = []
        stream.write(MCAP0_MAGIC + _bytes(Header(profile="ros2", library="wrist_stiffness")))

    def register(self, channel: Channel, metadata: dict[str, str]) -> int:
        """Make a channel known and return its number."""
        number = len(self._channels) + 1
        schema = Schema(
            id=number,
            data=channel.schema_text,
            encoding=channel.schema_encoding,
            name=channel.ros_type,
        )
        record = McapChannel(
            id=number,
            topic=channel.topic,
            message_encoding=channel.message_encoding,
            schema_id=number,
            metadata=metadata,
        )
        self._schemas.append(schema)
        self._channels.append(record)
        self._open.write(_bytes(schema) + _bytes(record))
        return number

    def add_message(self, channel_id: int, log_time_ns: int, payload: bytes) -> None:
        """Append a message."""
        self._messages.append((channel_id, log_time_ns, self._open.tell()))
        size = MESSAGE_HEAD_SIZE + len(payload)
        head = MESSAGE_RECORD.pack(Opcode.MESSAGE, size, channel_id, 0, log_time_ns, log_time_ns)
        self._open.write(head)
        self._open.write(payload)
        if self._open.tell() >= CHUNK_BYTES:
            self._pack_open()
            self._write_packed(0)

    def add_messages(self, messages: Messages) -> None:
        """Append many messages; they are compressed beside what comes next."""
        if not messages.count:
            return
        self._pack_open()
        records, begins, channels, times = messages.records()
        first, n = 0, messages.count
        while first < n:
            last = int(np.searchsorted(begins, begins[first] + BLOCK_CHUNK_BYTES))
            last = min(max(last, first + 1), n)
            begin, part = int(begins[first]), slice(first, last)
            chunk = records[begin : begins[last]].data
            self._pack(chunk, channels[part], times[part], begins[part] - begin)
            first = last

    def _pack_open(self) -> None:
        if not self._open.tell():
            return
        columns = np.array(self._messages, dtype=np.int64).reshape(-1, 3)
        self._pack(self._open.getvalue(), *columns.T)
        self._open, self._messages = BytesIO(), []

    def _pack(
        self, records: bytes | memoryview, channels: Integers, times: Integers, begins: Integers
    ) -> None:
        """Compress a chunk in another thread, and write what is done.

        Channels, log times [ns] and places of its messages (n,).
        """
        compressed = self._packer.submit(self._compressed, records)
        self._packing.append((compressed, len(records), channels, times, begins))
        self._write_packed(MOST_PACKED)

    def _compressed(self, records: bytes | memoryview) -> tuple[bytes, int]:
        return self._compressor.compress(records), zlib.crc32(records)

    def _write_packed(self, left: int) -> None:
        """Write the oldest chunks that are being compressed, but for so many."""
        while len(self._packing) > left:
            compressed, size, channels, times, begins = self._packing.popleft()
            self._write_chunk(*compressed.result(), size, channels, times, begins)

    def finish(self) -> None:
        """Write the last chunk and the summary."""
        self._pack_open()
        self._write_packed(0)
        self._stream.write(_bytes(DataEnd(data_section_crc=0)))
        start = self._stream.tell()
        first_ns, last_ns = self.times_ns
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self.counts),
            chunk_count=len(self._indexes),
            message_count=self.counts.total(),
            message_start_time=first_ns,
            message_end_time=last_ns,
            metadata_count=0,
            schema_count=len(self._schemas),
        )
        data, offsets = b"", b""
        for opcode, records in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._indexes),
        ):
            group = b"".join(map(_bytes, records))
            offsets += _bytes(SummaryOffset(opcode, start + len(data), len(group)))
            data += group
        offset_start = start + len(data)
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start)
        crc = zlib.crc32(data + offsets + footer)
        self._stream.write(data + offsets + footer + struct.pack("<I", crc) + MCAP0_MAGIC)

    def _write_chunk(
        self,
        data: bytes,
        crc: int,
        size: int,
        channels: Integers,
        times: Integers,
        begins: Integers,
    ) -> None:
        """Write a compressed chunk and its index."""
        first_ns, last_ns = (int(times.min()), int(times.max())) if len(times) else (0, 0)
        if len(times):
            known = self.times_ns if self.counts else (first_ns, last_ns)
            self.times_ns = min(first_ns, known[0]), max(last_ns, known[1])
        place = self._stream.tell()
        chunk = Chunk(
            compression="zstd",
            data=data,
            message_start_time=first_ns,
            message_end_time=last_ns,
            uncompressed_crc=crc,
            uncompressed_size=size,
        )
        self._stream.write(_bytes(chunk))
        index_place, offsets = self._stream.tell(), {}
        order = np.argsort(channels, kind="stable")
        every = np.stack([times[order], begins[order]], axis=1).astype("<u8")
        counts = np.bincount(channels)
        ends = np.cumsum(counts)
        for number in np.flatnonzero(counts).tolist():
            count, end = int(counts[number]), int(ends[number])
            entries = every[end - count : end].tobytes()
            self.counts[number] += count
            offsets[number] = self._stream.tell()
            head = struct.pack(
                "<BQHI", Opcode.MESSAGE_INDEX, 6 + len(entries), number, len(entries)
            )
            self._stream.write(head + entries)
        self._indexes.append(
            ChunkIndex(
                chunk_length=index_place - place,
                chunk_start_offset=place,
                compression="zstd",
                compressed_size=len(data),
                message_end_time=last_ns,
                message_index_length=self._stream.tell() - index_place,
                message_index_offsets=offsets,
                message_start_time=first_ns,
                uncompressed_size=size,
            )
        )


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
