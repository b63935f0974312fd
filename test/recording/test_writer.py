"""What a writer leaves behind, whatever happens."""

import errno
import os
import random
import resource
import string
from pathlib import Path

import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore
from undamaged import undamaged

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.chunk_writer import CHUNK_BYTES
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    Pose,
    PoseStamped,
    String,
)

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
FORMS = pytest.mark.parametrize("name", ["bag", "file.mcap"], ids=["folder", "bare"])


@FORMS
def test_equal_messages_give_equal_bytes(tmp_path, name, timeline, written, mcap_of):
    (tmp_path / "elsewhere").mkdir()
    first = written(tmp_path / name, timeline(400))
    second = written(tmp_path / "elsewhere" / f"other_{name}", timeline(400))
    assert mcap_of(first).read_bytes() == mcap_of(second).read_bytes()


@FORMS
def test_an_exception_leaves_nothing_behind(tmp_path, name, timeline):
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
def test_an_existing_recording_is_replaced_only_on_request(
    tmp_path, name, timeline, written, mcap_of, hidden_in
):
    path = written(tmp_path / name, timeline(5))
    before = mcap_of(path).read_bytes()
    with pytest.raises(RecordingError, match="exists already"), RecordingWriter(path):
        pass
    assert mcap_of(path).read_bytes() == before
    with RecordingWriter(path, overwrite=True) as writer:
        writer.write("/covariates/a", Float64(1.0), 1)
        assert mcap_of(path).read_bytes() == before
    assert len(list(undamaged(path).messages())) == 1
    assert hidden_in(tmp_path) == []


@FORMS
@pytest.mark.parametrize("keep", [False, True])
def test_of_two_writers_of_one_recording_the_later_one_is_told(
    tmp_path, name, keep, timeline, written, mcap_of, hidden_in
):
    path, other = tmp_path / name, written(tmp_path / f"other_{name}", timeline(5))
    first = mcap_of(other).read_bytes()

    def be_overtaken():
        with RecordingWriter(path, keep_partial=keep) as writer:
            writer.write("/covariates/a", Float64(1.0), 1)
            other.rename(path)

    with pytest.raises(RecordingError, match="another program has written it meanwhile"):
        be_overtaken()
    assert mcap_of(path).read_bytes() == first
    # What was live comes only once.
    kept = [each for each in tmp_path.iterdir() if each != path]
    assert [len(list(open_recording(each).messages())) for each in kept] == [1] * keep
    assert hidden_in(tmp_path) == []


def test_a_failed_replacement_keeps_the_old_recording(tmp_path, timeline, written, hidden_in):
    path = written(tmp_path / "bag", timeline(5))

    def replace_and_fail():
        with RecordingWriter(path, overwrite=True) as writer:
            writer.write("/covariates/a", "no message", 1)

    with pytest.raises(AttributeError):
        replace_and_fail()
    assert len(list(undamaged(path).messages())) == 9
    assert hidden_in(tmp_path) == []


def test_a_folder_with_anything_else_in_it_is_never_replaced(tmp_path, timeline, written):
    path = written(tmp_path / "bag", timeline(5))
    (path / "thesis.tex").write_text("years of work")
    with (
        pytest.raises(RecordingError, match="never overwritten"),
        RecordingWriter(path, overwrite=True),
    ):
        pass
    assert (path / "thesis.tex").exists()


def test_metadata_is_what_rosbags_states_for_the_same_messages(tmp_path, timeline, written):
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


def test_an_empty_recording_is_a_recording(tmp_path, written):
    path = written(tmp_path / "bag", [])
    recording = undamaged(path)
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
    assert len(list(undamaged(tmp_path / "bag").messages())) == 1


@pytest.mark.parametrize("name", ["file.mcap", "folder"])
def test_a_signal_before_the_first_message_leaves_nothing_behind(tmp_path, monkeypatch, name):
    def interrupted(*_, **__):
        assert list(tmp_path.iterdir()) != []
        raise KeyboardInterrupt

    monkeypatch.setattr("wrist_stiffness.recording.writer.ChunkWriter.__init__", interrupted)
    with pytest.raises(KeyboardInterrupt), RecordingWriter(tmp_path / name):
        raise AssertionError("never begun")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_parent_folder_is_named(tmp_path):
    with (
        pytest.raises(RecordingError, match="nowhere does not exist"),
        RecordingWriter(tmp_path / "nowhere" / "bag"),
    ):
        pass


@pytest.mark.parametrize("overwrite", [False, True])
def test_the_current_folder_is_no_name_for_a_recording(tmp_path, monkeypatch, overwrite):
    (tmp_path / "thesis.tex").write_text("years of work")
    monkeypatch.chdir(tmp_path)
    with (
        pytest.raises(RecordingError, match="overwritten"),
        RecordingWriter("", overwrite=overwrite),
    ):
        pass
    assert [entry.name for entry in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.fixture
def grown_files():
    """Let no file of this process grow beyond so much: as on a full disk, writing is refused."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda limit: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def smallest_files(grown_files):
    grown_files(4096)


@FORMS
def test_a_disk_that_is_read_only_is_one_error(tmp_path, name, monkeypatch):
    """It refuses to remove, too: also what is not there."""

    def refused(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    for each in ("mkdir", "open", "unlink"):
        monkeypatch.setattr(Path, each, refused)
    with (
        pytest.raises(RecordingError, match=f"{name} cannot be written: Read-only file system"),
        RecordingWriter(tmp_path / name),
    ):
        pass


@FORMS
def test_a_disk_that_refuses_the_end_leaves_one_line_and_nothing_else(
    tmp_path, name, smallest_files
):
    with (
        pytest.raises(RecordingError, match=f"{name} cannot be written: File too large"),
        RecordingWriter(tmp_path / name) as writer,
    ):
        writer.write("/recording_notes", noise(2 * 4096), 1)
    assert list(tmp_path.iterdir()) == []


@FORMS
def test_a_recording_of_which_a_message_was_refused_is_not_finished(tmp_path, name, smallest_files):
    writer = RecordingWriter(tmp_path / name)
    writer.__enter__()
    with pytest.raises(RecordingError, match="File too large"):
        writer.write("/recording_notes", noise(2 * CHUNK_BYTES), 1)
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))  # Somebody has made room.
    with pytest.raises(RecordingError, match="File too large"):
        writer.__exit__(None, None, None)
    assert list(tmp_path.iterdir()) == []


@FORMS
def test_after_a_refusal_nothing_is_taken_that_could_not_be_read(tmp_path, name, grown_files):
    """A live recording takes what it has heard meanwhile, and somebody may have made room."""
    writer = RecordingWriter(tmp_path / name, keep_partial=True)

    def fill():
        for n in range(1, 501):
            writer.write("/recording_notes", noise(1000, seed=n), n)

    writer.__enter__()
    grown_files(2 * CHUNK_BYTES)
    with pytest.raises(RecordingError, match="File too large"):
        fill()
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    with pytest.raises(RecordingError, match=f"{name} cannot be written: File too large$"):
        writer.write("/recording_notes", noise(1000), 501)
    with pytest.raises(RecordingError, match="File too large; the first .* messages are kept"):
        writer.__exit__(None, None, None)


@FORMS
@pytest.mark.parametrize("when", ["while it writes", "as it ends"])
def test_of_a_live_recording_that_fills_the_disk_all_whole_chunks_are_kept(
    tmp_path, name, when, grown_files
):
    path, kept = tmp_path / name, tmp_path / f"{name.removesuffix('.mcap')}.partial"
    kept = kept.with_name(f"{kept.name}.mcap") if name.endswith(".mcap") else kept
    entries = [(n, noise(1000, seed=n)) for n in range(1, 501)]

    def write():
        with RecordingWriter(path, keep_partial=True) as writer:
            for n, message in entries:
                writer.write("/recording_notes", message, n)
                if n == 400 and when == "as it ends":
                    grown_files(4096)
                    return

    if when == "while it writes":
        grown_files(3 * CHUNK_BYTES)
    with pytest.raises(RecordingError, match=f"{name} cannot be written: File too") as caught:
        write()
    assert list(tmp_path.iterdir()) == [kept]
    recording = open_recording(kept)
    found = [(time_ns, message) for _, time_ns, message in recording.messages()]
    assert found == entries[: len(found)]
    assert len(found) > 250
    assert str(caught.value).endswith(f"; the first {len(found)} messages are kept in {kept}")
    assert f"{len(found)} messages can be read" in recording.damage
    # The next one that fills the disk must not cost this one.
    with (
        pytest.raises(RecordingError, match=f"{kept.name} exists already, a part of an earlier"),
        RecordingWriter(path, keep_partial=True),
    ):
        pass


def test_of_a_live_recording_without_room_for_its_metadata_nothing_is_lost(tmp_path, monkeypatch):
    def refused(path, text, encoding):
        with path.open("w", encoding=encoding) as stream:
            stream.write(text[:40])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", refused)
    with (
        pytest.raises(RecordingError, match="No space left on device; the first 1 messages"),
        RecordingWriter(tmp_path / "bag", keep_partial=True) as writer,
    ):
        writer.write("/covariates/a", Float64(1.0), 1)
    assert len(list(open_recording(tmp_path / "bag.partial").messages())) == 1


@FORMS
def test_of_a_live_recording_nothing_is_kept_where_nothing_was_written(
    tmp_path, name, smallest_files
):
    with (
        pytest.raises(RecordingError, match=f"{name} cannot be written: File too large$"),
        RecordingWriter(tmp_path / name, keep_partial=True) as writer,
    ):
        writer.write("/recording_notes", noise(2 * 4096), 1)
    assert list(tmp_path.iterdir()) == []


def noise(characters, seed=1):
    """Return a text that no compression makes small."""
    return String("".join(random.Random(seed).choices(string.printable, k=characters)))
