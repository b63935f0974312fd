"""MCAP files, message by message or a block of messages at once.

mcap's own writer takes one message at a time, about 10 us each: five times what a whole block of
them costs here (`bench/recording_speed.py`).  Its records serve for everything but the messages.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from io import BytesIO
from typing import Any, BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from wrist_stiffness.recording.mcap_chunk import MESSAGE, MESSAGE_HEAD_SIZE, RECORD_HEAD

BLOCK_CHUNK_BYTES = 1 << 20
"""Of messages that come by the thousand, before compression: MCAP's usual size, and in three hours
at 1 kHz an eighth of the chunks that smaller ones would be."""

COMPRESSION_LEVEL = -1
"""Of zstandard: the size of level 1, for 85 % of its time."""

MOST_PACKED = 2
"""So many chunks wait to be written."""

MESSAGE_RECORD = struct.Struct("<BQHIQQ")
"""The same as `MESSAGE`."""


Integers = NDArray[np.int64]
Packing = tuple[Future[tuple[bytes, int]], int, Integers, Integers, Integers]
"""Compressed records and their checksum, their size, channels, log times and places."""


class Messages:
    """Messages of many channels, gathered in any order and written in one."""

    def __init__(self) -> None:
        self.count = 0  # how many there are
        self._groups: list[tuple[int, Integers, Integers, Any]] = []

    def add(
        self,
        channel_id: int,
        order: Integers,
        log_time_ns: Integers,
        payloads: NDArray[np.uint8] | Sequence[bytes],
    ) -> None:
        """Add messages of a channel.

        `order` (k,): their places among all messages; no two are the same.  `log_time_ns` (k,)
        [ns].  `payloads` (k, size) uint8, or k bytes: of one size, or of any.
        """
        if len(order):
            self.count += len(order)
            self._groups.append((channel_id, order, log_time_ns, payloads))

    def records(
        self,
    ) -> tuple[NDArray[np.uint8], Integers, Integers, Integers]:
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

    `stream`: to write to; its place is the file's.  `chunk_bytes`: of messages before compression.
    """

    def __init__(self, stream: BinaryIO, chunk_bytes: int) -> None:
        self._stream = stream
        self._chunk_bytes = chunk_bytes
        self._place = 0
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        # One thread: chunks come back in their order, and their bytes are the same as without it.
        self._packer = ThreadPoolExecutor(1)
        self._packing: deque[Packing] = deque()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._indexes = bytearray()
        self._chunks = 0
        self.counts: Counter[int] = Counter()  # messages by channel, of all chunks written
        self.times_ns = 0, 0  # first and last log time of these [ns]
        self._open = BytesIO()
        self._messages: list[tuple[int, int, int]] = []

    def start(self, profile: str, library: str) -> None:
        """Write the head of the file."""
        self._write(MCAP0_MAGIC)
        self._record(Header(profile=profile, library=library))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Make a schema known and return its number."""
        schema = Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._open.write(_bytes(schema))
        return schema.id

    def register_channel(
        self, topic: str, encoding: str, schema_id: int, metadata: dict[str, str]
    ) -> int:
        """Make a channel known and return its number."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema_id,
            metadata=metadata,
        )
        self._channels.append(channel)
        self._open.write(_bytes(channel))
        return channel.id

    def add_message(self, channel_id: int, log_time_ns: int, payload: bytes) -> None:
        """Append a message."""
        self._messages.append((channel_id, log_time_ns, self._open.tell()))
        size = MESSAGE_HEAD_SIZE + len(payload)
        head = MESSAGE_RECORD.pack(Opcode.MESSAGE, size, channel_id, 0, log_time_ns, log_time_ns)
        self._open.write(head)
        self._open.write(payload)
        if self._open.tell() >= self._chunk_bytes:
            self.flush()

    def add_messages(self, messages: Messages) -> None:
        """Append many messages; they are compressed beside what comes next."""
        if not messages.count:
            return
        self._flush_open()
        records, begins, channels, times = messages.records()
        first, n = 0, messages.count
        while first < n:
            last = int(np.searchsorted(begins, begins[first] + BLOCK_CHUNK_BYTES))
            last = min(max(last, first + 1), n)
            begin = int(begins[first])
            part = slice(first, last)
            self._later(
                records[begin : begins[last]].data,
                channels[part],
                times[part],
                begins[part] - begin,
            )
            first = last

    def flush(self) -> None:
        """Write the chunk that is open."""
        self._flush_open()
        self._write_packed(0)

    def _flush_open(self) -> None:
        if not self._open.tell():
            return
        columns = np.array(self._messages, dtype=np.int64).reshape(-1, 3)
        self._later(self._open.getvalue(), columns[:, 0], columns[:, 1], columns[:, 2])
        self._open, self._messages = BytesIO(), []

    def _later(
        self, records: bytes | memoryview, channels: Integers, times: Integers, begins: Integers
    ) -> None:
        """Compress a chunk in another thread, and write what is done.

        Channels, log times [ns] and places of its messages (n,).
        """
        packing = self._packer.submit(self._packed, records)
        self._packing.append((packing, len(records), channels, times, begins))
        self._write_packed(MOST_PACKED)

    def _packed(self, records: bytes | memoryview) -> tuple[bytes, int]:
        return self._compressor.compress(records), zlib.crc32(records)

    def _write_packed(self, left: int) -> None:
        """Write the oldest chunks that are being compressed, but for so many."""
        while len(self._packing) > left:
            packing, size, channels, times, begins = self._packing.popleft()
            self._chunk(*packing.result(), size, channels, times, begins)

    def finish(self) -> None:
        """Write the last chunk and the summary."""
        self.flush()
        self._record(DataEnd(data_section_crc=0))
        start = self._place
        data, groups = b"", []
        first_ns, last_ns = self.times_ns
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self.counts),
            chunk_count=self._chunks,
            message_count=self.counts.total(),
            message_start_time=first_ns,
            message_end_time=last_ns,
            metadata_count=0,
            schema_count=len(self._schemas),
        )
        for opcode, records in (
            (Opcode.SCHEMA, b"".join(map(_bytes, self._schemas))),
            (Opcode.CHANNEL, b"".join(map(_bytes, self._channels))),
            (Opcode.STATISTICS, _bytes(statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._indexes)),
        ):
            groups.append(SummaryOffset(opcode, start + len(data), len(records)))
            data += records
        offsets = start + len(data)
        data += b"".join(map(_bytes, groups))
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offsets)
        crc = zlib.crc32(footer, zlib.crc32(data))
        self._write(data)
        self._record(Footer(summary_start=start, summary_offset_start=offsets, summary_crc=crc))
        self._write(MCAP0_MAGIC)

    def _chunk(
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
        place = self._place
        self._record(
            Chunk(
                compression="zstd",
                data=data,
                message_start_time=first_ns,
                message_end_time=last_ns,
                uncompressed_crc=crc,
                uncompressed_size=size,
            )
        )
        length, index_place, offsets = self._place - place, self._place, {}
        order = np.argsort(channels, kind="stable")
        every = np.stack([times[order], begins[order]], axis=1).astype("<u8")
        counts = np.bincount(channels)
        ends = np.cumsum(counts)
        for number in np.flatnonzero(counts).tolist():
            count, end = int(counts[number]), int(ends[number])
            entries = every[end - count : end].tobytes()
            self.counts[number] += count
            offsets[number] = self._place
            head = struct.pack(
                "<BQHI", Opcode.MESSAGE_INDEX, 6 + len(entries), number, len(entries)
            )
            self._write(head + entries)
        self._chunks += 1
        self._indexes += _bytes(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=place,
                compression="zstd",
                compressed_size=len(data),
                message_end_time=last_ns,
                message_index_length=self._place - index_place,
                message_index_offsets=offsets,
                message_start_time=first_ns,
                uncompressed_size=size,
            )
        )

    def _record(self, record: Any) -> None:
        self._write(_bytes(record))

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._place += len(data)


def _bytes(record: Any) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
