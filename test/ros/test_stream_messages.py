"""Bytes of the streams against rclpy's own messages and serialization."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, Vector3, Vector3Stamped, WrenchStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.ros.stream_messages import (
    JointSample,
    angles_payload,
    error_payload,
    joint_payload,
    joint_reader,
    vector_payload,
    wrench_reader,
)

NUMBERS = st.floats(width=64)
FINITE = st.floats(-1e3, 1e3)
TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
ROWS = st.lists(NUMBERS, max_size=7).map(tuple)
JOINTS = st.builds(
    JointSample, STAMPS, TEXTS, st.lists(TEXTS, max_size=7).map(tuple), ROWS, ROWS, ROWS
)
THOROUGH = settings(max_examples=200)


def joint_message(sample):
    message = JointState(
        name=list(sample.names),
        position=sample.positions,
        velocity=sample.velocities,
        effort=sample.efforts,
    )
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(sample.stamp_ns, 10**9)
    message.header.frame_id = sample.frame_id
    return message


def assert_bytes_of_rclpy(payload, message):
    """All bytes are those of rclpy but for padding, which Fast CDR leaves undefined."""
    expected = serialize_message(message)
    # It leaves bytes behind empty sequences, too.
    assert len(payload) <= len(expected)
    changed = bytearray(payload)
    for i, byte in enumerate(payload):
        if byte != expected[i]:
            assert byte == 0
            changed[i] = 0xFF
    # What does not come back when it is read was padding.
    for each in (payload, bytes(changed)):
        assert repr(deserialize_message(each, type(message))) == repr(message)


@THOROUGH
@given(st.lists(JOINTS, min_size=1, max_size=6))
def test_joint_states_are_read_as_rclpy_writes_them(several):
    read = joint_reader()
    for sample in several:
        # repr: NaN is not equal to itself.
        assert repr(read(serialize_message(joint_message(sample)))) == repr(sample)


@THOROUGH
@given(JOINTS)
def test_joint_states_are_written_as_by_rclpy(sample):
    assert_bytes_of_rclpy(joint_payload(sample), joint_message(sample))


@THOROUGH
@given(STAMPS, TEXTS, st.tuples(*[NUMBERS] * 6))
def test_wrenches_are_read_as_rclpy_writes_them(stamp_ns, frame_id, numbers):
    message = WrenchStamped()
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    for part, values in ((message.wrench.force, numbers[:3]), (message.wrench.torque, numbers[3:])):
        part.x, part.y, part.z = values
    read = wrench_reader()(serialize_message(message))
    assert repr(tuple(read)) == repr((stamp_ns, frame_id, numbers[:3], numbers[3:]))


@THOROUGH
@given(STAMPS, st.tuples(*[FINITE] * 3), st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.data())
def test_pose_errors_are_written_as_by_rclpy(stamp_ns, shift, turn, data):
    covariance = np.array(data.draw(st.tuples(*[FINITE] * 36))).reshape(6, 6)
    payload = error_payload(stamp_ns, np.array([*shift, *turn]), covariance)
    message = deserialize_message(payload, PoseWithCovarianceStamped)
    assert_bytes_of_rclpy(payload, message)
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns
    assert message.header.frame_id == "wrist_base"
    np.testing.assert_array_equal(message.pose.covariance, covariance.ravel())
    by = message.pose.pose.orientation
    expected = Rotation.from_rotvec(turn).as_quat(canonical=True)
    np.testing.assert_allclose([by.x, by.y, by.z, by.w], expected, atol=1e-12)


@THOROUGH
@given(NUMBERS, NUMBERS)
def test_plain_numbers_are_written_as_by_rclpy(first, second):
    vector = Vector3Stamped(vector=Vector3(x=first, y=second, z=first))
    vector.header.frame_id = "wrist_base"
    vector.header.stamp.sec, vector.header.stamp.nanosec = 3, 7
    given = vector_payload(3_000_000_007, np.array([first, second, first]))
    assert_bytes_of_rclpy(given, vector)
    theta = np.array([first, second])
    assert_bytes_of_rclpy(angles_payload(theta), Float64MultiArray(data=theta.tolist()))


@pytest.mark.parametrize("make", [joint_reader, wrench_reader])
def test_a_damaged_payload_is_an_error_and_the_next_one_is_read(make):
    kind = {joint_reader: JointState, wrench_reader: WrenchStamped}[make]
    read, payload = make(), serialize_message(kind())
    good = read(payload)
    for damaged in (
        b"",
        payload[:3],
        payload[:14],
        b"\7" + payload[1:],
        payload[:12] + b"\xff" * 9,
    ):
        with pytest.raises(RecordingError, match=kind.__name__):
            read(damaged)
    assert read(payload) == good
