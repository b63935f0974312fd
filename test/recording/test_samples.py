"""Recordings as arrays, and the faults that are counted in them."""

import numpy as np
import pytest
from undamaged import undamaged

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording import RecordingWriter, open_recording, read_samples, reader
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    Point,
    Pose,
    PoseArray,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    String,
    Temperature,
    Vector3,
    Wrench,
    WrenchStamped,
)

MOTORS = ("motor_1_joint", "motor_2_joint")
NAN = float("nan")


def samples_of(tmp_path, entries, **options):
    with RecordingWriter(tmp_path / "bag") as writer:
        for topic, time_ns, message in entries:
            writer.write(topic, message, time_ns)
    return read_samples(undamaged(tmp_path / "bag"), **options)


def joint_state(stamp_ns, position, names=MOTORS, **others):
    return JointState(Header(stamp_ns, ""), names, position, **others)


def faults_of(samples):
    return {(fault.topic, fault.kind): fault.count for fault in samples.faults}


def test_joints_are_found_by_name_in_any_order(tmp_path):
    # log time      10         20                    30
    #               1, 2       2, gripper, 1         gripper alone (somebody else's message)
    entries = [
        ("/joint_states", 10, joint_state(1, (0.1, 0.2), velocity=(3.0, 4.0))),
        ("/joint_states", 20, joint_state(2, (0.4, 9.0, 0.3), (MOTORS[1], "gripper", MOTORS[0]))),
        ("/joint_states", 30, joint_state(3, (9.0,), ("gripper",))),
    ]
    samples = samples_of(tmp_path, entries)
    np.testing.assert_array_equal(samples.joints.position, [[0.1, 0.2], [0.3, 0.4]])
    np.testing.assert_array_equal(samples.joints.velocity, [[3.0, 4.0], [NAN, NAN]])
    np.testing.assert_array_equal(samples.joints.time_ns, [1, 2])
    np.testing.assert_array_equal(samples.joints.log_time_ns, [10, 20])
    assert samples.joints.time_ns.dtype == np.int64
    assert samples.faults == ()


@pytest.mark.parametrize(
    "choices",
    [
        # At random: batches must come back in the order of reception.
        np.random.default_rng(5).integers(2, size=9000),
        # In runs of many chunks: what is gathered of them must be of one form.
        np.repeat([0, 1, 0], 3000),
        np.zeros(9000, dtype=int),
    ],
    ids=["mixed", "in runs", "alike"],
)
def test_rows_equal_the_messages_over_many_blocks(tmp_path, monkeypatch, choices):
    monkeypatch.setattr(reader, "PAYLOADS_AT_A_TIME", 2000)
    generator = np.random.default_rng(5)
    layouts = [MOTORS, ("x", *MOTORS[::-1])]
    states = [
        joint_state(index, tuple(generator.random(len(names)).tolist()), names)
        for index, names in enumerate(layouts[choice] for choice in choices)
    ]
    samples = samples_of(
        tmp_path, [("/joint_states", state.header.stamp_ns, state) for state in states]
    )
    expected = [[state.position[state.name.index(name)] for name in MOTORS] for state in states]
    np.testing.assert_array_equal(samples.joints.position, expected)
    np.testing.assert_array_equal(samples.joints.time_ns, np.arange(9000))
    assert samples.faults == ()


def test_rows_come_in_the_order_of_reception_whatever_that_of_the_file(tmp_path):
    received = [5, 1, 3, 1, 4]
    entries = [
        ("/joint_states", log_time, joint_state(stamp, (0.1 * stamp, 0.0)))
        for stamp, log_time in enumerate(received, 1)
    ]
    samples = samples_of(tmp_path, entries)
    assert samples.joints.log_time_ns.tolist() == sorted(received)
    assert samples.joints.time_ns.tolist() == [2, 4, 3, 5, 1]


def test_names_of_joints_and_topics_can_be_given(tmp_path):
    entries = [("/robot/js", 1, joint_state(1, (1.0, 2.0), ("b", "a")))]
    samples = samples_of(
        tmp_path, entries, joints=("a", "b"), remaps={"/joint_states": "/robot/js"}
    )
    np.testing.assert_array_equal(samples.joints.position, [[2.0, 1.0]])


def test_every_kind_of_topic(tmp_path):
    pose = Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, 0.6, 0.8))
    covariance = tuple(float(number) for number in range(36))
    markers = (Pose(Point(1.0, 2.0, 3.0)), Pose(Point(NAN, NAN, NAN)))
    wrench = Wrench(Vector3(1.0, 2.0, 3.0), Vector3(4.0, 5.0, 6.0))
    head = Header(7, "tracker")
    entries = [
        ("/load_estimate", 10, WrenchStamped(Header(7, "flange"), wrench)),
        ("/platform_pose_measured", 11, PoseStamped(head, pose)),
        (
            "/frame_pose_measured",
            12,
            PoseWithCovarianceStamped(head, PoseWithCovariance(pose, covariance)),
        ),
        ("/platform_markers_measured", 13, PoseArray(head, markers)),
        ("/temperatures", 14, Temperature(Header(7, "link_1"), 21.5)),
        ("/temperatures", 15, Temperature(Header(7, "joint_3"), 30.0)),
        ("/temperatures", 16, Temperature(Header(8, "link_1"), 22.0)),
        ("/covariates/humidity", 17, Float64(0.4)),
        ("/recording_notes", 9, String('{"wrist": "a"}')),
        ("/recording_notes", 19, String('{"operator": "é"}')),
    ]
    samples = samples_of(tmp_path, entries)
    np.testing.assert_array_equal(samples.loads.wrench, [[1, 2, 3, 4, 5, 6]])
    assert samples.loads.frame_id.tolist() == ["flange"]
    np.testing.assert_array_equal(samples.poses.position, [[1, 2, 3]])
    np.testing.assert_array_equal(samples.poses.quaternion, [[0, 0, 0.6, 0.8]])
    assert np.isnan(samples.poses.covariance).all()
    np.testing.assert_array_equal(samples.frame_poses.covariance, np.arange(36.0).reshape(1, 6, 6))
    np.testing.assert_array_equal(samples.frame_poses.position, [[1, 2, 3]])
    np.testing.assert_array_equal(samples.markers.position, [[[1, 2, 3], [NAN] * 3]])
    assert samples.temperatures.keys() == {"link_1", "joint_3"}
    np.testing.assert_array_equal(samples.temperatures["link_1"].value, [21.5, 22.0])
    np.testing.assert_array_equal(samples.temperatures["link_1"].time_ns, [7, 8])
    np.testing.assert_array_equal(samples.covariates["humidity"].value, [0.4])
    np.testing.assert_array_equal(samples.covariates["humidity"].time_ns, [17])
    assert samples.notes == ('{"wrist": "a"}', '{"operator": "é"}')
    # A lost marker and two components with one stamp are no faults.
    assert samples.faults == ()


def test_absent_topics_give_empty_arrays_of_the_right_shape(tmp_path):
    samples = samples_of(tmp_path, [("/covariates/a", 1, Float64(1.0))])
    assert samples.joints.position.shape == (0, 2)
    assert samples.loads.wrench.shape == (0, 6)
    assert samples.poses.quaternion.shape == (0, 4)
    assert samples.poses.covariance.shape == (0, 6, 6)
    assert samples.markers.position.shape == (0, 0, 3)
    assert samples.temperatures == {}


def test_faults_are_counted_and_nothing_is_mended(tmp_path):
    # stamp:  5     5 (repeated)   4 (backwards)   6: NaN    7: one joint of two
    entries = [
        ("/joint_states", 10, joint_state(5, (0.1, 0.2))),
        ("/joint_states", 20, joint_state(5, (0.3, 0.4))),
        ("/joint_states", 30, joint_state(4, (0.5, 0.6))),
        ("/joint_states", 40, joint_state(6, (NAN, 0.8))),
        ("/joint_states", 50, joint_state(7, (0.9,), MOTORS[:1])),
        ("/joint_states", 60, joint_state(8, (), MOTORS)),
        ("/load_estimate", 70, WrenchStamped(Header(1, "f"), Wrench(Vector3(float("inf"))))),
        ("/platform_markers_measured", 80, PoseArray(Header(1, "f"), (Pose(), Pose()))),
        ("/platform_markers_measured", 90, PoseArray(Header(2, "f"), (Pose(),))),
    ]
    samples = samples_of(tmp_path, entries)
    assert faults_of(samples) == {
        ("/joint_states", "stamp repeated"): 1,
        ("/joint_states", "stamp running backwards"): 1,
        ("/joint_states", "position not finite"): 1,
        ("/joint_states", "joint missing"): 2,
        ("/load_estimate", "wrench not finite"): 1,
        ("/platform_markers_measured", "other number of markers than at first"): 1,
    }
    first = {fault.kind: fault.first_log_time_ns for fault in samples.faults}
    assert first["stamp repeated"] == 20
    assert first["stamp running backwards"] == 30
    assert first["position not finite"] == 40
    assert first["joint missing"] == 50
    np.testing.assert_array_equal(samples.joints.time_ns, [5, 5, 4, 6])
    assert np.isnan(samples.joints.position[3, 0])
    assert samples.markers.position.shape == (1, 2, 3)


def test_payloads_that_cannot_be_decoded_are_a_fault(tmp_path):
    with RecordingWriter(tmp_path / "bag") as writer:
        writer.write("/load_estimate", WrenchStamped(), 1)
        writer.write_raw(channel_of("/load_estimate", WrenchStamped), b"\0\1\0\0cut", 2)
    samples = read_samples(open_recording(tmp_path / "bag"))
    assert faults_of(samples) == {("/load_estimate", "payload cannot be decoded"): 1}
    assert samples.loads.wrench.shape == (1, 6)


@pytest.mark.parametrize(
    ("entry", "options", "reason"),
    [
        (
            ("/joint_states", 1, joint_state(1, (1.0,), ("elbow",))),
            {},
            "motor_1_joint and motor_2_joint together; its first message names elbow: say --joint",
        ),
        (
            ("/load_estimate", 1, Float64(1.0)),
            {},
            "carries std_msgs/msg/Float64, not geometry_msgs",
        ),
        (
            ("/covariates/a", 1, Float64(1.0)),
            {"remaps": {"/load_estimate": "/ft"}},
            "has no topic /ft; its topics are /covariates/a",
        ),
    ],
)
def test_what_cannot_be_read_is_one_clear_error(tmp_path, entry, options, reason):
    with pytest.raises(RecordingError, match=reason):
        samples_of(tmp_path, [entry], **options)
