"""Replay of recordings with bad samples, cut off, or that are none: what is used, what is said."""

import numpy as np
import pytest
from replayed import MILLISECOND, MOTORS, joints, load, shifts, write

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.messages import String
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")


TIMELINE = [
    (0, "/load_estimate", load(0, (0.0, 0.0, -1.0))),
    (10, "/joint_states", joints(10 * MILLISECOND, (5.0, 10.0))),
]


FAULTS = {
    "missing joint": (
        joints(MILLISECOND, (1.0, 2.0), ("motor_1_joint", "x")),
        "motor_2_joint is miss",
    ),
    "named twice": (joints(MILLISECOND, (1.0, 2.0), ("motor_1_joint",) * 2), "named 2 times"),
    "NaN": (joints(MILLISECOND, (1.0, np.nan)), "not finite"),
    "out of domain": (joints(MILLISECOND, (89.0, 0.0)), "outside the table's domain"),
    "no stamp": (joints(0, (1.0, 2.0)), "has no stamp"),
    "stale load": (joints(900 * MILLISECOND, (1.0, 2.0)), "older than the joint state"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_bad_sample_is_counted_and_the_rest_goes_on(tmp_path, name):
    bad, text = FAULTS[name]
    timeline = [
        (0, "/load_estimate", load(1, (0.0, 0.0, -1.0))),
        (1, "/joint_states", bad),
        (2, "/joint_states", joints(2 * MILLISECOND, (1.0, 2.0))),
    ]
    summary = replay(write(tmp_path / "in", timeline), MODEL, tmp_path / "out")
    assert (summary.joint_states, summary.predictions) == (2, 1)
    (reason,) = summary.refused
    assert text in reason


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (load(0, (0.0, 0.0, -9.0)), "the table ends at 5 N"),
        (load(0, (0.0, np.inf, 0.0)), "not finite"),
        (load(0, (0.0, 0.0, -1.0), "gripper"), "frame 'gripper' is not known"),
    ],
    ids=["range", "inf", "frame"],
)
def test_nothing_is_written_where_no_sample_can_be_used(tmp_path, message, text):
    timeline = [
        (0, "/load_estimate", message),
        (1, "/joint_states", joints(MILLISECOND, (1.0, 2.0))),
    ]
    with pytest.raises(RecordingError, match=f"none of 1 joint states .*{text}"):
        replay(write(tmp_path / "in", timeline), MODEL, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_replay_into_its_own_recording_is_refused(tmp_path, capsys):
    source = write(tmp_path / "in", TIMELINE)
    assert main(["replay", str(source), "-o", str(source / "out")]) == 2
    assert "in is a recording itself" in capsys.readouterr().err
    assert sorted(path.name for path in source.iterdir()) == ["in_0.mcap", "metadata.yaml"]


def test_reasons_that_differ_in_numbers_are_one_and_names_keep_theirs(tmp_path):
    timeline = [(0, "/load_estimate", load(0, (0.0, 0.0, -1.0)))]
    timeline += [(0, "/joint_states", joints(MILLISECOND, (1.0, 2.0)))]
    timeline += [
        (i, "/joint_states", joints((i + 2) * MILLISECOND, (80.0 + i, 0.0))) for i in range(5)
    ]
    for name in MOTORS:
        timeline += [(9, "/joint_states", joints(9 * MILLISECOND, (1.0, 2.0), (name, "x")))]
    summary = replay(write(tmp_path / "in", timeline), MODEL, tmp_path / "out")
    assert sorted(summary.refused.values()) == [1, 1, 5]
    assert any("(80.000, 0.000) deg outside" in reason for reason in summary.refused)


def test_truncated_recording_gives_what_is_there(tmp_path):
    # The notes fill several chunks, so that the cut falls between joint states.
    timeline = [
        (i, *pair)
        for i in range(400)
        for pair in (
            ("/recording_notes", String(f"{i:09d}" * 1000)),
            ("/load_estimate", load(i * MILLISECOND, (0.0, 0.0, -1e-3 * (i % 97)))),
            ("/joint_states", joints(i * MILLISECOND, (1e-2 * (i % 311), 2.0))),
        )
    ]
    source = write(tmp_path / "in.mcap", timeline)
    content = source.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: int(0.5 * len(content))])
    replay(source, MODEL, tmp_path / "whole.mcap")
    summary = replay(tmp_path / "cut.mcap", MODEL, tmp_path / "part.mcap")
    assert summary.damage
    part, whole = shifts(tmp_path / "part.mcap"), shifts(tmp_path / "whole.mcap")
    assert 0 < len(part) < len(whole)
    assert np.array_equal(part, whole[: len(part)])


def test_recording_whose_only_chunk_is_damaged_says_so(tmp_path):
    content = bytearray(write(tmp_path / "in.mcap", TIMELINE[:40]).read_bytes())
    content[200] ^= 0x10
    (tmp_path / "in.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match="the first reason: .*does not match its checksum"):
        replay(tmp_path / "in.mcap", MODEL, tmp_path / "out.mcap")


def test_recording_cut_in_its_first_chunk_says_so(tmp_path):
    source = write(tmp_path / "in.mcap", TIMELINE)
    (tmp_path / "cut.mcap").write_bytes(source.read_bytes()[:300])
    with pytest.raises(RecordingError, match="nothing can be read: .*cut"):
        replay(tmp_path / "cut.mcap", MODEL, tmp_path / "out.mcap")


def test_recordings_that_cannot_be_used(tmp_path, capsys):
    only_loads = write(tmp_path / "loads", [(0, "/load_estimate", load(0, (0.0, 0.0, -1.0)))])
    with pytest.raises(RecordingError, match="no topic /joint_states"):
        replay(only_loads, MODEL, tmp_path / "out")
    whole = write(tmp_path / "whole", TIMELINE)
    with pytest.raises(RecordingError, match="no topic /cmd .*--topic /motor_commands:=ACTUAL"):
        replay(whole, MODEL, tmp_path / "out", remaps={"/motor_commands": "/cmd"})
    assert not (tmp_path / "out").exists()
    assert main(["replay", str(tmp_path / "none"), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("wrist-stiffness: error: ")
    assert error.count("\n") == 1
