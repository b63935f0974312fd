"""CDR, the bytes of a ROS 2 message (OMG CDR version 1, as Fast DDS and rosbag2 write it).

Four bytes of encapsulation (``00 01 00 00`` little endian, ``00 00 00 00`` big endian), then the
fields one after another.  A primitive of n bytes starts at a multiple of n counted from behind the
encapsulation.  Strings are a 32-bit length that counts the closing zero, then UTF-8; sequences are
a 32-bit count, then the elements; an empty sequence is not followed by padding.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import groupby
from typing import Any, Literal, TypeVar

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.messages import MESSAGE_TYPES, Message
from wrist_stiffness.recording.schema import SECONDS_NANOSECONDS, Field, fields_of

AnyMessage = TypeVar("AnyMessage", bound=Message)

LITTLE_ENDIAN = b"\x00\x01"
BIG_ENDIAN = b"\x00\x00"
ENCAPSULATION_SIZE = 4
PRIMITIVES = {
    "bool": struct.Struct("?"),
    "byte": struct.Struct("B"),
    "int32": struct.Struct("i"),
    "uint32": struct.Struct("I"),
    "float64": struct.Struct("d"),
}
_NANOSECONDS = 1_000_000_000

ByteOrder = Literal["<", ">"]

# A step reads or writes one field, or a run of equally wide primitives that need no padding.
ReadStep = Callable[[bytes, int, list[Any]], int]
WriteStep = Callable[[bytearray, Any], None]


def encode(message: Message) -> bytes:
    """Return a message as little-endian CDR.

    Parameters
    ----------
    message : Message
        Any class of `wrist_stiffness.recording.messages`; sequences may be NumPy arrays.

    Returns
    -------
    bytes
        The payload that ``rclpy.serialization.serialize_message`` gives, with zeros for padding:
        Fast CDR leaves those bytes undefined.

    Raises
    ------
    RecordingError
        If a field holds something that its type cannot hold.
    """
    out = bytearray()
    try:
        for attributes, write in _write_steps(message.ros_type):
            write(out, [getattr(message, attribute) for attribute in attributes])
    except (struct.error, AttributeError, TypeError, ValueError) as error:
        raise RecordingError(f"{message.ros_type} cannot be encoded: {error}") from error
    return LITTLE_ENDIAN + b"\x00\x00" + bytes(out)


def decode(message_type: type[AnyMessage], payload: bytes) -> AnyMessage:
    """Return the message in a CDR payload of either byte order.

    Parameters
    ----------
    message_type : type[AnyMessage]
        Class of the message.
    payload : bytes
        Encapsulation and body; bytes behind the last field are ignored, because
        ``rclpy.serialization.serialize_message`` leaves some there behind empty sequences.

    Returns
    -------
    AnyMessage
        The message.

    Raises
    ------
    RecordingError
        If the payload is cut, of another encapsulation or holds invalid text.
    """
    byte_order = byte_order_of(message_type, payload)
    body = payload[ENCAPSULATION_SIZE:]
    values: list[Any] = []
    offset = 0
    try:
        for step in _read_steps(message_type.ros_type, byte_order):
            offset = step(body, offset, values)
    except (struct.error, UnicodeDecodeError) as error:
        raise RecordingError(
            f"{message_type.ros_type}: payload of {len(payload)} bytes cannot be decoded: {error}"
        ) from error
    return message_type(*values)


def byte_order_of(message_type: type[Message], payload: bytes) -> ByteOrder:
    """Return the byte order that the encapsulation states, as `struct` writes it.

    Parameters
    ----------
    message_type : type[Message]
        Class of the message, for the error's text.
    payload : bytes
        Encapsulation and body.

    Returns
    -------
    str
        ``<`` or ``>``.

    Raises
    ------
    RecordingError
        If the payload is shorter than an encapsulation or is not plain CDR.
    """
    if len(payload) >= ENCAPSULATION_SIZE:
        if payload[:2] == LITTLE_ENDIAN:
            return "<"
        if payload[:2] == BIG_ENDIAN:
            return ">"
    raise RecordingError(
        f"{message_type.ros_type}: encapsulation {payload[:4].hex(' ') or 'missing'} is not plain "
        "CDR (00 00 or 00 01)"
    )


def padding(offset: int, size: int) -> int:
    """Return the bytes between an offset in the body and the next multiple of `size`."""
    return -offset % size


def _runs(ros_type: str) -> Iterator[tuple[int, list[Field]]]:
    """Split the fields into runs of single primitives of one width; 0 marks any other field."""

    def width(item: tuple[int, Field]) -> tuple[int, int]:
        index, field = item
        single = field.element in PRIMITIVES and not field.is_sequence and not field.count
        return (PRIMITIVES[field.element].size, 0) if single else (0, index)

    for (size, _), items in groupby(enumerate(fields_of(ros_type)), key=width):
        yield size, [field for _, field in items]


# Reading ------------------------------------------------------------------------------------------


@cache
def _read_steps(ros_type: str, byte_order: str) -> tuple[ReadStep, ...]:
    return tuple(
        _read_run(run, size, byte_order) if size else _read_field(run[0], byte_order)
        for size, run in _runs(ros_type)
    )


def _read_run(run: list[Field], size: int, byte_order: str) -> ReadStep:
    layout = struct.Struct(byte_order + "".join(PRIMITIVES[item.element].format for item in run))

    def step(body: bytes, offset: int, values: list[Any]) -> int:
        offset += -offset % size
        values.extend(layout.unpack_from(body, offset))
        return offset + layout.size

    return step


def _read_field(field: Field, byte_order: str) -> ReadStep:
    if not field.is_sequence and not field.count:
        return _read_element(field.element, byte_order)
    if field.element in PRIMITIVES:
        return _read_primitives(field, byte_order)
    element = _read_element(field.element, byte_order)
    length = struct.Struct(byte_order + "I")

    def step(body: bytes, offset: int, values: list[Any]) -> int:
        offset += -offset % 4
        (count,) = length.unpack_from(body, offset)
        offset += 4
        items: list[Any] = []
        for _ in range(count):
            offset = element(body, offset, items)
        values.append(tuple(items))
        return offset

    return step


def _read_primitives(field: Field, byte_order: str) -> ReadStep:
    primitive = PRIMITIVES[field.element]
    length = struct.Struct(byte_order + "I")

    def step(body: bytes, offset: int, values: list[Any]) -> int:
        count = field.count
        if field.is_sequence:
            offset += -offset % 4
            (count,) = length.unpack_from(body, offset)
            offset += 4
            if not count:
                values.append(())
                return offset
        offset += -offset % primitive.size
        values.append(struct.unpack_from(f"{byte_order}{count}{primitive.format}", body, offset))
        return offset + count * primitive.size

    return step


def _read_element(element: str, byte_order: str) -> ReadStep:
    if element == "string":
        return _read_string(byte_order)
    if element in SECONDS_NANOSECONDS:
        return _read_time(byte_order)
    message_type = MESSAGE_TYPES[element]
    steps = _read_steps(element, byte_order)

    def step(body: bytes, offset: int, values: list[Any]) -> int:
        inner: list[Any] = []
        for inner_step in steps:
            offset = inner_step(body, offset, inner)
        values.append(message_type(*inner))
        return offset

    return step


def _read_string(byte_order: str) -> ReadStep:
    length = struct.Struct(byte_order + "I")

    def step(body: bytes, offset: int, values: list[Any]) -> int:
        offset += -offset % 4
        (size,) = length.unpack_from(body, offset)
        offset += 4
        end = offset + size
        if end > len(body):
            raise struct.error(f"a string of {size} bytes at byte {offset} exceeds the payload")
        # Some senders write an empty string without its closing zero.
        values.append(body[offset : max(offset, end - 1)].decode())
        return end

    return step


def _read_time(byte_order: str) -> ReadStep:
    layout = struct.Struct(byte_order + "iI")

    def step(body: bytes, offset: int, values: list[Any]) -> int:
        offset += -offset % 4
        seconds, nanoseconds = layout.unpack_from(body, offset)
        values.append(seconds * _NANOSECONDS + nanoseconds)
        return offset + 8

    return step


# Writing ------------------------------------------------------------------------------------------


@cache
def _write_steps(ros_type: str) -> tuple[tuple[list[str], WriteStep], ...]:
    return tuple(
        (
            [item.attribute for item in run],
            _write_run(run, size) if size else _write_field(run[0]),
        )
        for size, run in _runs(ros_type)
    )


def _write_run(run: list[Field], size: int) -> WriteStep:
    layout = struct.Struct("<" + "".join(PRIMITIVES[item.element].format for item in run))

    def write(out: bytearray, values: Sequence[Any]) -> None:
        out += bytes(-len(out) % size) + layout.pack(*values)

    return write


def _write_field(field: Field) -> WriteStep:
    if field.is_sequence or field.count:
        is_primitive = field.element in PRIMITIVES
        write_all = _write_primitives(field) if is_primitive else _write_elements(field)
    else:
        write_all = _write_element(field.element)

    def write(out: bytearray, values: Sequence[Any]) -> None:
        write_all(out, values[0])

    return write


def _write_elements(field: Field) -> WriteStep:
    element = _write_element(field.element)

    def write(out: bytearray, values: Sequence[Any]) -> None:
        if isinstance(values, str):
            raise TypeError(f"field {field.name} takes a sequence, not the text {values!r}")
        out += bytes(-len(out) % 4) + struct.pack("<I", len(values))
        for value in values:
            element(out, value)

    return write


def _write_primitives(field: Field) -> WriteStep:
    primitive = PRIMITIVES[field.element]

    def write(out: bytearray, values: Sequence[Any]) -> None:
        if field.is_sequence:
            out += bytes(-len(out) % 4) + struct.pack("<I", len(values))
        elif len(values) != field.count:
            raise ValueError(f"field {field.name} has {len(values)} elements, not {field.count}")
        if len(values):
            out += bytes(-len(out) % primitive.size)
            out += struct.pack(f"<{len(values)}{primitive.format}", *values)

    return write


def _write_element(element: str) -> WriteStep:
    if element == "string":
        return _write_string
    if element in SECONDS_NANOSECONDS:
        return _write_time
    message_type = MESSAGE_TYPES[element]
    steps = _write_steps(element)

    def write(out: bytearray, message: Any) -> None:
        if not isinstance(message, message_type):
            raise TypeError(f"{type(message).__name__} where {message_type.ros_type} is expected")
        for attributes, inner in steps:
            inner(out, [getattr(message, attribute) for attribute in attributes])

    return write


def _write_string(out: bytearray, text: str) -> None:
    data = text.encode()
    out += bytes(-len(out) % 4) + struct.pack("<I", len(data) + 1) + data + b"\x00"


def _write_time(out: bytearray, time_ns: int) -> None:
    out += bytes(-len(out) % 4) + struct.pack("<iI", *divmod(time_ns, _NANOSECONDS))
