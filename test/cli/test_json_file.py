"""`--json FILE`: complete, or one clear error; devices and links are those of `atomic_file`."""

import os

import pytest

from wrist_stiffness.cli.parser import write_json
from wrist_stiffness.errors import InputError


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
