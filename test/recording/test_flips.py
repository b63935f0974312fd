"""One flipped bit in a recording: the same result, or it is told; and files made to harm."""

import io
import os
import random
import struct
import zlib

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording import open_recording
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import String

FORMS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "none": {"compression": CompressionType.NONE},
    "no message index": {"index_types": IndexType.CHUNK},
    "no summary": {
        "index_types": IndexType.MESSAGE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "loose": {"use_chunking": False, "enable_data_crcs": True},
}
MAGIC = b"\x89MCAP0\r\n"


def stored(entries, **form):
    """Bytes of an MCAP file with every kind of record."""
    out, channels = io.BytesIO(), {}
    writer = Writer(out, chunk_size=1500, **form)
    writer.start("ros2")
    writer.add_attachment(1, 2, "a.txt", "text/plain", b"attached")
    writer.add_metadata("made", {"by": "a test"})
    for topic, time_ns, message in entries:
        if topic not in channels:
            channel = channel_of(topic, type(message))
            schema = writer.register_schema(channel.ros_type, "ros2msg", channel.schema_text)
            channels[topic] = writer.register_channel(topic, "cdr", schema, {"a": "b"})
        writer.add_message(channels[topic], time_ns, encode(message), time_ns)
    writer.finish()
    return out.getvalue()


def records(data):
    """Yield opcode, begin and end of the records of a file."""
    position = len(MAGIC)
    while position < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, position)
        yield Opcode(opcode), position, position + 9 + length
        position += 9 + length


def read(path):
    """All that a recording gives, and what it tells."""
    recording = open_recording(path)
    raw = [(c.topic, c.ros_type, c.schema_text, t, p) for c, t, p in recording.raw_messages()]
    topics = recording.topics
    rows = recording.payloads([info.name for info in topics])
    columns = [(name, times.tolist(), [bytes(row) for row in part]) for name, times, part in rows]
    blocks = [message for block in recording.blocks() for message in block.messages()]
    return (topics, raw, columns, blocks), recording.damage


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_record_taken_for_one_of_another_kind_is_told(tmp_path, timeline, form):
    # Such as the file's header for a message: its profile's length is then channel 4.
    more = [(f"/more_{number}", 10**9 + number, String("x")) for number in range(4)]
    data = stored([*timeline(10), *more], **form)
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    whole, _ = read(path)
    begins = {opcode: begin for opcode, begin, _ in reversed(list(records(data)))}
    for opcode, begin in begins.items():
        for bit in range(8):
            flipped = bytearray(data)
            flipped[begin] ^= 1 << bit
            path.write_bytes(flipped)
            try:
                found, damage = read(path)
            except RecordingError:
                continue
            assert damage or found == whole, (opcode.name, bit)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_flipped_bit_changes_nothing_or_is_told(tmp_path, timeline, form):
    data = stored(timeline(40), **form)
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    whole, damage = read(path)
    assert damage == ""
    generator = random.Random(3)
    kinds = {}
    for opcode, begin, end in records(data):
        kinds.setdefault(opcode, []).append((begin, end))
    for places in kinds.values():
        for _ in range(12):
            byte = generator.randrange(*generator.choice(places))
            flipped = bytearray(data)
            flipped[byte] ^= 1 << generator.randrange(8)
            path.write_bytes(flipped)
            try:
                found, damage = read(path)
            except RecordingError:
                continue
            assert found == whole or damage


@pytest.mark.parametrize("form", ["zstd", "none"])
@pytest.mark.parametrize("byte", [0, 5, 40], ids=["opcode", "length", "compression"])
def test_behind_a_damaged_chunk_reading_goes_on_and_the_loss_is_told(
    tmp_path, timeline, form, byte
):
    entries = list(timeline(60))
    data = bytearray(stored(entries, **FORMS[form]))
    chunks = [begin for opcode, begin, _ in records(data) if opcode == Opcode.CHUNK]
    data[chunks[1] + byte] ^= 0x80
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    recording = open_recording(path)
    found = list(recording.messages())
    lost = [entry for entry in entries if entry not in found]
    assert found == [entry for entry in entries if entry not in lost]
    assert found[0] == entries[0]
    assert found[-1] == entries[-1]
    if form == "zstd":
        times = [time_ns for topic, time_ns, _ in lost if topic == "/joint_states"]
        assert f"{len(times)} of /joint_states ({times[0]} to {times[-1]} ns)" in recording.damage
    if lost:
        assert "/joint_states: 60 messages stated, " in recording.damage
    assert "damaged from byte" in recording.damage or "lost with its chunk" in recording.damage


def test_the_summary_of_another_recording_is_not_believed(tmp_path, timeline):
    data = stored(timeline(20), compression=CompressionType.NONE)
    begin = next(end for opcode, _, end in records(data) if opcode == Opcode.DATA_END)
    summary = data[begin:].replace(b"/joint_states", b"/joint_strait")
    footer = len(summary) - len(MAGIC) - 29
    crc = zlib.crc32(summary[: footer + 25])
    summary = summary[: footer + 25] + struct.pack("<I", crc) + MAGIC
    path = tmp_path / "swapped.mcap"
    path.write_bytes(data[:begin] + summary)
    recording = open_recording(path)
    assert len(list(recording.messages())) == 31
    assert "says channel 2 is '/joint_states', not channel 2 is '/joint_strait'" in recording.damage


def chunk(records, size=None, compression="", start_ns=0):
    """A chunk record; its checksum is left out."""
    name = compression.encode()
    size = len(records) if size is None else size
    head = struct.pack("<QQQII", start_ns, 1, size, 0, len(name)) + name
    body = head + struct.pack("<Q", len(records)) + records
    return struct.pack("<BQ", Opcode.CHUNK, len(body)) + body


def zeros(compression, size):
    packer = {"zstd": zstandard.ZstdCompressor().compress, "lz4": lz4.frame.compress}
    return packer[compression](bytes(size))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize(
    ("size", "stated", "why"),
    [
        (1 << 20, 1000, "its header"),
        (1 << 20, 1 << 20, "no record at byte 0 of it"),
        (1000, 1 << 40, "states 1099511627776 bytes, more than 67108864"),
        (1000, 1 << 25, "its header"),
    ],
)
def test_a_chunk_never_unpacks_to_more_than_it_may(tmp_path, compression, size, stated, why):
    path = tmp_path / "bomb.mcap"
    path.write_bytes(MAGIC + chunk(zeros(compression, size), stated, compression))
    recording = open_recording(path)
    assert list(recording.messages()) == []
    assert why in recording.damage


def test_times_that_ros_cannot_count_are_told(tmp_path, timeline):
    data = stored([("/a", 2**63 + 5, next(timeline(1))[2])])
    path = tmp_path / "late.mcap"
    path.write_bytes(data)
    recording = open_recording(path)
    assert list(recording.messages()) == []
    assert list(recording.payloads(["/a"])) == []
    assert "1 of /a (9223372036854775813 to 9223372036854775813 ns)" in recording.damage


def test_chunks_that_all_overlap_do_not_take_all_memory(tmp_path):
    # At its end, so that no chunk may be given before the last one is opened.
    message = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22, 1, 0, 1, 1)
    padding = (1 << 25) - 31
    filler = struct.pack("<BQ", 0x90, padding - 9) + bytes(padding - 9)
    packed = zstandard.ZstdCompressor().compress(message + filler)
    channel = struct.pack("<HH", 1, 0) + b"\x02\x00\x00\x00/a" + b"\x03\x00\x00\x00cdr" + bytes(4)
    path = tmp_path / "overlapping.mcap"
    declared = struct.pack("<BQ", Opcode.CHANNEL, len(channel)) + channel
    path.write_bytes(MAGIC + declared + 12 * chunk(packed, 1 << 25, "zstd"))
    with pytest.raises(RecordingError, match="chunks of .* bytes overlap at 0 ns, more than"):
        list(open_recording(path).raw_messages())


def test_what_is_no_file_is_no_recording(tmp_path):
    os.mkfifo(tmp_path / "pipe.mcap")
    for path, why in {
        tmp_path / "pipe.mcap": "a pipe or a device",
        "/dev/zero": "a pipe or a device",
        tmp_path / ("a" * 300): "does not exist",
    }.items():
        with pytest.raises(RecordingError, match=why):
            open_recording(path)


def test_a_summary_is_held_against_its_checksum(tmp_path, timeline):
    data = bytearray(stored(timeline(40)))
    begin = next(begin for opcode, begin, _ in records(data) if opcode == Opcode.CHUNK_INDEX)
    data[begin + 20] ^= 1
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    recording = open_recording(path)
    assert len(list(recording.messages())) == 61
    assert "the summary does not match its checksum" in recording.damage
