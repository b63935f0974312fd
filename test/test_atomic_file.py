"""A file that the project writes is complete or not there, and never in the place of a device."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from wrist_stiffness.atomic_file import replacing, require_room
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.shipped import shipped_file


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_text()))
    reader.start()
    # Opened here too, so that the reader ends even if nothing is written.
    guard = os.open(pipe, os.O_WRONLY)
    save_model(load_model(shipped_file("config/palmieri2015_model.yaml")), pipe)
    os.close(guard)
    reader.join()
    assert pipe.is_fifo()
    assert received[0].startswith("schema: 1")


def test_a_link_stays_a_link_to_the_new_file(tmp_path):
    target, link = tmp_path / "old", tmp_path / "latest"
    target.write_text("old")
    link.symlink_to(target)
    with replacing(link) as written:
        written.write_text("new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_room_is_asked_for_where_the_file_will_be_and_of_no_device(tmp_path):
    link = tmp_path / "latest"
    link.symlink_to("/proc/old")
    with pytest.raises(InputError, match="latest: cannot be written: No such file"):
        require_room(link)
    require_room(tmp_path / "model.yaml")
    assert list(tmp_path.iterdir()) == [link]
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    require_room(pipe)


def test_what_stops_half_way_leaves_the_old_file_alone(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("old")

    def interrupted():
        with replacing(path) as written:
            written.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_model_that_cannot_be_put_in_its_place_leaves_nothing_beside(tmp_path, monkeypatch):
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(InputError, match="No space left"):
        save_model(model, tmp_path / "m.yaml")
    assert list(tmp_path.iterdir()) == []


BEGUN = """
import sys
from pathlib import Path
from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.recording.writer import RecordingWriter

with RecordingWriter(sys.argv[1], overwrite=True), replacing(sys.argv[2]) as written:
    Path(written).write_text("half")
    print("begun", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("name", ["a.mcap", "bag"])
def test_what_a_killed_process_left_is_removed_by_the_next_writer_of_the_same(tmp_path, name):
    def write():
        with RecordingWriter(tmp_path / name, overwrite=True), replacing(tmp_path / "m") as written:
            written.write_text("new")

    command = [sys.executable, "-c", BEGUN, str(tmp_path / name), str(tmp_path / "m")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"begun\n"
        of_others = tmp_path / ".other.1-1.partial"
        of_others.touch()
        begun = {each for each in tmp_path.iterdir() if each != of_others}
        assert len(begun) == 2
        write()
        assert begun < set(tmp_path.iterdir())
        other.send_signal(signal.SIGKILL)
    # What was live comes only once.
    with RecordingWriter(tmp_path / name, overwrite=True, keep_partial=True):
        assert begun < set(tmp_path.iterdir())
    write()
    assert set(tmp_path.iterdir()) == {tmp_path / name, tmp_path / "m", of_others}
