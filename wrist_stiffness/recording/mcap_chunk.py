"""Stretches of message records inside an MCAP file, and the messages in them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from wrist_stiffness.errors import RecordingError

RECORD_HEAD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
MESSAGE_RECORD = struct.Struct("<BQHIQQ")
_MESSAGE = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4")]
    + [("log_time", "<u8"), ("publish_time", "<u8")]
)
"""The same as `MESSAGE_RECORD`."""

Places = NDArray[np.int64]
Times = NDArray[np.int64]
Payloads = Sequence[bytes] | NDArray[np.uint8]
"""Payloads one by one, or (m, size) where all have one size."""

# Recorders write about 1 MiB; a size beyond this one is damage, not a reason to take memory.
_LARGEST_CHUNK = 1 << 30


@dataclass(frozen=True)
class Chunk:
    """A chunk record, or a run of message records that stand outside of any chunk.

    Attributes
    ----------
    path : Path
        The file.
    offset, size : int
        Where the stored bytes begin in the file, and how many they are.
    compression : str
        Empty, ``zstd`` or ``lz4``.
    uncompressed_size, crc : int
        Size and CRC-32 after decompression; CRC 0 = not stated.
    start_ns, end_ns : int
        First and last log time.
    indexed : dict[int, (m,) int array]
        Where the file says that the messages of each channel begin in the chunk; empty = not said.
    """

    path: Path
    offset: int
    size: int
    compression: str
    uncompressed_size: int
    crc: int
    start_ns: int
    end_ns: int
    indexed: dict[int, Places] = field(default_factory=dict)


class StoredMessage(NamedTuple):
    """A message as stored."""

    log_time_ns: int
    channel_id: int
    payload: bytes


def chunk_bytes(chunk: Chunk) -> bytes:
    """Return the records of a chunk, decompressed and checked.

    Parameters
    ----------
    chunk : Chunk
        Where to read.

    Returns
    -------
    bytes
        MCAP records one after another.

    Raises
    ------
    RecordingError
        If the bytes cannot be read, decompressed, or do not match size or checksum.
    """
    place = f"{chunk.path.name}: chunk at byte {chunk.offset}"
    if chunk.uncompressed_size > _LARGEST_CHUNK:
        raise RecordingError(
            f"{place} states {chunk.uncompressed_size} bytes, more than {_LARGEST_CHUNK}"
        )
    try:
        with chunk.path.open("rb") as stream:
            stream.seek(chunk.offset)
            stored = stream.read(chunk.size)
        records = _decompress(stored, chunk)
    except (OSError, RuntimeError, zstandard.ZstdError, MemoryError) as error:
        raise RecordingError(f"{place} cannot be read: {error}") from error
    if len(records) != chunk.uncompressed_size:
        raise RecordingError(
            f"{place} has {len(records)} bytes, its header states {chunk.uncompressed_size}"
        )
    if chunk.crc and zlib.crc32(records) != chunk.crc:
        raise RecordingError(f"{place} does not match its checksum {chunk.crc:#010x}")
    return records


def _decompress(stored: bytes, chunk: Chunk) -> bytes:
    match chunk.compression:
        case "":
            return stored
        case "zstd":
            return zstandard.decompress(stored, max_output_size=chunk.uncompressed_size)
        case "lz4":
            return bytes(lz4.frame.decompress(stored))
        case other:
            raise RuntimeError(f"compression {other!r} is none of '', 'zstd', 'lz4'")


def records_in(buffer: bytes, place: str) -> Iterator[tuple[int, int, int]]:
    """Iterate over the records in a decompressed chunk.

    Parameters
    ----------
    buffer : bytes
        MCAP records.
    place : str
        Where the buffer comes from, for the error's text.

    Yields
    ------
    tuple[int, int, int]
        Opcode, and the slice of the record's content.

    Raises
    ------
    RecordingError
        If a record reaches beyond the buffer.
    """
    position, total = 0, len(buffer)
    while position < total:
        if position + RECORD_HEAD.size > total:
            raise RecordingError(f"{place}: record head cut after {total - position} bytes")
        opcode, length = RECORD_HEAD.unpack_from(buffer, position)
        start = position + RECORD_HEAD.size
        position = start + length
        if position > total:
            raise RecordingError(f"{place}: record of {length} bytes exceeds its chunk")
        yield opcode, start, position


def messages_in(chunk: Chunk, left_out: Collection[int] = ()) -> list[StoredMessage]:
    """Return the messages of a chunk in log-time order, ties in the order of the file.

    Parameters
    ----------
    chunk : Chunk
        Where to read.
    left_out : Collection[int]
        Channels whose messages are not wanted.

    Returns
    -------
    list[StoredMessage]
        Of all other channels.

    Raises
    ------
    RecordingError
        If the chunk is damaged, or holds messages older than its header states: reading in order
        without holding the whole file relies on that time.
    """
    buffer = chunk_bytes(chunk)
    place = f"{chunk.path.name}: chunk at byte {chunk.offset}"
    messages = []
    for opcode, start, end in records_in(buffer, place):
        if opcode == Opcode.MESSAGE:
            if end - start < MESSAGE_HEAD.size:
                raise RecordingError(f"{place}: message record of {end - start} bytes is too short")
            channel_id, _, log_time_ns, _ = MESSAGE_HEAD.unpack_from(buffer, start)
            if channel_id in left_out:
                continue
            payload = buffer[start + MESSAGE_HEAD.size : end]
            messages.append(StoredMessage(log_time_ns, channel_id, payload))
    messages.sort(key=itemgetter(0))
    if messages and messages[0].log_time_ns < chunk.start_ns:
        raise RecordingError(
            f"{place} holds log time {messages[0].log_time_ns} ns, "
            f"before its stated start {chunk.start_ns} ns"
        )
    return messages


def payloads_in(chunk: Chunk, wanted: Collection[int]) -> dict[int, tuple[Times, Payloads]]:
    """Return log times and payloads of some channels of a chunk, in the order of the file.

    Far faster than `messages_in`, for readers that need no order between channels.

    Parameters
    ----------
    chunk : Chunk
        Where to read.
    wanted : Collection[int]
        Channels.

    Returns
    -------
    dict[int, tuple[array, Payloads]]
        Log times [ns] and payloads by channel.

    Raises
    ------
    RecordingError
        If the chunk is damaged.
    """
    buffer = chunk_bytes(chunk)
    place = f"{chunk.path.name}: chunk at byte {chunk.offset}"
    indexed = _all_messages(buffer, chunk.indexed)
    if indexed is not None:
        return _taken(buffer, *indexed, wanted)
    found: dict[int, tuple[list[int], list[bytes]]] = {number: ([], []) for number in wanted}
    position, last = 0, len(buffer) - MESSAGE_RECORD.size
    unpack, skip = MESSAGE_RECORD.unpack_from, RECORD_HEAD.size
    while position <= last:
        opcode, length, channel_id, _, log_time_ns, _ = unpack(buffer, position)
        end = position + skip + length
        if opcode == Opcode.MESSAGE and channel_id in found:
            if end > len(buffer):
                break
            times, payloads = found[channel_id]
            times.append(log_time_ns)
            payloads.append(buffer[position + MESSAGE_RECORD.size : end])
        position = end
    # What remains is shorter than a message, or damage that names itself.
    for _ in records_in(buffer[position:], place):
        pass
    return {
        number: (np.array(times, dtype=np.int64), payloads)
        for number, (times, payloads) in found.items()
    }


def _all_messages(
    buffer: bytes, indexed: dict[int, Places]
) -> tuple[Places, NDArray[np.void]] | None:
    """Return where the messages of a chunk begin, as its index says, and their heads.

    None where a walk from record to record would not find just these.
    """
    begins = np.sort(np.concatenate([np.empty(0, dtype=np.int64), *indexed.values()]))
    if not begins.size or begins[0] < 0 or begins[-1] + MESSAGE_RECORD.size > len(buffer):
        return None
    heads = _from_each_byte(buffer, _MESSAGE)[begins]
    too_short = heads["length"] < MESSAGE_HEAD.size
    if (heads["opcode"] != Opcode.MESSAGE).any() or too_short.any():
        return None
    if (heads["length"] > len(buffer)).any():
        return None
    ends = begins + RECORD_HEAD.size + heads["length"].astype(np.int64)
    before, after = np.append(0, ends), np.append(begins, len(buffer))
    for start, end in zip(before[before != after], after[before != after], strict=True):
        try:
            if start > end or any(
                opcode == Opcode.MESSAGE for opcode, _, _ in records_in(buffer[start:end], "")
            ):
                return None
        except RecordingError:
            return None
    return begins, heads


def _taken(
    buffer: bytes, begins: Places, heads: NDArray[np.void], wanted: Collection[int]
) -> dict[int, tuple[Times, Payloads]]:
    """Return log times and payloads of channels from where messages begin, and their heads."""
    found: dict[int, tuple[Times, Payloads]] = {}
    for number in wanted:
        own = heads["channel"] == number
        sizes = heads["length"][own].astype(np.int64) - MESSAGE_HEAD.size
        times, starts = heads["log_time"][own].astype(np.int64), begins[own] + MESSAGE_RECORD.size
        if sizes.size and sizes[0] and (sizes == sizes[0]).all():
            size = int(sizes[0])
            rows = _from_each_byte(buffer, np.dtype(f"V{size}"))[starts]
            found[number] = times, rows.view(np.uint8).reshape(-1, size)
        else:
            ends = (starts + sizes).tolist()
            found[number] = times, [buffer[a:b] for a, b in zip(starts.tolist(), ends, strict=True)]
    return found


def _from_each_byte(buffer: bytes, kind: np.dtype[np.void]) -> NDArray[np.void]:
    """Return what a buffer holds from each of its bytes on, as far as there are enough of them."""
    count = len(buffer) - kind.itemsize + 1
    return np.ndarray((count,), kind, buffer, strides=(1,))
