"""Recordings written and read, by this project and by others."""

import re
import tracemalloc
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.writer import Writer as FoxgloveWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore
from undamaged import undamaged

from wrist_stiffness.recording import RecordingWriter, open_recording, read_samples
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.recording.schema import definition_text

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
FORMS = pytest.mark.parametrize("name", ["bag", "file.mcap"], ids=["folder", "bare"])
START_NS = 1_700_000_000_000_000_000


@FORMS
def test_reads_back_what_was_written(tmp_path, name, timeline, written, hidden_in):
    expected = list(timeline(500))
    recording = undamaged(written(tmp_path / name, expected))
    assert list(recording.messages()) == expected
    assert recording.damage == ""
    topics = {info.name: info for info in recording.topics}
    joints = topics["/joint_states"]
    assert joints.ros_type == "sensor_msgs/msg/JointState"
    assert (joints.count, topics["/load_estimate"].count) == (500, 250)
    assert (joints.first_ns, joints.last_ns) == (START_NS, START_NS + 499_000_000)
    assert topics["/load_estimate"].last_ns == START_NS + 498_000_000
    only_loads = list(recording.messages(["/load_estimate"]))
    assert only_loads == [entry for entry in expected if entry[0] == "/load_estimate"]
    assert hidden_in(tmp_path) == []


@FORMS
def test_rosbags_reads_the_same_values(tmp_path, name, timeline, written):
    expected = list(timeline(300))
    path = written(tmp_path / name, expected)
    # For a bare file rosbags takes the schema's text, for a folder it compares the type hash.
    with AnyReader([path], default_typestore=TYPESTORE) as reader:
        found = [
            (connection.topic, time_ns, reader.deserialize(payload, connection.msgtype))
            for connection, time_ns, payload in reader.messages()
        ]
    assert [entry[:2] for entry in found] == [entry[:2] for entry in expected]
    for (_, _, theirs), (_, _, ours) in zip(found, expected, strict=True):
        if isinstance(ours, JointState):
            assert theirs.name == list(ours.name)
            assert tuple(theirs.position) == ours.position
            stamp = theirs.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == ours.header.stamp_ns
        elif isinstance(ours, WrenchStamped):
            assert theirs.header.frame_id == "wrist_base"
            assert theirs.wrench.force.z == ours.wrench.force.z
            assert theirs.wrench.torque.z == 0.5
        else:
            assert theirs.data == ours.data


def test_reads_what_rosbags_wrote(tmp_path):
    types = TYPESTORE.types
    stamp = types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"](stamp=stamp(sec=5, nanosec=6), frame_id="tracker")
    quaternion = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.6, w=0.8)
    point = types["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0)
    pose = types["geometry_msgs/msg/Pose"](position=point, orientation=quaternion)
    stamped = types["geometry_msgs/msg/PoseStamped"](header=header, pose=pose)
    vector = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    twist = types["geometry_msgs/msg/Twist"](linear=vector, angular=vector)
    path = tmp_path / "foreign"
    with RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, message in [("/pose", stamped), ("/cmd_vel", twist)]:
            msgtype = message.__msgtype__
            connection = writer.add_connection(topic, msgtype, typestore=TYPESTORE)
            for time_ns in (30, 20, 10):
                writer.write(connection, time_ns, TYPESTORE.serialize_cdr(message, msgtype))
    recording = undamaged(path)
    messages = list(recording.messages())
    assert [(topic, time_ns) for topic, time_ns, _ in messages] == [
        ("/pose", 10),
        ("/pose", 20),
        ("/pose", 30),
    ]
    assert messages[0][2].header == Header(5_000_000_006, "tracker")
    assert messages[0][2].pose.orientation.w == 0.8
    (skipped,) = (topic for topic in recording.topics if topic.name != "/pose")
    assert (skipped.name, skipped.ros_type, skipped.count) == (
        "/cmd_vel",
        "geometry_msgs/msg/Twist",
        3,
    )
    # A copy keeps the unknown topic as it was.
    with RecordingWriter(tmp_path / "copy") as writer:
        for raw in recording.raw_messages():
            writer.write_raw(*raw[:1], raw.payload, raw.log_time_ns)
    with AnyReader([tmp_path / "copy"], default_typestore=TYPESTORE) as reader:
        assert sum(connection.topic == "/cmd_vel" for connection, _, _ in reader.messages()) == 3


def test_reads_what_foxglove_wrote(tmp_path):
    path = tmp_path / "foxglove.mcap"
    with path.open("wb") as stream:
        writer = FoxgloveWriter(stream)
        name = "geometry_msgs/msg/WrenchStamped"
        schema = writer.register_msgdef(name, definition_text(name))
        for time_ns in (5, 4, 6):
            header = {"stamp": {"sec": 1, "nanosec": time_ns}, "frame_id": "ft"}
            force, torque = (
                {"x": 1.0, "y": 2.0, "z": float(time_ns)},
                {"x": 0.0, "y": 0.0, "z": 0.5},
            )
            wrench = {"header": header, "wrench": {"force": force, "torque": torque}}
            writer.write_message("/load_estimate", schema, wrench, time_ns, time_ns)
        writer.finish()
    recording = undamaged(path)
    assert list(recording.messages()) == [
        (
            "/load_estimate",
            time_ns,
            WrenchStamped(
                Header(1_000_000_000 + time_ns, "ft"),
                Wrench(Vector3(1.0, 2.0, float(time_ns)), Vector3(z=0.5)),
            ),
        )
        for time_ns in (4, 5, 6)
    ]
    assert read_samples(recording).loads.wrench[:, 2].tolist() == [4.0, 5.0, 6.0]


@pytest.mark.parametrize("compression", list(CompressionType), ids=lambda kind: kind.name)
@pytest.mark.parametrize("use_chunking", [True, False], ids=["chunks", "loose"])
@pytest.mark.parametrize("with_index", [True, False], ids=["indexed", "bare"])
def test_reads_every_form_of_mcap(tmp_path, compression, use_chunking, with_index):
    path = tmp_path / "foreign.mcap"
    channel = channel_of("/covariates/humidity", Float64)
    # Times jump back and forth across chunks and within them, with many ties.
    times = np.random.default_rng(7).integers(0, 300, 2000).tolist()
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=1000,
            compression=compression,
            index_types=IndexType.ALL if with_index else IndexType.NONE,
            repeat_channels=with_index,
            repeat_schemas=with_index,
            use_statistics=with_index,
            use_summary_offsets=with_index,
            use_chunking=use_chunking,
        )
        writer.start("ros2")
        schema_id = writer.register_schema("std_msgs/Float64", "ros2msg", channel.schema_text)
        channel_id = writer.register_channel(channel.topic, "cdr", schema_id)
        for number, time_ns in enumerate(times):
            writer.add_message(channel_id, time_ns, encode(Float64(float(number))), time_ns)
        writer.finish()
    recording = undamaged(path)
    (info,) = recording.topics
    assert (info.ros_type, info.count, info.first_ns, info.last_ns) == (
        "std_msgs/msg/Float64",
        2000,
        min(times),
        max(times),
    )
    numbered = sorted(enumerate(times), key=lambda item: item[1])
    assert list(recording.messages()) == [
        ("/covariates/humidity", time_ns, Float64(float(number))) for number, time_ns in numbered
    ]


def test_ties_in_log_time_keep_the_order_of_writing(tmp_path, written):
    entries = [("/covariates/a", 5, Float64(float(number))) for number in range(40_000)]
    path = written(tmp_path / "ties.mcap", entries)
    assert len({chunk.offset for chunk in open_recording(path)._indices[0].chunks}) > 1
    assert list(open_recording(path).messages()) == entries


def test_several_files_of_one_folder_are_merged_by_time(tmp_path, timeline, written):
    entries = list(timeline(100))
    first = written(tmp_path / "bag", entries[::2])
    written(tmp_path / "other.mcap", entries[1::2]).rename(first / "bag_1.mcap")
    text = (first / "metadata.yaml").read_text()
    listing = "relative_file_paths:\n  - bag_0.mcap\n"
    assert listing in text
    text = text.replace(listing, listing + "  - bag_1.mcap\n")
    for topic, count in Counter(entry[0] for entry in entries).items():
        text = re.sub(rf"(name: {topic}\n(.*\n)*?.*message_count: )\d+", rf"\g<1>{count}", text)
    (first / "metadata.yaml").write_text(text)
    merged = list(undamaged(first).messages())
    assert [entry[1] for entry in merged] == sorted(entry[1] for entry in entries)
    assert len(merged) == len(entries)
    kept = (first / "bag_0.mcap").rename(tmp_path / "kept.mcap")
    times = f"{entries[0][1]} to {max(entry[1] for entry in entries[::2])} ns"
    missing = rf"bag_0.mcap \({len(entries[::2])} messages, {times}\) of metadata.yaml not found"
    assert re.search(missing, open_recording(first).damage)
    kept.rename(first / "bag_0.mcap")
    (first / "bag_1.mcap").unlink()
    recording = open_recording(first)
    assert "bag_1.mcap of metadata.yaml not found" in recording.damage
    assert "metadata.yaml states 100 messages of /joint_states, 50 found" in recording.damage
    assert len(list(recording.messages())) == len(entries[::2])


@settings(max_examples=25)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["/covariates/a", "/covariates/b"]),
            st.integers(0, 2**63 - 1),
            st.floats(allow_nan=False).map(Float64),
        ),
        max_size=60,
    )
)
def test_any_sequence_comes_back_in_stable_time_order(tmp_path_factory, written, entries):
    path = written(tmp_path_factory.mktemp("any") / "recording", entries)
    assert list(undamaged(path).messages()) == sorted(entries, key=lambda entry: entry[1])


@settings(max_examples=60)
@given(st.lists(st.integers(0, 9).map(lambda each: each if each < 9 else 2**63 - 1), max_size=30))
def test_chunks_that_overlap_are_merged_in_stable_time_order(tmp_path_factory, times):
    path = tmp_path_factory.mktemp("overlapping") / "recording.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=150)  # some three messages
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
        channel = writer.register_channel("/a", "cdr", schema)
        for number, time_ns in enumerate(times):
            writer.add_message(channel, time_ns, encode(Float64(float(number))), time_ns)
        writer.finish()
    numbered = sorted(enumerate(times), key=lambda each: each[1])
    assert list(undamaged(path).messages()) == [
        ("/a", time_ns, Float64(float(number))) for number, time_ns in numbered
    ]


def test_memory_is_bounded_by_chunks(tmp_path):
    count, numbers = 1200, np.random.default_rng(3)
    path = tmp_path / "large.mcap"
    # Noise does not compress, so that the file is as large as what it holds.
    tracemalloc.start()
    try:
        with RecordingWriter(path) as writer:
            for index in range(count):
                writer.write("/noise", JointState(position=numbers.random(1000)), index)
        _, writing_peak = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        assert sum(1 for _ in open_recording(path).raw_messages()) == count
        _, reading_peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert path.stat().st_size > 8.5e6
    # One chunk of 1 MiB in its raw, compressed and split forms.
    assert writing_peak < 6e6
    assert reading_peak < 6e6


def test_a_block_of_large_messages_is_few_of_them(tmp_path, monkeypatch):
    path, limit = tmp_path / "large.mcap", 1 << 20
    monkeypatch.setattr("wrist_stiffness.recording.reader.MOST_BYTES_AT_A_TIME", limit)
    with RecordingWriter(path) as writer:
        for index in range(40):
            writer.write("/picture", JointState(position=np.zeros(20_000)), index)
    blocks = list(open_recording(path).blocks())
    assert sum(map(len, blocks)) == 40
    assert max(len(block.buffer) for block in blocks) < 3 * limit
