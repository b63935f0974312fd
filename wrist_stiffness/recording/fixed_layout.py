"""Payloads of one message type that differ in their numbers only, one at a time.

The messages of a stream keep their names, frame and lengths, so each number stays at its byte.  One
compiled `struct` then reads or writes all of them, and one comparison tells whether the rest of a
payload is as expected.  `batch` does the same for many payloads at once.
"""

from __future__ import annotations

import struct
from collections import deque
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.batch import layout_of
from wrist_stiffness.recording.cdr import (
    ENCAPSULATION_SIZE,
    PRIMITIVES,
    AnyMessage,
    decode,
    encode,
)
from wrist_stiffness.recording.messages import Message
from wrist_stiffness.recording.schema import SECONDS_NANOSECONDS, fields_of


class FixedLayout:
    """Where the numbers of a payload are, and all the bytes that are none.

    Numbers come in the order of the wire; a time is two of them, seconds and nanoseconds.

    `payload`: a CDR payload that `cdr.decode` accepts, in either byte order.
    """

    def __init__(self, message_type: type[Message], payload: bytes) -> None:
        self._layout = layout = layout_of(message_type, payload)
        self._ros_type = message_type.ros_type
        self._size = len(payload)
        # As one long integer: no other comparison of bytes here and there is as quick.
        self._mask = _integer(np.where(layout.fixed, 0xFF, 0).astype(np.uint8).tobytes())
        self._fixed = _integer(payload) & self._mask
        format_, end = str(layout.byte_order), 0
        for leaf in layout.leaves:
            begin = ENCAPSULATION_SIZE + leaf.offset
            of_time = leaf.element in SECONDS_NANOSECONDS
            code = _TIME if of_time else f"{leaf.count or 1}{PRIMITIVES[leaf.element].format}"
            format_ += f"{begin - end}x{code}"
            end = begin + struct.calcsize(layout.byte_order + code)
        self._struct = struct.Struct(f"{format_}{self._size - end}x")

    @classmethod
    def of(cls, message: Message) -> FixedLayout:
        """Return the little-endian layout of messages like this one."""
        return cls(type(message), encode(message))

    def rows(self, *columns: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the payloads of n messages, (n, size), with zeros for padding.

        `columns` (n,) or (n, k) arrays: one for each number, time [ns] and run of numbers, in the
        order of the wire.
        """
        n = len(columns[0])
        fixed = np.frombuffer(self._fixed.to_bytes(self._size, "little"), np.uint8)
        out = np.broadcast_to(fixed, (n, self._size)).copy()
        for leaf, column in zip(self._layout.leaves, columns, strict=True):
            self._layout.write(out, leaf, column)
        return out

    def matches(self, payload: bytes) -> bool:
        """Tell whether a payload differs from the first one in numbers and padding only."""
        return len(payload) == self._size and _integer(payload) & self._mask == self._fixed

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
            raise RecordingError(f"{self._ros_type} cannot be encoded: {error}") from error
        return (_integer(packed) | self._fixed).to_bytes(self._size, "little")


class FixedReader(Generic[AnyMessage]):
    """Reads the payloads of one topic."""

    LAYOUTS = 8
    """So many senders or frames may take turns on a topic without being laid out anew."""

    def __init__(self, message_type: type[AnyMessage]) -> None:
        self._message_type = message_type
        self._known: deque[tuple[FixedLayout, AnyMessage]] = deque(maxlen=self.LAYOUTS)

    def read(self, payload: bytes) -> tuple[AnyMessage, tuple[float, ...]]:
        """Take a payload apart.

        `payload`: CDR of either byte order.  Gives `like`: with this payload's texts and lengths,
        but maybe with other numbers, and `numbers`: of this payload (see `FixedLayout`).  Raises
        `RecordingError` if the payload cannot be decoded.
        """
        for layout, like in self._known:
            if layout.matches(payload):
                return like, layout.numbers(payload)
        like = decode(self._message_type, payload)
        layout = FixedLayout(self._message_type, payload)
        self._known.append((layout, like))
        return like, layout.numbers(payload)


def _integer(payload: bytes) -> int:
    return int.from_bytes(payload, "little")


_TIME = "".join(PRIMITIVES[item.element].format for item in fields_of(SECONDS_NANOSECONDS[0]))
