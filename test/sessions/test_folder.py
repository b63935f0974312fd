"""Which recordings an argument names."""

import pytest

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.sessions.reading.folder import recordings_in


@pytest.fixture
def campaign(tmp_path):
    """Two bare files, a rosbag2 folder, one that a killed recorder left, and what is none."""
    for name in ("b.mcap", "a.MCAP", "notes.txt"):
        (tmp_path / name).touch()
    for folder, file in (("day_2", "metadata.yaml"), ("day_1", "day_1_0.mcap"), ("cad", "x.step")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).touch()
    return tmp_path


def test_a_folder_stands_for_the_recordings_in_it_by_name(campaign):
    assert [path.name for path in recordings_in([campaign])] == [
        "a.MCAP",
        "b.mcap",
        "day_1",
        "day_2",
    ]


@pytest.mark.parametrize("name", ["day_1", "day_2", "a.MCAP"])
def test_a_recording_stands_for_itself(campaign, name):
    assert list(recordings_in([campaign / name])) == [campaign / name]


def test_none_is_named_twice_and_that_it_was_given_twice_is_known(campaign):
    found = recordings_in([campaign / "b.mcap", campaign])
    assert [path.name for path in found] == ["b.mcap", "a.MCAP", "day_1", "day_2"]
    assert list(found.values()) == [2, 1, 1, 1]


def test_any_other_file_is_left_to_the_reader_which_says_what_it_is(campaign):
    assert list(recordings_in([campaign / "notes.txt"])) == [campaign / "notes.txt"]


@pytest.mark.parametrize(("name", "reason"), [("cad", "no recording"), ("x", "does not exist")])
def test_a_folder_without_recordings_is_an_error(campaign, name, reason):
    with pytest.raises(RecordingError, match=reason):
        recordings_in([campaign / name])
