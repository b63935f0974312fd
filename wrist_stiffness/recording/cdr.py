"""CDR, the bytes of a ROS 2 message (OMG CDR version 1, as Fast DDS and rosbag2 write it).

Four bytes of encapsulation (``00 01 00 00`` little endian, ``00 00 00 00`` big endian), then the
fields one after another.  A primitive of n bytes starts at a multiple of n counted from behind the
encapsulation.  Strings are a 32-bit length that counts the closing zero, then UTF-8; sequences are
a 32-bit count, then the elements; an empty sequence is not followed by padding.

Here is one message at a time, field by field.  The messages of a stream differ in their numbers
only: `fixed_layout` reads and writes those many times as fast, from the places that decoding one of
them notes (`bench/recording_speed.py`).
"""

from __future__ import annotations

import struct
from collections.abc import Generator
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.messages import MESSAGE_TYPES, Message
from wrist_stiffness.recording.schema import PRIMITIVES, SECONDS_NANOSECONDS, fields_of

AnyMessage = TypeVar("AnyMessage", bound=Message)
Result = TypeVar("Result")

ENCAPSULATION_SIZE = 4
_LITTLE_ENDIAN, _BIG_ENDIAN = b"\x00\x01", b"\x00\x00"
_NANOSECONDS = 1_000_000_000

ByteOrder = Literal["<", ">"]


def encode(message: Message) -> bytes:
    """Return a message as little-endian CDR.

    `message`: any class of `wrist_stiffness.recording.messages`; sequences may be NumPy arrays.
    Gives the payload that ``rclpy.serialization.serialize_message`` gives, with zeros for padding:
    Fast CDR leaves those bytes undefined.  Raises `RecordingError` if a field holds something that
    its type cannot hold.
    """
    return result_of(encode_in_steps(message))


def decode(message_type: type[AnyMessage], payload: bytes) -> AnyMessage:
    """Return the message in a CDR payload of either byte order.

    `payload`: encapsulation and body; bytes behind the last field are ignored, because
    ``rclpy.serialization.serialize_message`` leaves some there behind empty sequences.  Raises
    `RecordingError` if the payload is cut, of another encapsulation or holds invalid text.
    """
    return result_of(decode_in_steps(message_type, payload))


def encode_in_steps(message: Message) -> Generator[None, None, bytes]:
    """Do as `encode`, one element of the message's own sequences of parts at a step."""
    out = bytearray()
    try:
        yield from _write_message(out, message)
    except (struct.error, AttributeError, TypeError, ValueError) as error:
        raise RecordingError(f"{message.ros_type} cannot be encoded: {error}") from error
    return _LITTLE_ENDIAN + b"\x00\x00" + bytes(out)


def decode_in_steps(
    message_type: type[AnyMessage], payload: bytes
) -> Generator[None, None, AnyMessage]:
    """Do as `decode`, one element of the message's own sequences of parts at a step."""
    return Decoding(message_type, payload).message()


def result_of(steps: Generator[None, None, Result]) -> Result:
    """Go through all steps at once."""
    while True:
        try:
            next(steps)
        except StopIteration as done:
            result: Result = done.value
            return result


class Leaf(NamedTuple):
    """A number, a time or a run of numbers in a payload."""

    path: str  # dotted, of attributes and positions
    element: str  # type
    begin: int  # its first byte
    length: int | None  # of a run; None for a single number


class Decoding(Generic[AnyMessage]):
    """Goes through a payload from field to field, and notes where its numbers are.

    Raises `RecordingError` if the payload is shorter than an encapsulation or is not plain CDR.
    """

    def __init__(self, message_type: type[AnyMessage], payload: bytes) -> None:
        orders: dict[bytes, ByteOrder] = {_LITTLE_ENDIAN: "<", _BIG_ENDIAN: ">"}
        if len(payload) < ENCAPSULATION_SIZE or payload[:2] not in orders:
            raise RecordingError(
                f"{message_type.ros_type}: encapsulation {payload[:4].hex(' ') or 'missing'} is "
                "not plain CDR (00 00 or 00 01)"
            )
        self.byte_order = orders[payload[:2]]
        self.leaves: list[Leaf] = []  # in the order of the wire
        # Of the bytes that are no numbers: encapsulation, texts, lengths.
        self.fixed = [slice(0, ENCAPSULATION_SIZE)]
        self._message_type = message_type
        self._payload = payload
        self._at = ENCAPSULATION_SIZE

    def message(self) -> Generator[None, None, AnyMessage]:
        """Return the message (see `decode_in_steps`)."""
        ros_type = self._message_type.ros_type
        try:
            found: AnyMessage = yield from self._message(ros_type, "")
        except (struct.error, UnicodeDecodeError) as error:
            raise RecordingError(
                f"{ros_type}: payload of {len(self._payload)} bytes cannot be decoded: {error}"
            ) from error
        return found

    def _message(self, ros_type: str, prefix: str) -> Generator[None, None, Any]:
        values: list[Any] = []
        for field in fields_of(ros_type):
            path = prefix + field.attribute
            if not field.is_sequence and not field.count:
                values.append(self._element(field.element, path))
                continue
            count = self._length() if field.is_sequence else field.count
            if field.element in PRIMITIVES:
                values.append(self._numbers(field.element, path, count) if count else ())
                continue
            items = []
            for position in range(count):
                items.append(self._element(field.element, f"{path}.{position}"))
                yield
            values.append(tuple(items))
        return MESSAGE_TYPES[ros_type](*values)

    def _element(self, element: str, path: str) -> Any:
        if element in PRIMITIVES:
            return self._numbers(element, path, None)[0]
        if element in SECONDS_NANOSECONDS:
            self._at += -self._at % 4
            self.leaves.append(Leaf(path, element, self._at, None))
            seconds, nanoseconds = self._unpacked("iI", 8)
            return seconds * _NANOSECONDS + nanoseconds
        if element == "string":
            return self._text()
        return result_of(self._message(element, f"{path}."))

    def _text(self) -> str:
        size = self._length()
        begin, end = self._at, self._at + size
        if end > len(self._payload):
            raise struct.error(f"a string of {size} bytes at byte {begin} exceeds the payload")
        self.fixed.append(slice(begin, end))
        self._at = end
        # Some senders write an empty string without its closing zero.
        return self._payload[begin : max(begin, end - 1)].decode()

    def _length(self) -> int:
        self._at += -self._at % 4
        self.fixed.append(slice(self._at, self._at + 4))
        length: int = self._unpacked("I", 4)[0]
        return length

    def _numbers(self, element: str, path: str, length: int | None) -> tuple[Any, ...]:
        format_, size, _ = PRIMITIVES[element]
        self._at += (ENCAPSULATION_SIZE - self._at) % size
        self.leaves.append(Leaf(path, element, self._at, length))
        count = length or 1
        return self._unpacked(f"{count}{format_}", count * size)

    def _unpacked(self, format_: str, size: int) -> tuple[Any, ...]:
        numbers = struct.unpack_from(self.byte_order + format_, self._payload, self._at)
        self._at += size
        return numbers


def _write_message(out: bytearray, message: Message) -> Generator[None, None, None]:
    for field in fields_of(message.ros_type):
        value = getattr(message, field.attribute)
        if not field.is_sequence and not field.count:
            _write_element(out, field.element, value)
            continue
        if isinstance(value, str):
            raise TypeError(f"field {field.name} takes a sequence, not the text {value!r}")
        if field.is_sequence:
            _pack(out, "uint32", len(value))
        elif len(value) != field.count:
            raise ValueError(f"field {field.name} has {len(value)} elements, not {field.count}")
        if field.element in PRIMITIVES:
            if len(value):
                _pack(out, field.element, *value)
            continue
        for item in value:
            _write_element(out, field.element, item)
            yield


def _write_element(out: bytearray, element: str, value: Any) -> None:
    if element in PRIMITIVES:
        _pack(out, element, value)
    elif element in SECONDS_NANOSECONDS:
        seconds, nanoseconds = divmod(value, _NANOSECONDS)
        _pack(out, "int32", seconds)
        _pack(out, "uint32", nanoseconds)
    elif element == "string":
        text = value.encode() + b"\x00"
        _pack(out, "uint32", len(text))
        out += text
    elif isinstance(value, MESSAGE_TYPES[element]):
        result_of(_write_message(out, value))
    else:
        raise TypeError(f"{type(value).__name__} where {element} is expected")


def _pack(out: bytearray, element: str, *numbers: Any) -> None:
    primitive = PRIMITIVES[element]
    out += bytes(-len(out) % primitive.size)
    out += struct.pack(f"<{len(numbers)}{primitive.format}", *numbers)
