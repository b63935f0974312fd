"""Payloads of one message type that differ in their numbers only.

The messages of a stream keep their names, frame and lengths, so each number stays at its byte.  For
one payload, a compiled `struct` then reads or writes all numbers, and one comparison tells whether
the rest is as expected; of many, NumPy reads or writes whole columns.  Payloads that differ in more
form groups of their own, down to a group of one.  Joint states come as arrays sixteen times as fast
as from rosbags (`bench/recording_speed.py`).
"""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.cdr import AnyMessage, Decoding, Leaf, encode, result_of
from wrist_stiffness.recording.mcap_chunk import Payloads
from wrist_stiffness.recording.messages import Message
from wrist_stiffness.recording.schema import PRIMITIVES, SECONDS_NANOSECONDS

_SECOND_NS = 1_000_000_000


class FixedLayout(Generic[AnyMessage]):
    """Where the numbers of a payload are, and all the bytes that are none.

    Numbers come in the order of the wire; a time is two of them, seconds and nanoseconds.

    `payload`: a CDR payload in either byte order.  Raises `RecordingError` if it cannot be decoded.
    """

    def __init__(self, message_type: type[AnyMessage], payload: bytes) -> None:
        decoding = Decoding(message_type, payload)
        self.like = result_of(decoding.message())  # the message in this payload
        self.leaves = decoding.leaves
        # (size,), bytes of the encapsulation, of texts and of lengths; the others are numbers or
        # padding
        self.fixed = np.zeros(len(payload), dtype=bool)
        for part in decoding.fixed:
            self.fixed[part] = True
        self._byte_order = decoding.byte_order
        self._payload = payload

    @classmethod
    def of(cls, message: AnyMessage) -> FixedLayout[AnyMessage]:
        """Return the little-endian layout of messages like this one."""
        return cls(type(message), encode(message))

    @cached_property
    def _mask(self) -> int:
        # As one long integer: no other comparison of bytes here and there is as quick.
        return _integer(np.where(self.fixed, 0xFF, 0).astype(np.uint8).tobytes())

    @cached_property
    def _fixed(self) -> int:
        return _integer(self._payload) & self._mask

    @cached_property
    def _struct(self) -> struct.Struct:
        format_, end = str(self._byte_order), 0
        for leaf in self.leaves:
            of_time = leaf.element in SECONDS_NANOSECONDS
            code = "iI" if of_time else f"{leaf.length or 1}{PRIMITIVES[leaf.element].format}"
            format_ += f"{leaf.begin - end}x{code}"
            end = leaf.begin + struct.calcsize(self._byte_order + code)
        return struct.Struct(f"{format_}{len(self._payload) - end}x")

    def matches(self, payload: bytes) -> bool:
        """Tell whether a payload differs from the first one in numbers and padding only."""
        return len(payload) == len(self._payload) and _integer(payload) & self._mask == self._fixed

    def numbers(self, payload: bytes) -> tuple[float, ...]:
        """Return the numbers of a payload that matches."""
        return self._struct.unpack(payload)

    def payload(self, *numbers: float) -> bytes:
        """Return the payload of other numbers, with zeros for padding.

        Raises `RecordingError` if there are more or fewer of them, or one does not fit its type.
        """
        try:
            packed = self._struct.pack(*numbers)
        except struct.error as error:
            raise RecordingError(f"{self.like.ros_type} cannot be encoded: {error}") from error
        return (_integer(packed) | self._fixed).to_bytes(len(self._payload), "little")

    def columns(self, rows: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
        """Return the numbers of payloads (m, size) that match, by path.

        A scalar gives (m,), a sequence of k numbers (m, k), a time (m,) integer nanoseconds.
        """
        found = {}
        for leaf in self.leaves:
            if leaf.element in SECONDS_NANOSECONDS:
                seconds = self._numbers(rows, leaf.begin, "i", 1).astype(np.int64)
                nanoseconds = self._numbers(rows, leaf.begin + 4, "I", 1)
                found[leaf.path] = (seconds * _SECOND_NS + nanoseconds)[:, 0]
            else:
                format_ = PRIMITIVES[leaf.element].format
                numbers = self._numbers(rows, leaf.begin, format_, leaf.length or 1)
                found[leaf.path] = numbers[:, 0] if leaf.length is None else numbers
        return found

    def _numbers(
        self, rows: NDArray[np.uint8], begin: int, format_: str, count: int
    ) -> NDArray[Any]:
        kind = np.dtype(format_).newbyteorder(self._byte_order)
        stored = np.ascontiguousarray(rows[:, begin : begin + kind.itemsize * count])
        return stored.view(kind).astype(np.dtype(format_), copy=False)

    def rows(self, *columns: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the payloads of n messages, (n, size), with zeros for padding.

        `columns` (n,) or (n, k) arrays: one for each number, time [ns] and run of numbers, in the
        order of the wire.
        """
        fixed = np.frombuffer(self._fixed.to_bytes(len(self._payload), "little"), np.uint8)
        out = np.tile(fixed, (len(columns[0]), 1))
        for leaf, column in zip(self.leaves, columns, strict=True):
            self.write(out, leaf, column)
        return out

    def write(self, rows: NDArray[np.uint8], leaf: Leaf, column: NDArray[Any]) -> None:
        """Write numbers (m,) or (m, k), or times (m,) [ns], into payloads (m, size)."""
        if leaf.element in SECONDS_NANOSECONDS:
            parts = [(column // _SECOND_NS, "i"), (column % _SECOND_NS, "I")]
        else:
            parts = [(column, PRIMITIVES[leaf.element].format)]
        begin = leaf.begin
        for numbers, format_ in parts:
            kind = np.dtype(format_).newbyteorder(self._byte_order)
            columns = numbers if numbers.ndim == 2 else numbers[:, None]
            raw = np.ascontiguousarray(columns, dtype=kind).view(np.uint8)
            rows[:, begin : begin + raw.shape[1]] = raw
            begin += raw.shape[1]


class FixedReader(Generic[AnyMessage]):
    """Reads the payloads of one topic."""

    LAYOUTS = 8
    """So many senders or frames may take turns on a topic without being laid out anew."""

    def __init__(self, message_type: type[AnyMessage]) -> None:
        self._message_type = message_type
        self._known: deque[FixedLayout[AnyMessage]] = deque(maxlen=self.LAYOUTS)

    def read(self, payload: bytes) -> tuple[AnyMessage, tuple[float, ...]]:
        """Take a payload apart.

        `payload`: CDR of either byte order.  Gives `like`: with this payload's texts and lengths,
        but maybe with other numbers, and `numbers`: of this payload (see `FixedLayout`).  Raises
        `RecordingError` if the payload cannot be decoded.
        """
        for layout in self._known:
            if layout.matches(payload):
                return layout.like, layout.numbers(payload)
        layout = FixedLayout(self._message_type, payload)
        self._known.append(layout)
        return layout.like, layout.numbers(payload)


def _integer(payload: bytes) -> int:
    return int.from_bytes(payload, "little")


MOST_LAYOUTS = 8
"""More layouts than this in one call gain nothing from columns."""


@dataclass(frozen=True)
class Batch:
    """Messages that differ in their numbers only."""

    indices: NDArray[np.intp]  # (m,) array, which of the payloads, increasing
    first: Message  # the first of them, decoded; its texts and lengths are those of all
    # the numbers by dotted attribute path: (m,) for a scalar, (m, k) for a sequence of k numbers,
    # elements of other sequences by position (``poses.0.position.x``); times in integer nanoseconds
    columns: dict[str, NDArray[Any]]


def decode_batches(
    message_type: type[Message], payloads: Payloads
) -> tuple[list[Batch], list[int]]:
    """Decode payloads column by column.

    `payloads` (Sequence[bytes] or (n, size) uint8 array): CDR of either byte order.  Gives
    `batches`: together they hold every payload that can be decoded, with exactly the values of
    `decode`.
    """
    batches: list[Batch] = []
    undecodable: list[int] = []
    if isinstance(payloads, np.ndarray):
        lengths = np.full(len(payloads), payloads.shape[1], dtype=np.intp)
    else:
        lengths = np.array([len(payload) for payload in payloads], dtype=np.intp)
    remaining = np.arange(len(payloads))
    while remaining.size:
        template = bytes(payloads[remaining[0]])
        try:
            layout = FixedLayout(message_type, template)
        except RecordingError:
            undecodable.append(int(remaining[0]))
            remaining = remaining[1:]
            continue
        same_length = remaining[lengths[remaining] == len(template)]
        if len(batches) >= MOST_LAYOUTS:
            same_length = remaining[:1]
        if isinstance(payloads, np.ndarray):
            rows = payloads if same_length.size == len(payloads) else payloads[same_length]
        else:
            joined = b"".join([payloads[index] for index in same_length])
            rows = np.frombuffer(joined, np.uint8).reshape(same_length.size, len(template))
        matches = (rows[:, layout.fixed] == rows[0, layout.fixed]).all(axis=1)
        members = same_length
        if not matches.all():
            members, rows = same_length[matches], rows[matches]
        batches.append(Batch(members, layout.like, layout.columns(rows)))
        if members.size == len(payloads):
            break
        remaining = (
            remaining[1:]
            if members.size == 1
            else remaining[~np.isin(remaining, members, assume_unique=True)]
        )
    return batches, undecodable
