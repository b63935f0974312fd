"""Stretches of message records inside an MCAP file, and the messages in them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.inputs.opening import open_input

try:
    records: Any = import_module("wrist_stiffness.recording._records")
except ImportError:
    records = None
"""The compiled walk over records, a twentieth of the time; None without a C compiler."""

RECORD_HEAD = struct.Struct("<BQ")
MESSAGE = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4")]
    + [("log_time", "<u8"), ("publish_time", "<u8")]
)
"""How a message record begins."""
MESSAGE_HEAD_SIZE = MESSAGE.itemsize - RECORD_HEAD.size
LAST_TIME_NS = 2**63 - 1
"""ROS counts nanoseconds in 64 bits with a sign."""

LARGEST_CHUNK = 64 << 20
"""Recorders write a chunk of about 1 MiB, or of one larger message: a raw picture of 4K has 25 MB.
More is damage, or meant to take all memory: not a reason to give it."""

Integers = NDArray[np.int64]
Payloads = Sequence[bytes] | NDArray[np.uint8]
"""Payloads one by one, or (m, size) where all have one size."""


@dataclass(frozen=True)
class Chunk:
    """A chunk record, or a run of message records that stand outside of any chunk."""

    path: Path  # the file
    # `offset`, `size`: where the stored bytes begin in the file, and how many they are
    offset: int
    size: int
    compression: str  # empty, ``zstd`` or ``lz4``
    # `uncompressed_size`, `crc`: size and CRC-32 after decompression; CRC 0 = not stated
    uncompressed_size: int
    crc: int
    # `start_ns`, `end_ns`: first and last log time
    start_ns: int
    end_ns: int
    # its messages as the file states them beside it; filled while the file is walked over
    spans: Spans = field(default_factory=dict, compare=False)

    @property
    def place(self) -> str:
        """File and byte, for messages."""
        return f"{self.path.name}: chunk at byte {self.offset}"


@dataclass(frozen=True, slots=True)
class Span:
    """Number of messages, first and last log time."""

    count: int
    first_ns: int
    last_ns: int

    def joined(self, other: Span | None) -> Span:
        """Return the span over both."""
        if other is None:
            return self
        return Span(
            self.count + other.count,
            min(self.first_ns, other.first_ns),
            max(self.last_ns, other.last_ns),
        )


Spans = dict[int, Span]
"""By channel id, of the channels that have messages."""


@dataclass(frozen=True, eq=False)
class Contents:
    """A chunk, unpacked and checked."""

    buffer: bytes  # its records
    begins: Integers  # (m,) array, where its messages begin
    heads: NDArray[np.void]  # (m,) of `MESSAGE`, how they begin
    others: list[tuple[int, bytes]]  # opcode and content of its other records

    @cached_property
    def spans(self) -> Spans:
        """Messages of each channel."""
        order = np.argsort(self.heads["channel"], kind="stable")
        numbers, first, count = np.unique(
            self.heads["channel"][order], return_index=True, return_counts=True
        )
        if not len(order):
            return {}
        times = self.heads["log_time"][order]
        ends = np.minimum.reduceat(times, first), np.maximum.reduceat(times, first)
        rows = zip(*(each.tolist() for each in (numbers, count, *ends)), strict=True)
        return {number: Span(*span) for number, *span in rows}


def contents_of(chunk: Chunk) -> Contents:
    """Read a chunk.

    Raises `RecordingError` if the bytes cannot be read or decompressed, do not match size or
    checksum, a record is damaged, or a log time is before the stated start or after the last that
    ROS knows.
    """
    found = _walked(_bytes_of(chunk), chunk)
    times = found.heads["log_time"]
    if times.size and not chunk.start_ns <= times.min() <= times.max() <= LAST_TIME_NS:
        raise RecordingError(
            f"{chunk.place} holds log times {times.min()} to {times.max()} ns, outside of "
            f"{chunk.start_ns} ns, where it is stated to begin, to {LAST_TIME_NS} ns"
        )
    return found


def _bytes_of(chunk: Chunk) -> bytes:
    """Return the records of a chunk, decompressed and checked."""
    if max(chunk.uncompressed_size, chunk.size) > LARGEST_CHUNK:
        raise RecordingError(
            f"{chunk.place} states {max(chunk.uncompressed_size, chunk.size)} bytes, "
            f"more than {LARGEST_CHUNK}"
        )
    try:
        with open_input(chunk.path, RecordingError) as stream:
            stream.seek(chunk.offset)
            unpacked = _unpacked(stream.read(chunk.size), chunk)
    except (OSError, RuntimeError, ValueError, zstandard.ZstdError) as error:
        raise RecordingError(f"{chunk.place} cannot be read: {error}") from error
    if len(unpacked) != chunk.uncompressed_size:
        raise RecordingError(
            f"{chunk.place} has {len(unpacked)} bytes or more, its header states "
            f"{chunk.uncompressed_size}"
        )
    if chunk.crc and zlib.crc32(unpacked) != chunk.crc:
        raise RecordingError(f"{chunk.place} does not match its checksum {chunk.crc:#010x}")
    return unpacked


def _unpacked(stored: bytes, chunk: Chunk) -> bytes:
    """Decompress, never to more than one byte beyond the stated size."""
    size = chunk.uncompressed_size
    match chunk.compression:
        case "":
            return stored
        case "zstd":
            # What the frame itself states is what zstandard takes memory for.
            if (stated := zstandard.frame_content_size(stored)) not in (-1, size):
                raise ValueError(f"its zstd frame states {stated} bytes, its header {size}")
            return zstandard.decompress(stored, max_output_size=size)
        case "lz4":
            decompressor = lz4.frame.LZ4FrameDecompressor()
            return bytes(decompressor.decompress(stored, max_length=size + 1))
        case other:
            raise ValueError(f"compression {other!r} is none of '', 'zstd', 'lz4'")


def _walked(buffer: bytes, chunk: Chunk) -> Contents:
    """Go from record to record: as quick as following the chunk's index, which may be wrong."""
    places, others, position = (_walk if records is None else _compiled_walk)(buffer)
    total = len(buffer)
    if position != total or (len(places) and places[-1] + MESSAGE.itemsize > total):
        raise RecordingError(f"{chunk.place}: no record at byte {position} of its {total}")
    heads = from_each_byte(buffer, MESSAGE)[places]
    if (heads["length"] < MESSAGE_HEAD_SIZE).any():
        raise RecordingError(f"{chunk.place}: a message record is too short")
    return Contents(buffer, places, heads, [(kind, buffer[a:b]) for kind, a, b in others])


def _walk(buffer: bytes) -> tuple[Integers, list[tuple[int, int, int]], int]:
    """Return where messages begin, opcode and content of other records, where there is none."""
    begins, others = [], []
    position, total, unpack = 0, len(buffer), RECORD_HEAD.unpack_from
    while position + RECORD_HEAD.size <= total:
        opcode, length = unpack(buffer, position)
        content = position + RECORD_HEAD.size
        if not opcode or content + length > total:
            break
        if opcode == Opcode.MESSAGE:
            begins.append(position)
        else:
            others.append((opcode, content, content + length))
        position = content + length
    return np.array(begins, dtype=np.int64), others, position


def _compiled_walk(buffer: bytes) -> tuple[Integers, list[tuple[int, int, int]], int]:
    places = np.empty(len(buffer) // RECORD_HEAD.size + 1, dtype=np.int64)
    count, others, position = records.walk(buffer, places)
    return places[:count].copy(), others, position


def from_each_byte(buffer: bytes, kind: np.dtype[np.void]) -> NDArray[np.void]:
    """Return what a buffer holds from each of its bytes on, as far as there are enough of them."""
    count = max(len(buffer) - kind.itemsize + 1, 0)
    return np.ndarray((count,), kind, buffer if count else None, strides=(1,))
