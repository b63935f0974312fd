"""Decoding of many payloads of one message type at once.

The messages of a topic mostly differ in their numbers only: names, frame and the lengths of their
sequences stay.  Then each number sits at the same byte in every payload, and NumPy reads a whole
column.  Payloads that differ in more form groups of their own, down to a group of one.  Joint
states come as arrays eleven times as fast as one by one, sixteen times as fast as from rosbags
(`bench/recording_speed.py`).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.cdr import (
    ENCAPSULATION_SIZE,
    PRIMITIVES,
    ByteOrder,
    byte_order_of,
    decode,
    padding,
)
from wrist_stiffness.recording.mcap_chunk import Payloads
from wrist_stiffness.recording.messages import Message
from wrist_stiffness.recording.schema import SECONDS_NANOSECONDS, fields_of

# More layouts than this in one call gain nothing from columns.
_MAX_LAYOUTS = 8


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
            first = decode(message_type, template)
        except RecordingError:
            undecodable.append(int(remaining[0]))
            remaining = remaining[1:]
            continue
        layout = layout_of(message_type, template)
        same_length = remaining[lengths[remaining] == len(template)]
        if len(batches) >= _MAX_LAYOUTS:
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
        batches.append(Batch(members, first, layout.columns(rows)))
        if members.size == len(payloads):
            break
        remaining = (
            remaining[1:]
            if members.size == 1
            else remaining[~np.isin(remaining, members, assume_unique=True)]
        )
    return batches, undecodable


@dataclass(frozen=True)
class Leaf:
    """A number, a time or a run of numbers: dotted path, type, byte in the body, how many."""

    path: str
    element: str
    offset: int
    count: int | None


class Layout:
    """Where the numbers are in a payload, and which bytes say that they are there.

    `byte_order`: ``<`` or ``>``; `size`: of the payload.
    """

    def __init__(self, byte_order: ByteOrder, size: int):
        self.byte_order = byte_order
        # (size,) array, bytes of the encapsulation, of texts and of lengths; the others are numbers
        # or padding
        self.fixed = np.zeros(size, dtype=bool)
        self.fixed[:ENCAPSULATION_SIZE] = True
        self.leaves: list[Leaf] = []  # the numbers in the order of the wire

    def columns(self, rows: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
        """Return the numbers of payloads (m, size) by path."""
        return {leaf.path: self._column(rows, leaf) for leaf in self.leaves}

    def _column(self, rows: NDArray[np.uint8], leaf: Leaf) -> NDArray[Any]:
        if leaf.element in SECONDS_NANOSECONDS:
            seconds = self._numbers(rows, leaf.offset, "i", 4, 1)[:, 0].astype(np.int64)
            nanoseconds = self._numbers(rows, leaf.offset + 4, "I", 4, 1)[:, 0]
            return seconds * 1_000_000_000 + nanoseconds
        primitive = PRIMITIVES[leaf.element]
        numbers = self._numbers(
            rows, leaf.offset, primitive.format, primitive.size, leaf.count or 1
        )
        return numbers[:, 0] if leaf.count is None else numbers

    def write(self, rows: NDArray[np.uint8], leaf: Leaf, column: NDArray[Any]) -> None:
        """Write numbers (m,) or (m, k), or times (m,) [ns], into payloads (m, size)."""
        begin = ENCAPSULATION_SIZE + leaf.offset
        if leaf.element in SECONDS_NANOSECONDS:
            parts = [(column // 1_000_000_000, "i"), (column % 1_000_000_000, "I")]
        else:
            parts = [(column, PRIMITIVES[leaf.element].format)]
        for numbers, code in parts:
            kind = np.dtype(code).newbyteorder(self.byte_order)
            columns = numbers if numbers.ndim == 2 else numbers[:, None]
            raw = np.ascontiguousarray(columns, dtype=kind).view(np.uint8)
            rows[:, begin : begin + raw.shape[1]] = raw
            begin += raw.shape[1]

    def _numbers(
        self, rows: NDArray[np.uint8], offset: int, code: str, size: int, count: int
    ) -> NDArray[Any]:
        begin = ENCAPSULATION_SIZE + offset
        stored = np.ascontiguousarray(rows[:, begin : begin + size * count])
        numbers = stored.view(np.dtype(code).newbyteorder(self.byte_order))
        return numbers.astype(numbers.dtype.newbyteorder("="), copy=False)


def layout_of(message_type: type[Message], payload: bytes) -> Layout:
    """Return the layout of a payload that `decode` accepts."""
    layout = Layout(byte_order_of(message_type, payload), len(payload))
    _add_message(layout, message_type.ros_type, payload[ENCAPSULATION_SIZE:], 0, "")
    return layout


def _add_message(layout: Layout, ros_type: str, body: bytes, offset: int, prefix: str) -> int:
    for field in fields_of(ros_type):
        path = prefix + field.attribute
        if not field.is_sequence and not field.count:
            offset = _add_element(layout, field.element, body, offset, path)
            continue
        count = field.count
        if field.is_sequence:
            count, offset = _add_length(layout, body, offset)
        if field.element not in PRIMITIVES:
            for position in range(count):
                offset = _add_element(layout, field.element, body, offset, f"{path}.{position}")
        elif count:
            size = PRIMITIVES[field.element].size
            offset += padding(offset, size)
            layout.leaves.append(Leaf(path, field.element, offset, count))
            offset += size * count
    return offset


def _add_element(layout: Layout, element: str, body: bytes, offset: int, path: str) -> int:
    if element == "string":
        length, offset = _add_length(layout, body, offset)
        begin = ENCAPSULATION_SIZE + offset
        layout.fixed[begin : begin + length] = True
        return offset + length
    if element in PRIMITIVES or element in SECONDS_NANOSECONDS:
        align, size = (4, 8) if element in SECONDS_NANOSECONDS else (PRIMITIVES[element].size,) * 2
        offset += padding(offset, align)
        layout.leaves.append(Leaf(path, element, offset, None))
        return offset + size
    return _add_message(layout, element, body, offset, path + ".")


def _add_length(layout: Layout, body: bytes, offset: int) -> tuple[int, int]:
    offset += padding(offset, 4)
    begin = ENCAPSULATION_SIZE + offset
    layout.fixed[begin : begin + 4] = True
    (length,) = struct.unpack_from(layout.byte_order + "I", body, offset)
    return length, offset + 4
