"""Recordings that are cut, flipped, or no recordings at all."""

import struct

import numpy as np
import pytest
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Chunk, MessageIndex, Schema
from mcap.records import Header as McapHeader
from mcap.stream_reader import StreamReader
from mcap.writer import IndexType, Writer

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import (
    Float64,
)


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
        assert f"{len(found)} messages can be read" in recording.damage
        assert str(length) in recording.damage or "closing magic" in recording.damage
        assert sum(info.count for info in recording.topics) == len(found)
        found_lengths.add(len(found))
    # Cuts in the summary lose nothing, cuts in the data whole chunks.
    assert len(entries) in found_lengths
    assert len(found_lengths) > 10


def test_of_a_recording_cut_in_half_about_half_is_there(tmp_path, timeline, written):
    """Three minutes of a slow sensor: 30 joint states a second."""
    entries = list(timeline(5400))
    path = written(tmp_path / "cut.mcap", entries)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    found = list(open_recording(path).messages())
    assert found == entries[: len(found)]
    assert 0.3 * len(entries) < len(found) < 0.6 * len(entries)


@pytest.mark.parametrize("channels_first", [True, False], ids=["before chunks", "in chunks"])
def test_a_cut_between_the_indexes_of_a_chunk_loses_no_topic(
    tmp_path, channels_first, timeline, written
):
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
    assert "76 messages can be read" in recording.damage
    assert len(list(recording.messages())) == 76


@pytest.mark.slow
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


def test_a_chunk_that_became_a_record_of_unknown_kind_is_told(tmp_path, small):
    """Records of unknown kinds are allowed; without indexes or statistics one may hide a loss."""
    entries, _ = small
    path = tmp_path / "unknown.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2500, index_types=IndexType.NONE, use_statistics=False)
        writer.start("ros2")
        schema_id = writer.register_schema("a/A", "ros2msg", b"")
        channel_id = writer.register_channel("/a", "cdr", schema_id)
        for _, time_ns, _ in entries:
            writer.add_message(channel_id, time_ns, bytes(50), time_ns)
        writer.finish()
    assert not open_recording(path).damage
    offset, chunk = next(chunk_data_offsets(path))
    head = offset - 8 - len(chunk.compression) - 4 - 28 - 9
    damaged = bytearray(path.read_bytes())
    assert damaged[head] == Opcode.CHUNK
    damaged[head] ^= 0x80
    path.write_bytes(damaged)
    recording = open_recording(path)
    assert len(list(recording.raw_messages())) < len(entries)
    assert f"unknown kind {Opcode.CHUNK ^ 0x80} at byte {head}" in recording.damage


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


def test_a_folder_whose_recorder_crashed_is_read_by_its_files(tmp_path, timeline, written):
    path = written(tmp_path / "bag", timeline(10))
    (path / "metadata.yaml").unlink()
    recording = open_recording(path)
    assert len(list(recording.messages())) == 16
    assert "metadata.yaml is missing" in recording.damage


METADATA = "rosbag2_bagfile_information: {{storage_identifier: {}, relative_file_paths: [{}]{}}}"


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (None, "does not exist"),
        ({}, "no recording: neither metadata.yaml nor"),
        ({"metadata.yaml": "a: [unclosed"}, "not a YAML file"),
        ({"metadata.yaml": "just text"}, "'just text' is not a mapping"),
        ({"metadata.yaml": METADATA.format("sqlite3", "a.db3", "")}, "'sqlite3' is not read"),
        ({"metadata.yaml": METADATA.format("mcap", "a.mcap", "")}, "a.mcap .* not found"),
        ({"metadata.yaml": METADATA.format("mcap", "", "")}, "lists no files"),
        (
            {"metadata.yaml": METADATA.format("mcap", "a", ", compression_mode: FILE")},
            "compression mode 'FILE'",
        ),
        ({"a.mcap": ""}, "is empty"),
        ({"a.mcap": "\x89MCAP"}, "does not begin as an MCAP file"),
        ({"a.mcap": "time,angle\n0,1\n"}, "does not begin as an MCAP file$"),
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


def test_a_table_given_as_a_recording_is_told_how_it_becomes_one(tmp_path):
    table = tmp_path / "cmm.csv"
    table.write_text("time_s,motor_1_deg\n0,1\n")
    with pytest.raises(RecordingError, match="'wrist-stiffness import' makes one of a table"):
        open_recording(table)
