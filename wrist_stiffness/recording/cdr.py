"""CDR, the bytes of a ROS 2 message (OMG CDR version 1, as Fast DDS and rosbag2 write it).

Four bytes of encapsulation (``00 01 00 00`` little endian, ``00 00 00 00`` big endian), then the
fields one after another.  A primitive of n bytes starts at a multiple of n counted from behind the
encapsulation.  Strings are a 32-bit length that counts the closing zero, then UTF-8; sequences are
a 32-bit count, then the elements; an empty sequence is not followed by padding.

For each type two functions are written as a dataclass writes its own: straight lines that read, or
write, all fields of the message and of its parts.

No library does it here: mcap-ros2-support, which needs mcap alone, takes 1.4 to 4 times as long
to decode and 4 to 14 times to encode.  rosbags takes 1.0 to 1.2 times as long to decode, but into
classes of its own: as the messages that all else works with, those of a stream take 1.6 to 1.8
times; and 1.0 to 2.0 times to encode (`bench/recording_speed.py`).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Generator, Iterator
from functools import cache, partial
from itertools import groupby
from typing import Any, Literal, TypeVar

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.messages import MESSAGE_TYPES, Message
from wrist_stiffness.recording.schema import Field, fields_of

AnyMessage = TypeVar("AnyMessage", bound=Message)

LITTLE_ENDIAN = b"\x00\x01"
BIG_ENDIAN = b"\x00\x00"
ENCAPSULATION_SIZE = 4
PRIMITIVES = {
    "bool": struct.Struct("?"),
    "byte": struct.Struct("B"),
    "uint8": struct.Struct("B"),
    "int32": struct.Struct("i"),
    "uint32": struct.Struct("I"),
    "float32": struct.Struct("f"),
    "float64": struct.Struct("d"),
}
_NANOSECONDS = 1_000_000_000
_UNSIGNED, _TIME = struct.Struct("<I").pack, struct.Struct("<iI").pack

ByteOrder = Literal["<", ">"]

Entry = tuple[str, Field]
"""A field, and the attributes that lead to it."""
Unpack = Callable[[bytes, int], tuple[Any, ...]]
Reader = Callable[[bytes, int], tuple[Any, int]]
Writer = Callable[[bytearray, Any], None]


def encode(message: Message) -> bytes:
    """Return a message as little-endian CDR.

    `message`: any class of `wrist_stiffness.recording.messages`; sequences may be NumPy arrays.
    Gives the payload that ``rclpy.serialization.serialize_message`` gives, with zeros for padding:
    Fast CDR leaves those bytes undefined.  Raises `RecordingError` if a field holds something that
    its type cannot hold.
    """
    out = bytearray()
    try:
        _writer(message.ros_type)(out, message)
    except (struct.error, AttributeError, TypeError, ValueError) as error:
        raise RecordingError(f"{message.ros_type} cannot be encoded: {error}") from error
    return LITTLE_ENDIAN + b"\x00\x00" + bytes(out)


def decode(message_type: type[AnyMessage], payload: bytes) -> AnyMessage:
    """Return the message in a CDR payload of either byte order.

    `payload`: encapsulation and body; bytes behind the last field are ignored, because
    ``rclpy.serialization.serialize_message`` leaves some there behind empty sequences.  Raises
    `RecordingError` if the payload is cut, of another encapsulation or holds invalid text.
    """
    byte_order = byte_order_of(message_type, payload)
    body = payload[ENCAPSULATION_SIZE:]
    try:
        return _reader(message_type.ros_type, byte_order)(body, 0)[0]
    except (struct.error, UnicodeDecodeError) as error:
        raise RecordingError(
            f"{message_type.ros_type}: payload of {len(payload)} bytes cannot be decoded: {error}"
        ) from error


def decode_in_steps(
    message_type: type[AnyMessage], payload: bytes
) -> Generator[None, None, AnyMessage]:
    """Do as `decode` for a type of parts and sequences of parts, one of the latter at a step."""
    order = byte_order_of(message_type, payload)
    body, at = payload[ENCAPSULATION_SIZE:], 0
    unsigned = struct.Struct(order + "I").unpack_from
    found = []
    try:
        for field in fields_of(message_type.ros_type):
            is_text = field.element == "string"
            element = partial(_read_string, unsigned) if is_text else _reader(field.element, order)
            count, items = 1, []
            if field.is_sequence:
                at += -at % 4
                (count,) = unsigned(body, at)
                at += 4
            for _ in range(count):
                item, at = element(body, at)
                items.append(item)
                yield
            found.append(tuple(items) if field.is_sequence else items[0])
    except (struct.error, UnicodeDecodeError) as error:
        raise RecordingError(
            f"{message_type.ros_type}: payload of {len(payload)} bytes cannot be decoded: {error}"
        ) from error
    return message_type(*found)


def encode_in_steps(message: Message) -> Generator[None, None, bytes]:
    """Do as `encode` for a type of parts and sequences of parts, one of the latter at a step."""
    out = bytearray()
    try:
        for field in fields_of(message.ros_type):
            value = getattr(message, field.attribute)
            write: Writer = _write_string if field.element == "string" else _writer(field.element)
            if field.is_sequence:
                out += bytes(-len(out) % 4) + _UNSIGNED(len(value))
            for item in value if field.is_sequence else (value,):
                write(out, item)
                yield
    except (struct.error, AttributeError, TypeError, ValueError) as error:
        raise RecordingError(f"{message.ros_type} cannot be encoded: {error}") from error
    return LITTLE_ENDIAN + b"\x00\x00" + bytes(out)


def byte_order_of(message_type: type[Message], payload: bytes) -> ByteOrder:
    """Return the byte order that the encapsulation states, as `struct` writes it.

    `message_type`: class of the message, for the error's text.  Gives ``<`` or ``>``.  Raises
    `RecordingError` if the payload is shorter than an encapsulation or is not plain CDR.
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


@cache
def _entries(ros_type: str, path: str = "m") -> tuple[Entry, ...]:
    """Return the fields of a type and of its parts, in the order of the wire."""
    found: list[Entry] = []
    for field in fields_of(ros_type):
        inner = f"{path}.{field.attribute}"
        found += _entries(field.element, inner) if _is_part(field) else [(inner, field)]
    return tuple(found)


def _is_part(field: Field) -> bool:
    return field.element in MESSAGE_TYPES and not (field.is_sequence or field.count)


def _runs(ros_type: str) -> Iterator[tuple[int, list[Entry]]]:
    """Split the fields into runs of single primitives of one width; 0 marks any other, alone."""

    def width(item: tuple[int, Entry]) -> tuple[int, int]:
        index, (_, field) = item
        single = field.element in PRIMITIVES and not field.is_sequence and not field.count
        return (PRIMITIVES[field.element].size, 0) if single else (0, index)

    for (size, _), items in groupby(enumerate(_entries(ros_type)), key=width):
        yield size, [entry for _, entry in items]


def _layout(run: list[Entry], order: ByteOrder) -> struct.Struct:
    return struct.Struct(order + "".join(PRIMITIVES[field.element].format for _, field in run))


def _compiled(lines: list[str], known: dict[str, Any]) -> Any:
    """Return the function `step` of these lines."""
    exec("\n    ".join(lines), known)
    return known["step"]


# Reading ------------------------------------------------------------------------------------------


@cache
def _reader(ros_type: str, order: ByteOrder) -> Reader:
    unsigned = struct.Struct(order + "I").unpack_from
    string = partial(_read_string, unsigned)
    known: dict[str, Any] = {"string": string, "times": struct.Struct(order + "iI").unpack_from}
    lines = ["def step(b, o):"]
    names = {path: f"v{number}" for number, (path, _) in enumerate(_entries(ros_type))}
    for size, run in _runs(ros_type):
        path, field = run[0]
        name = names[path]
        if size:
            layout = _layout(run, order)
            known[f"s{name}"] = layout.unpack_from
            values = ", ".join(names[path] for path, _ in run)
            lines += [f"o += -o % {size}", f"{values}, = s{name}(b, o)", f"o += {layout.size}"]
        elif field.element in PRIMITIVES:
            known[f"s{name}"] = partial(_read_numbers, unsigned, order, field)
            lines.append(f"{name}, o = s{name}(b, o)")
        elif field.is_sequence:
            element = string if field.element == "string" else _reader(field.element, order)
            known[f"s{name}"] = partial(_read_many, unsigned, element)
            lines.append(f"{name}, o = s{name}(b, o)")
        elif field.element == "string":
            lines.append(f"{name}, o = string(b, o)")
        else:
            lines += ["o += -o % 4", f"{name}, n = times(b, o)", "o += 8"]
            lines.append(f"{name} = {name} * {_NANOSECONDS} + n")
    lines.append(f"return {_made(ros_type, 'm', names, known)}, o")
    return _compiled(lines, known)


def _made(ros_type: str, path: str, names: dict[str, str], known: dict[str, Any]) -> str:
    """Return the expression that makes a message of the values read."""
    own = ros_type.rpartition("/")[2]
    known[own] = MESSAGE_TYPES[ros_type]
    parts = [
        _made(field.element, f"{path}.{field.attribute}", names, known)
        if _is_part(field)
        else names[f"{path}.{field.attribute}"]
        for field in fields_of(ros_type)
    ]
    return f"{own}({', '.join(parts)})"


def _read_string(unsigned: Unpack, body: bytes, offset: int) -> tuple[str, int]:
    offset += -offset % 4
    (size,) = unsigned(body, offset)
    offset += 4
    end = offset + size
    if end > len(body):
        raise struct.error(f"a string of {size} bytes at byte {offset} exceeds the payload")
    # Some senders write an empty string without its closing zero.
    return body[offset : max(offset, end - 1)].decode(), end


def _read_numbers(
    unsigned: Unpack, order: ByteOrder, field: Field, body: bytes, offset: int
) -> tuple[tuple[Any, ...], int]:
    primitive, count = PRIMITIVES[field.element], field.count
    if field.is_sequence:
        offset += -offset % 4
        (count,) = unsigned(body, offset)
        offset += 4
        if not count:
            return (), offset
    offset += -offset % primitive.size
    values = struct.unpack_from(f"{order}{count}{primitive.format}", body, offset)
    return values, offset + count * primitive.size


def _read_many(
    unsigned: Unpack, element: Reader, body: bytes, offset: int
) -> tuple[tuple[Any, ...], int]:
    offset += -offset % 4
    (count,) = unsigned(body, offset)
    offset += 4
    items = []
    for _ in range(count):
        item, offset = element(body, offset)
        items.append(item)
    return tuple(items), offset


# Writing ------------------------------------------------------------------------------------------


@cache
def _writer(ros_type: str) -> Writer:
    known: dict[str, Any] = {"string": _write_string, "time": _write_time}
    lines = ["def step(out, m):"]
    for number, (size, run) in enumerate(_runs(ros_type)):
        path, field = run[0]
        if size:
            known[f"s{number}"] = _layout(run, "<").pack
            values = ", ".join(path for path, _ in run)
            lines.append(f"out += bytes(-len(out) % {size}) + s{number}({values})")
        elif field.is_sequence or field.count:
            write = _write_numbers if field.element in PRIMITIVES else _write_many
            known[f"s{number}"] = partial(write, field)
            lines.append(f"s{number}(out, {path})")
        else:
            lines.append(f"{'string' if field.element == 'string' else 'time'}(out, {path})")
    return _compiled(lines, known)


def _write_string(out: bytearray, text: str) -> None:
    data = text.encode()
    out += bytes(-len(out) % 4) + _UNSIGNED(len(data) + 1) + data + b"\x00"


def _write_time(out: bytearray, time_ns: int) -> None:
    out += bytes(-len(out) % 4) + _TIME(*divmod(time_ns, _NANOSECONDS))


def _write_numbers(field: Field, out: bytearray, values: Any) -> None:
    primitive = PRIMITIVES[field.element]
    if field.is_sequence:
        out += bytes(-len(out) % 4) + _UNSIGNED(len(values))
    elif len(values) != field.count:
        raise ValueError(f"field {field.name} has {len(values)} elements, not {field.count}")
    if len(values):
        out += bytes(-len(out) % primitive.size)
        out += struct.pack(f"<{len(values)}{primitive.format}", *values)


def _write_many(field: Field, out: bytearray, values: Any) -> None:
    if isinstance(values, str):
        raise TypeError(f"field {field.name} takes a sequence, not the text {values!r}")
    out += bytes(-len(out) % 4) + _UNSIGNED(len(values))
    kind = str if field.element == "string" else MESSAGE_TYPES[field.element]
    write: Writer = _write_string if kind is str else _writer(field.element)
    for value in values:
        if not isinstance(value, kind):
            raise TypeError(f"{type(value).__name__} where {field.element} is expected")
        write(out, value)
