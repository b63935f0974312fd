"""`--json FILE`: complete, or not at all, and never in the place of something else."""

import json
import os
import threading

import pytest

from wrist_stiffness.cli.output import write_json
from wrist_stiffness.errors import InputError


def test_pipe_gets_the_result_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_text()))
    reader.start()
    # Opened here too, so that the reader ends even if nothing is written.
    guard = os.open(pipe, os.O_WRONLY)
    write_json(pipe, {"s_um": 1.5})
    os.close(guard)
    reader.join()
    assert pipe.is_fifo()
    assert json.loads(received[0]) == {"s_um": 1.5}


def test_link_stays_a_link_to_the_new_result(tmp_path):
    (tmp_path / "results").mkdir()
    target = tmp_path / "results" / "old.json"
    target.write_text("old")
    link = tmp_path / "latest.json"
    link.symlink_to(target)
    write_json(link, [1])
    assert link.is_symlink()
    assert json.loads(target.read_text()) == [1]


@pytest.mark.parametrize("name", ["folder", "missing/x.json"])
def test_unwritable_place_is_one_error_and_leaves_nothing(tmp_path, name):
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_json(tmp_path / name, {})
    assert [path.name for path in tmp_path.rglob("*")] == ["folder"]


def test_failed_write_keeps_the_old_file_and_leaves_nothing_beside(tmp_path, monkeypatch):
    path = tmp_path / "result.json"
    path.write_text("old")

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(InputError, match="No space left"):
        write_json(path, {})
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
