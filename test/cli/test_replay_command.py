"""`replay`: its summary, its JSON and its options; the replayed numbers are judged elsewhere."""

import json

import numpy as np
import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    String,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.recording.writer import RecordingWriter

MILLISECOND = 1_000_000
MOTORS = ("motor_1_joint", "motor_2_joint")


@pytest.fixture
def recording(tmp_path, monkeypatch):
    """Ten joint states and commands under 1 N; the last two joint states are out of the domain."""
    monkeypatch.chdir(tmp_path)
    with RecordingWriter("run") as writer:
        for i in range(10):
            header = Header((i + 1) * MILLISECOND, "wrist_base")
            load = WrenchStamped(header, Wrench(Vector3(0.0, 0.0, -1.0), Vector3()))
            angles = (float(np.radians(170.0 if i > 7 else i)), 0.1)
            command = JointState(header, MOTORS, (0.01 * i, 0.1))
            writer.write("/load_estimate", load, i * MILLISECOND)
            writer.write("/motor_commands", command, i * MILLISECOND)
            writer.write("/joint_states", JointState(header, MOTORS, angles), i * MILLISECOND)
    return "run"


def test_summary_is_told_to_people_and_programs(recording, capsys):
    assert main(["replay", recording, "-o", "out", "--json", "out.json"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == "8 predictions for 10 joint states, 10 of 10 commands corrected"
    assert shown[-3].startswith("2 refused, the first: /joint_states: motor angles (170.000,")
    assert shown[-2:] == ["written: out", "written: out.json"]
    with open("out.json", encoding="utf-8") as file:
        told = json.load(file)
    (reason,) = told.pop("refused")
    assert "outside the table's domain" in reason
    assert told == {
        "remarks": [],
        "joint_states": 10,
        "predictions": 8,
        "commands": 10,
        "corrections": 10,
        "trajectories": 0,
        "corrected_trajectories": 0,
        "warnings": {},
        "changes": [],
        "damage": "",
    }


def test_that_a_recording_is_of_another_wrist_is_told_first(recording, capsys):
    with RecordingWriter("noted") as writer:
        writer.write("/recording_notes", String('{"geometry_sha256": "ffff"}'), 0)
        for topic, log_time_ns, message in open_recording(recording).messages():
            writer.write(topic, message, log_time_ns)
    assert main(["replay", "noted", "-o", "out", "--json", "out.json"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert "the recording is of another wrist, or its geometry was changed" in first
    with open("out.json", encoding="utf-8") as file:
        assert json.load(file)["remarks"] == [first]


def test_output_may_be_one_file(recording):
    assert main(["replay", recording, "-o", "out.mcap"]) == 0
    counts = {topic.name: topic.count for topic in open_recording("out.mcap").topics}
    assert counts["/pose_error_predicted"] == 8
    assert counts["/joint_states"] == counts["/motor_commands_corrected"] == 10


def test_existing_output_is_kept_unless_asked(recording, refused, capsys):
    for output in ("out", "out.mcap"):
        assert main(["replay", recording, "-o", output]) == 0
        said = refused("replay", recording, "-o", output)
        assert (
            f"{output} exists already and is not overwritten; choose another name, or --ov" in said
        )
    assert main(["replay", "out.mcap", "-o", "out.mcap", "--overwrite"]) == 0
    assert "outputs of an earlier run in the input left out" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--joint", "a"], "--joint names both motors or none, not 1"),
        (["--joint", "a", "--joint", "b"], "none of 10 joint states could be predicted"),
        (["--topic", "/load_estimate:=/ft"], "no topic /ft (it has /joint_states, "),
        (["--topic", "/motor_commands:=/cmd"], "no topic /cmd (it has /joint_states, "),
        (["--topic", "/load_estimate:=/joint_states"], "is sensor_msgs/msg/JointState, not "),
        (["--topic", "/ft:=/load_estimate"], "/ft is not a standard topic"),
        (["--topic", "/load_estimate"], "is not of the form STANDARD:=ACTUAL"),
        (["--model", "missing.yaml"], "missing.yaml: cannot be read"),
    ],
)
def test_refuses_and_writes_nothing(recording, refused, tmp_path, options, named):
    assert named in refused("replay", recording, "-o", "out", *options)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
