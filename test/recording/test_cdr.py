"""CDR against two implementations that nobody here wrote: rclpy (Fast CDR) and rosbags."""

import contextlib
import dataclasses
import importlib
import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.cdr import decode, encode
from wrist_stiffness.recording.fixed_layout import FixedLayout, FixedReader, decode_batches
from wrist_stiffness.recording.messages import (
    MESSAGE_TYPES,
    DiagnosticArray,
    Float64,
    Float64MultiArray,
    Header,
    JointState,
    JointTrajectory,
    Pose,
    PoseArray,
    PoseWithCovariance,
    String,
)
from wrist_stiffness.recording.schema import SECONDS_NANOSECONDS, fields_of

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
# The types that are a part of no other one: they hold all the others.
PARTS = {item.element for ros_type in MESSAGE_TYPES for item in fields_of(ros_type)}
BY_NAME = pytest.mark.parametrize("ros_type", sorted(MESSAGE_TYPES.keys() - PARTS))
FEW = settings(max_examples=12)

# Stamps fill int32 seconds; text without NUL, which ends a string in C, and without surrogates.
TIMES = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
ELEMENTS = {
    "bool": st.booleans(),
    # rosbags refuses bytes above 127.
    "byte": st.integers(0, 127),
    "uint8": st.integers(0, 255),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "float32": st.floats(width=32),
    "float64": st.floats(),
    "string": TEXTS,
    **dict.fromkeys(SECONDS_NANOSECONDS, TIMES),
}


def messages(ros_type):
    values = []
    for item in fields_of(ros_type):
        element = ELEMENTS[item.element] if item.element in ELEMENTS else messages(item.element)
        if item.is_sequence:
            element = st.lists(element, max_size=4).map(tuple)
        elif item.count:
            element = st.tuples(*[element] * item.count)
        values.append(element)
    return st.builds(MESSAGE_TYPES[ros_type], *values)


def foreign(message, make):
    """Rebuild a message from another package's classes: `make(ros_type, **fields)`."""

    def value_of(item, value):
        if item.element in SECONDS_NANOSECONDS:
            sec, nanosec = divmod(value, 10**9)
            return make(item.element, sec=sec, nanosec=nanosec)
        return foreign(value, make) if item.element in MESSAGE_TYPES else value

    fields = {}
    for item in fields_of(message.ros_type):
        value = getattr(message, item.attribute)
        if item.element in ("uint8", "float64") and (item.is_sequence or item.count):
            fields[item.name] = np.array(value, dtype=item.element)
        elif item.is_sequence:
            fields[item.name] = [value_of(item, element) for element in value]
        else:
            fields[item.name] = value_of(item, value)
    return make(message.ros_type, **fields)


def rosbags_message(ros_type, **fields):
    return TYPESTORE.types[ros_type](**fields)


def rclpy_message(ros_type, **fields):
    package, _, name = ros_type.split("/")
    if ros_type == "diagnostic_msgs/msg/DiagnosticStatus":
        fields["level"] = bytes([fields["level"]])
    return getattr(importlib.import_module(f"{package}.msg"), name)(**fields)


@BY_NAME
def test_round_trip_is_exact(ros_type):
    @FEW
    @given(messages(ros_type))
    def check(message):
        # The bytes are compared too: NaN is not equal to itself.
        decoded = decode(type(message), encode(message))
        assert encode(decoded) == encode(message)
        assert repr(decoded) == repr(message)

    check()


# The ROS packages' own imports warn.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@BY_NAME
def test_bytes_equal_those_of_rclpy_but_for_padding(ros_type):
    serialization = pytest.importorskip("rclpy.serialization")
    pytest.importorskip(f"{ros_type.split('/')[0]}.msg")

    @FEW
    @given(messages(ros_type))
    def check(message):
        original = foreign(message, rclpy_message)
        expected = serialization.serialize_message(original)
        ours = bytearray(encode(message))
        assert len(expected) >= len(ours)
        assert repr(decode(type(message), expected)) == repr(message)
        # Fast CDR leaves padding undefined: rclpy must not care for bytes that differ.
        for index, byte in enumerate(ours):
            if byte != expected[index]:
                assert byte == 0
                ours[index] = 0xFF
        restored = serialization.deserialize_message(bytes(ours), type(original))
        assert repr(restored) == repr(original)

    check()


@BY_NAME
@pytest.mark.parametrize("little_endian", [True, False], ids=["little", "big"])
def test_reads_what_rosbags_encodes(ros_type, little_endian):
    @FEW
    @given(messages(ros_type))
    def check(message):
        payload = bytes(
            TYPESTORE.serialize_cdr(
                foreign(message, rosbags_message), ros_type, little_endian=little_endian
            )
        )
        assert repr(decode(type(message), payload)) == repr(message)
        if little_endian:
            assert encode(message) == payload

    check()


def test_layout_of_a_joint_state_by_hand():
    message = JointState(Header(3_000_000_007, "ab"), ("m",), (1.5,), (), (2.5,))
    assert encode(message) == (
        b"\0\1\0\0"
        + struct.pack("<iI", 3, 7)
        + struct.pack("<I3s", 3, b"ab\0")
        + b"\0"  # 15 -> 16
        + struct.pack("<I", 1)
        + struct.pack("<I2s", 2, b"m\0")
        + b"\0\0"  # 26 -> 28
        + struct.pack("<I", 1)
        + struct.pack("<d", 1.5)  # 32
        + struct.pack("<I", 0)
        + struct.pack("<I", 1)
        + struct.pack("<d", 2.5)  # 48
    )


def test_numpy_arrays_are_encoded_like_tuples():
    numbers = (1.0, math.inf, -2.0)
    assert encode(Float64MultiArray(data=np.array(numbers))) == encode(
        Float64MultiArray(data=numbers)
    )


@BY_NAME
def test_every_cut_is_one_clear_error(ros_type):
    @settings(max_examples=5)
    @given(messages(ros_type))
    def check(message):
        payload = encode(message)
        for length in range(len(payload)):
            with pytest.raises(RecordingError, match=ros_type):
                decode(type(message), payload[:length])

    check()


@pytest.mark.parametrize("ros_type", [DiagnosticArray.ros_type, JointTrajectory.ros_type])
def test_random_bytes_never_escape_as_another_error(ros_type):
    @settings(max_examples=200)
    @given(st.binary(max_size=120))
    def check(noise):
        with contextlib.suppress(RecordingError):
            decode(MESSAGE_TYPES[ros_type], b"\0\1\0\0" + noise)

    check()


def test_bytes_behind_the_last_field_are_ignored_as_rclpy_leaves_them_there():
    payload = encode(String("abc"))
    for size in (1, 3, 16):
        assert decode(String, payload + b"\xff" * size) == String("abc")


def test_other_encapsulations_are_refused():
    with pytest.raises(RecordingError, match="07 00 00 00 is not plain CDR"):
        decode(Float64, b"\7\0\0\0" + bytes(8))


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Float64("warm"), "float"),
        (Header(2**31 * 10**9, ""), "format requires"),
        (Header(0.5, ""), "integer"),
        (String(None), "encode"),
        (String("\ud800"), "surrogate"),
        (PoseWithCovariance(Pose(), (0.0,) * 35), "35 elements, not 36"),
        (PoseArray(Header(), (Header(),)), "Header where geometry_msgs/msg/Pose is expected"),
        (JointState(name="motor"), "not the text 'motor'"),
    ],
    ids=lambda value: type(value).__name__ if dataclasses.is_dataclass(value) else None,
)
def test_values_that_do_not_fit_are_refused(message, reason):
    with pytest.raises(RecordingError, match=reason):
        encode(message)


def value_at(message, path):
    for part in path.split("."):
        message = message[int(part)] if part.isdigit() else getattr(message, part)
    return message


@BY_NAME
def test_batches_hold_exactly_the_values_of_decode(ros_type):
    message_type = MESSAGE_TYPES[ros_type]

    @FEW
    @given(st.lists(messages(ros_type), max_size=12), st.integers(1, 3))
    def check(several, repeats):
        payloads = [encode(message) for message in several] * repeats
        batches, undecodable = decode_batches(message_type, payloads)
        assert not undecodable
        assert sorted(np.concatenate([[], *(b.indices for b in batches)])) == [
            *range(len(payloads))
        ]
        for batch in batches:
            for row, index in enumerate(batch.indices):
                message = decode(message_type, payloads[index])
                # Texts and lengths come from the first message, numbers from the columns: put
                # together again they must give the very message.
                for path, column in batch.columns.items():
                    np.testing.assert_array_equal(column[row], value_at(message, path))
                assert structure(batch.first) == structure(message)

    check()


def structure(value):
    """Replace the numbers in a message by their type, so that texts and lengths remain."""
    if dataclasses.is_dataclass(value):
        return [structure(getattr(value, item.name)) for item in dataclasses.fields(value)]
    if isinstance(value, tuple):
        return [structure(item) for item in value]
    return value if isinstance(value, str) else type(value)


def test_equal_layouts_make_one_batch_and_bad_payloads_are_named():
    good = [encode(JointState(Header(i, "f"), ("a", "b"), (i, 2.0 * i))) for i in range(50)]
    payloads = [*good[:20], b"", *good[20:], good[0][:-1]]
    batches, undecodable = decode_batches(JointState, payloads)
    assert undecodable == [20, 51]
    (batch,) = batches
    assert batch.columns["position"].shape == (50, 2)
    np.testing.assert_array_equal(batch.columns["header.stamp_ns"], range(50))


def test_both_byte_orders_in_one_topic_form_two_batches():
    message = Float64(1.25)
    big = b"\0\0\0\0" + struct.pack(">d", 1.25)
    batches, _ = decode_batches(Float64, [encode(message), big, encode(message)])
    assert [batch.indices.tolist() for batch in batches] == [[0, 2], [1]]
    assert [batch.columns["data"][0] for batch in batches] == [1.25, 1.25]


def test_equal_sizes_with_other_lengths_inside_are_kept_apart():
    # Only the counts tell these two apart.
    first = JointState(position=(1.0, 2.0), velocity=(3.0,))
    second = JointState(position=(1.0,), velocity=(2.0, 3.0))
    assert len(encode(first)) == len(encode(second))
    batches, _ = decode_batches(JointState, [encode(first), encode(second)])
    assert [batch.first for batch in batches] == [first, second]


def numbers_of(value):
    """Return all numbers of a message in the order of the wire, a time as two of them."""
    if dataclasses.is_dataclass(value):
        found = []
        for item in fields_of(value.ros_type):
            part = getattr(value, item.attribute)
            of_time = item.element in SECONDS_NANOSECONDS
            found += divmod(part, 10**9) if of_time else numbers_of(part)
        return found
    if isinstance(value, tuple):
        return [number for item in value for number in numbers_of(item)]
    return [] if isinstance(value, str) else [value]


@BY_NAME
@pytest.mark.parametrize("little_endian", [True, False], ids=["little", "big"])
def test_a_reader_gives_the_texts_and_numbers_of_decode(ros_type, little_endian):
    message_type = MESSAGE_TYPES[ros_type]

    @FEW
    @given(st.lists(messages(ros_type), min_size=1, max_size=12), st.integers(1, 3))
    def check(several, repeats):
        reader = FixedReader(message_type)
        for message in several * repeats:
            original = foreign(message, rosbags_message)
            payload = TYPESTORE.serialize_cdr(original, ros_type, little_endian=little_endian)
            like, numbers = reader.read(bytes(payload))
            assert structure(like) == structure(message)
            np.testing.assert_array_equal(numbers, numbers_of(message))

    check()


@BY_NAME
def test_a_layout_writes_what_encode_writes(ros_type):
    @FEW
    @given(messages(ros_type), st.randoms(use_true_random=False))
    def check(message, random):
        layout = FixedLayout.of(message)
        assert layout.payload(*numbers_of(message)) == encode(message)
        other = [type(each)(random.getrandbits(7)) for each in numbers_of(message)]
        assert list(layout.numbers(layout.payload(*other))) == other
        assert layout.matches(layout.payload(*other))

    check()


@BY_NAME
def test_a_layout_matches_nothing_whose_texts_or_lengths_differ(ros_type):
    @FEW
    @given(messages(ros_type), messages(ros_type))
    def check(one, other):
        same = structure(one) == structure(other)
        assert FixedLayout.of(one).matches(encode(other)) == same

    check()


def test_a_payload_in_which_only_padding_differs_is_no_new_layout():
    payload = bytearray(encode(JointState(Header(1, "ab"), ("m",), (1.5,))))
    layout = FixedLayout(JointState, bytes(payload))
    assert payload[15 + 4] == 0
    payload[15 + 4] = 0xAA
    assert layout.matches(bytes(payload))


def test_senders_that_take_turns_are_laid_out_once_each():
    reader = FixedReader(JointState)
    payloads = [encode(JointState(Header(i, f"f{i % 8}"), ("a",), (float(i),))) for i in range(40)]
    firsts = {id(reader.read(payload)[0]) for payload in payloads}
    assert len(firsts) == FixedReader.LAYOUTS


@pytest.mark.parametrize("numbers", [(), (1, 2, 3.0, 4.0), (2**31, 0, 1.0), (0, 0, "x")], ids=str)
def test_numbers_that_do_not_fit_a_layout_are_refused(numbers):
    layout = FixedLayout.of(JointState(Header(0, "f"), ("m",), (1.0,)))
    with pytest.raises(RecordingError, match="sensor_msgs/msg/JointState cannot be encoded"):
        layout.payload(*numbers)
