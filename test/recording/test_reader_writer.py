"""Recordings written and read, by this project and by others, whole and damaged."""

import struct
import tracemalloc

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Channel as McapChannel
from mcap.records import Chunk, MessageIndex, Schema
from mcap.records import Header as McapHeader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from wrist_stiffness.errors import InputError, RecordingError
from wrist_stiffness.recording import RecordingWriter, open_recording, parse_topic_remaps
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    Pose,
    PoseStamped,
    String,
    Vector3,
    Wrench,
    WrenchStamped,
)

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
FORMS = pytest.mark.parametrize("name", ["bag", "file.mcap"], ids=["folder", "bare"])
START_NS = 1_700_000_000_000_000_000


def timeline(count):
    """Joint states every 1 ms, every second one followed by a load; one note at the start.

    log time [ms]  0      1   2      3   …
    /joint_states  q      q   q      q
    /load_estimate w          w
    /recording_notes n
    """
    yield "/recording_notes", START_NS, String('{"load_source": "ft"}')
    for step in range(count):
        time_ns = START_NS + step * 1_000_000
        angles = (0.001 * step, -0.002 * step)
        names = ("motor_1_joint", "motor_2_joint")
        yield "/joint_states", time_ns, JointState(Header(time_ns, ""), names, angles)
        if step % 2 == 0:
            wrench = Wrench(Vector3(1.0, 2.0, float(step)), Vector3(z=0.5))
            yield "/load_estimate", time_ns, WrenchStamped(Header(time_ns, "wrist_base"), wrench)


def written(path, entries):
    with RecordingWriter(path) as writer:
        for topic, time_ns, message in entries:
            writer.write(topic, message, time_ns)
    return path


def mcap_of(path):
    return next(path.glob("*.mcap")) if path.is_dir() else path


def hidden_in(folder):
    return [entry.name for entry in folder.iterdir() if entry.name.startswith(".")]


# Whole recordings ---------------------------------------------------------------------------------


@FORMS
def test_reads_back_what_was_written(tmp_path, name):
    expected = list(timeline(500))
    recording = open_recording(written(tmp_path / name, expected), strict=True)
    assert list(recording.messages()) == expected
    assert recording.damage == ""
    assert recording.skipped_topics == ()
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
def test_rosbags_reads_the_same_values(tmp_path, name):
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
    recording = open_recording(path, strict=True)
    messages = list(recording.messages())
    assert [(topic, time_ns) for topic, time_ns, _ in messages] == [
        ("/pose", 10),
        ("/pose", 20),
        ("/pose", 30),
    ]
    assert messages[0][2].header == Header(5_000_000_006, "tracker")
    assert messages[0][2].pose.orientation.w == 0.8
    (skipped,) = recording.skipped_topics
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
    recording = open_recording(path, strict=True)
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


def test_ties_in_log_time_keep_the_order_of_writing(tmp_path):
    entries = [("/covariates/a", 5, Float64(float(number))) for number in range(40_000)]
    path = written(tmp_path / "ties.mcap", entries)
    assert len({chunk.offset for chunk in open_recording(path)._indices[0].chunks}) > 1
    assert list(open_recording(path).messages()) == entries


def test_several_files_of_one_folder_are_merged_by_time(tmp_path):
    entries = list(timeline(100))
    first = written(tmp_path / "bag", entries[::2])
    written(tmp_path / "other.mcap", entries[1::2]).rename(first / "bag_1.mcap")
    text = (first / "metadata.yaml").read_text()
    listing = "relative_file_paths:\n  - bag_0.mcap\n"
    assert listing in text
    (first / "metadata.yaml").write_text(text.replace(listing, listing + "  - bag_1.mcap\n"))
    merged = list(open_recording(first, strict=True).messages())
    assert [entry[1] for entry in merged] == sorted(entry[1] for entry in entries)
    assert len(merged) == len(entries)
    (first / "bag_1.mcap").unlink()
    recording = open_recording(first)
    assert "bag_1.mcap of metadata.yaml not found" in recording.damage
    assert len(list(recording.messages())) == len(entries[::2])


@settings(max_examples=25, deadline=None)
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
def test_any_sequence_comes_back_in_stable_time_order(tmp_path_factory, entries):
    path = written(tmp_path_factory.mktemp("any") / "recording", entries)
    assert list(open_recording(path, strict=True).messages()) == sorted(
        entries, key=lambda entry: entry[1]
    )


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


# Damage -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Entries, and the bytes of a file with many small chunks."""
    path = tmp_path_factory.mktemp("small") / "small.mcap"
    channel = channel_of("/covariates/a", Float64)
    entries = [
        (channel.topic, index, Float64(value))
        for index, value in enumerate(np.random.default_rng(1).random(800))
    ]
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2500)
        writer.start("ros2")
        schema_id = writer.register_schema(channel.ros_type, "ros2msg", channel.schema_text)
        channel_id = writer.register_channel(channel.topic, "cdr", schema_id)
        for _, time_ns, message in entries:
            writer.add_message(channel_id, time_ns, encode(message), time_ns)
        writer.finish()
    return entries, path.read_bytes()


def test_a_cut_file_gives_a_prefix_and_says_so(tmp_path, small):
    entries, whole = small
    path = tmp_path / "cut.mcap"
    generator = np.random.default_rng(2)
    near_the_end = range(len(whole) - 300, len(whole), 3)
    anywhere = generator.integers(8, len(whole), 200)
    found_lengths = set()
    for length in sorted({8, 9, 17, *near_the_end, *anywhere.tolist()}):
        path.write_bytes(whole[:length])
        recording = open_recording(path)
        found = list(recording.messages())
        assert found == entries[: len(found)]
        assert f"{len(found)} messages stand before that" in recording.damage
        assert str(length) in recording.damage or "closing magic" in recording.damage
        assert sum(info.count for info in recording.topics) == len(found)
        found_lengths.add(len(found))
        with pytest.raises(RecordingError, match="cut.mcap"):
            open_recording(path, strict=True)
    # Cuts in the summary lose nothing, cuts in the data whole chunks.
    assert len(entries) in found_lengths
    assert len(found_lengths) > 10


@pytest.mark.parametrize("channels_first", [True, False], ids=["before chunks", "in chunks"])
def test_a_cut_between_the_indexes_of_a_chunk_loses_no_topic(tmp_path, channels_first):
    path = written(tmp_path / "cut.mcap", timeline(50))
    declarations = RecordBuilder()
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, McapHeader):
                after_header = stream.tell()
            elif isinstance(record, MessageIndex):
                after_last_index = stream.tell()
            elif isinstance(record, Schema | McapChannel):
                record.write(declarations)
    data = path.read_bytes()[: after_last_index - 1]
    if channels_first:
        data = data[:after_header] + declarations.end() + data[after_header:]
    path.write_bytes(data)
    recording = open_recording(path)
    assert {info.name: info.count for info in recording.topics} == {
        "/joint_states": 50,
        "/load_estimate": 25,
        "/recording_notes": 1,
    }
    assert "76 messages stand before that" in recording.damage
    assert len(list(recording.messages())) == 76


def test_flipped_bytes_never_escape_as_another_error(tmp_path, small):
    _, whole = small
    generator = np.random.default_rng(4)
    path = tmp_path / "flipped.mcap"
    positions = [*generator.integers(8, len(whole), 300), *generator.integers(8, 120, 100)]
    for position in positions:
        damaged = bytearray(whole)
        damaged[position] ^= 1 << int(generator.integers(8))
        path.write_bytes(damaged)
        try:
            times = [time_ns for _, time_ns, _ in open_recording(path).messages()]
        except RecordingError:
            continue
        assert times == sorted(times)


def chunk_data_offsets(path):
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                yield stream.tell() - len(record.data), record


def test_a_chunk_with_a_wrong_checksum_is_left_out_and_reported(tmp_path, small):
    entries, whole = small
    path = tmp_path / "crc.mcap"
    path.write_bytes(whole)
    offset, chunk = list(chunk_data_offsets(path))[1]
    # CRC, name length and 'zstd', data length stand between the checksum and the data.
    crc_offset = offset - 8 - 4 - 4 - 4
    damaged = bytearray(whole)
    assert struct.unpack_from("<I", damaged, crc_offset) == (chunk.uncompressed_crc,)
    damaged[crc_offset] ^= 0xFF
    path.write_bytes(damaged)
    recording = open_recording(path)
    found = list(recording.messages())
    assert found == [
        entry
        for entry in entries
        if not chunk.message_start_time <= entry[1] <= chunk.message_end_time
    ]
    assert 0 < len(found) < len(entries)
    assert f"chunk at byte {offset} does not match its checksum" in recording.damage
    # A second reading does not report it again.
    list(recording.messages())
    assert recording.damage.count("checksum") == 1
    with pytest.raises(RecordingError, match="checksum"):
        list(open_recording(path, strict=True).messages())


def test_payloads_that_cannot_be_decoded_are_counted(tmp_path):
    path = tmp_path / "bag"
    with RecordingWriter(path) as writer:
        for time_ns in range(4):
            payload = encode(Float64(1.0))[: 7 if time_ns % 2 else None]
            writer.write_raw(channel_of("/covariates/a", Float64), payload, time_ns)
    recording = open_recording(path)
    for _ in range(2):
        assert [time_ns for _, time_ns, _ in recording.messages()] == [0, 2]
        assert recording.damage == "/covariates/a: 2 messages cannot be decoded"
    with pytest.raises(RecordingError, match="/covariates/a at log time 1 ns"):
        list(open_recording(path, strict=True).messages())


def test_a_folder_whose_recorder_crashed_is_read_by_its_files(tmp_path):
    path = written(tmp_path / "bag", timeline(10))
    (path / "metadata.yaml").unlink()
    recording = open_recording(path)
    assert len(list(recording.messages())) == 16
    assert "metadata.yaml is missing" in recording.damage
    with pytest.raises(RecordingError, match="metadata.yaml is missing"):
        open_recording(path, strict=True)


METADATA = "rosbag2_bagfile_information: {{storage_identifier: {}, relative_file_paths: [{}]{}}}"


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (None, "does not exist"),
        ({}, "no recording: neither metadata.yaml nor"),
        ({"metadata.yaml": "a: [unclosed"}, "no rosbag2 metadata"),
        ({"metadata.yaml": "just text"}, "no rosbag2 metadata"),
        ({"metadata.yaml": METADATA.format("sqlite3", "a.db3", "")}, "'sqlite3' is not read"),
        ({"metadata.yaml": METADATA.format("mcap", "a.mcap", "")}, "a.mcap .* not found"),
        ({"metadata.yaml": METADATA.format("mcap", "", "")}, "lists no files"),
        (
            {"metadata.yaml": METADATA.format("mcap", "a", ", compression_mode: FILE")},
            "compression mode 'FILE'",
        ),
        ({"a.mcap": ""}, "is empty"),
        ({"a.mcap": "\x89MCAP"}, "does not begin as an MCAP file"),
        ({"a.mcap": "time,angle\n0,1\n"}, "does not begin as an MCAP file"),
    ],
)
def test_what_is_no_recording_is_one_clear_error(tmp_path, files, message):
    path = tmp_path / "given"
    if files is not None:
        path.mkdir()
        for name, text in files.items():
            (path / name).write_text(text, encoding="latin-1")
    with pytest.raises(RecordingError, match=message) as caught:
        open_recording(path)
    assert "\n" not in str(caught.value)


# Writing ------------------------------------------------------------------------------------------


@FORMS
def test_equal_messages_give_equal_bytes(tmp_path, name):
    (tmp_path / "elsewhere").mkdir()
    first = written(tmp_path / name, timeline(400))
    second = written(tmp_path / "elsewhere" / f"other_{name}", timeline(400))
    assert mcap_of(first).read_bytes() == mcap_of(second).read_bytes()


@FORMS
def test_an_exception_leaves_nothing_behind(tmp_path, name):
    def write_and_fail():
        with RecordingWriter(tmp_path / name) as writer:
            for topic, time_ns, message in timeline(100):
                writer.write(topic, message, time_ns)
            assert not (tmp_path / name).exists()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write_and_fail()
    assert list(tmp_path.iterdir()) == []


@FORMS
def test_an_existing_recording_is_replaced_only_on_request(tmp_path, name):
    path = written(tmp_path / name, timeline(5))
    before = mcap_of(path).read_bytes()
    with pytest.raises(RecordingError, match="exists already"), RecordingWriter(path):
        pass
    assert mcap_of(path).read_bytes() == before
    with RecordingWriter(path, overwrite=True) as writer:
        writer.write("/covariates/a", Float64(1.0), 1)
        assert mcap_of(path).read_bytes() == before
    assert len(list(open_recording(path, strict=True).messages())) == 1
    assert hidden_in(tmp_path) == []


def test_a_failed_replacement_keeps_the_old_recording(tmp_path):
    path = written(tmp_path / "bag", timeline(5))

    def replace_and_fail():
        with RecordingWriter(path, overwrite=True) as writer:
            writer.write("/covariates/a", "no message", 1)

    with pytest.raises(AttributeError):
        replace_and_fail()
    assert len(list(open_recording(path, strict=True).messages())) == 9
    assert hidden_in(tmp_path) == []


def test_a_folder_with_anything_else_in_it_is_never_replaced(tmp_path):
    path = written(tmp_path / "bag", timeline(5))
    (path / "thesis.tex").write_text("years of work")
    with (
        pytest.raises(RecordingError, match="never overwritten"),
        RecordingWriter(path, overwrite=True),
    ):
        pass
    assert (path / "thesis.tex").exists()


def test_metadata_is_what_rosbags_states_for_the_same_messages(tmp_path):
    entries = list(timeline(20))
    ours = written(tmp_path / "bag", entries)
    theirs = tmp_path / "theirs"
    with RosbagsWriter(theirs, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for topic, time_ns, message in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, message.ros_type, typestore=TYPESTORE
                )
            writer.write(connections[topic], time_ns, encode(message))

    def metadata(path):
        information = yaml.safe_load((path / "metadata.yaml").read_text())[
            "rosbag2_bagfile_information"
        ]
        del information["ros_distro"]
        for topic in information["topics_with_message_count"]:
            del topic["topic_metadata"]["offered_qos_profiles"]
        return information

    expected = metadata(theirs)
    expected["files"][0]["path"] = "bag_0.mcap"
    expected["relative_file_paths"] = ["bag_0.mcap"]
    assert metadata(ours) == expected


def test_an_empty_recording_is_a_recording(tmp_path):
    path = written(tmp_path / "bag", [])
    recording = open_recording(path, strict=True)
    assert recording.topics == ()
    assert list(recording.messages()) == []
    with AnyReader([path], default_typestore=TYPESTORE) as reader:
        assert list(reader.messages()) == []


@pytest.mark.parametrize(
    ("topic", "message", "time_ns", "reason"),
    [
        ("/joint_states", Float64(0.0), 1, "carries sensor_msgs/msg/JointState, not std_msgs"),
        ("relative", Float64(0.0), 1, "does not begin with '/'"),
        ("/a", Float64(0.0), -1, "log time -1 ns is outside"),
        ("/a", Float64(0.0), 2**63, "is outside"),
        ("/a", PoseStamped(Header(), Pose(position=None)), 1, "NoneType"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, topic, message, time_ns, reason):
    with RecordingWriter(tmp_path / "bag") as writer:
        writer.write("/joint_states", JointState(), 1)
        with pytest.raises(RecordingError, match=reason):
            writer.write(topic, message, time_ns)
    assert len(list(open_recording(tmp_path / "bag", strict=True).messages())) == 1


def test_a_missing_parent_folder_is_named(tmp_path):
    with (
        pytest.raises(RecordingError, match="nowhere does not exist"),
        RecordingWriter(tmp_path / "nowhere" / "bag"),
    ):
        pass


# Topic names --------------------------------------------------------------------------------------


def test_remaps_are_parsed():
    assert parse_topic_remaps(["/joint_states:=/robot/js", "covariates/rh := /lab/rh"]) == {
        "/joint_states": "/robot/js",
        "/covariates/rh": "/lab/rh",
    }


@pytest.mark.parametrize(
    ("remaps", "reason"),
    [
        (["/joint_states"], "not of the form"),
        (["/joint_states="], "not of the form"),
        (["/joint_states:="], "not of the form"),
        ([":=/a"], "not of the form"),
        (["/joint_state:=/a"], "/joint_state is not a standard topic; these are /joint_states"),
        (["/joint_states:=/a", "joint_states:=/b"], "mapped twice"),
        (["/joint_states:=/a", "/load_estimate:=/a"], "used for two"),
    ],
)
def test_bad_remaps_are_refused(remaps, reason):
    with pytest.raises(InputError, match=reason):
        parse_topic_remaps(remaps)
