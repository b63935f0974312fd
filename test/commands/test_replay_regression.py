"""A stored recording, replayed: equal to stored results, and a command that says what changed.

Where a change was meant, `python test/data/make_replay.py` stores the new results.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.output_changes import output_changes
from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import (
    Float64MultiArray,
    Header,
    JointState,
    JointTrajectory,
    JointTrajectoryPoint,
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
)
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.shipped import shipped_file

FOLDER = Path(__file__).parents[1] / "data/replay"
RECORDING, PARAMETERS = FOLDER / "recording.mcap", FOLDER / "parameters.yaml"
MODELS = {
    "plain": shipped_file("config/palmieri2015_model.yaml"),
    "effects": FOLDER / "effects.yaml",
}


@pytest.mark.parametrize("name", MODELS)
def test_a_replay_gives_what_is_stored(tmp_path, name):
    replay(RECORDING, MODELS[name], tmp_path / "out", node_settings(PARAMETERS))
    changes = output_changes(FOLDER / f"{name}.mcap", tmp_path / "out")
    assert [topic for topic in changes if not topic.same] == []
    assert {topic.topic: topic.common for topic in changes} == {
        "/pose_error_predicted": 104,
        "/pose_error_residual": 106,
        "/motor_commands_corrected": 120,
        "/motor_positions_corrected": 120,
        "/motor_trajectory_corrected": 1,
    }


CHANGES = {
    "width_mdeg: [20.0": "width_mdeg: [20.1",
    "delayed_percent: [30.0": "delayed_percent: [30.1",
    "coefficient: 0.2": "coefficient: 0.201",
    "expansion_ppm_per_K: [70.0": "expansion_ppm_per_K: [70.1",
    "humidity + drag_um": "humidity + 1.01 * drag_um",
    "width_mdeg: [20.0, 2.0]": "width_mdeg: [20.0, 2.01]",
}


@pytest.fixture(scope="module")
def without_commands(tmp_path_factory):
    """The recording, of which a replay only predicts."""
    path = tmp_path_factory.mktemp("recording") / "predicted.mcap"
    with RecordingWriter(path) as writer:
        for each in open_recording(RECORDING).raw_messages():
            if not each.channel.topic.startswith("/motor_"):
                writer.write_raw(each.channel, each.payload, each.log_time_ns)
    return path


@pytest.mark.parametrize("old", CHANGES)
def test_a_small_change_of_any_law_is_seen(tmp_path, without_commands, old):
    text = MODELS["effects"].read_text().replace(old, CHANGES[old])
    assert text != MODELS["effects"].read_text()
    table = shipped_file("precomputed/palmieri2015.npz")
    model = tmp_path / "model.yaml"
    model.write_text(text.replace("../../../precomputed/palmieri2015.npz", str(table)))
    replay(without_commands, model, tmp_path / "out", node_settings(PARAMETERS))
    predicted, *_ = output_changes(FOLDER / "effects.mcap", tmp_path / "out")
    assert predicted.changed > 20


@pytest.mark.slow
def test_the_command_says_what_changed_where_and_by_how_much(tmp_path, capsys):
    command = ["replay", str(RECORDING), "--model", str(MODELS["effects"]), "-o"]
    told = ["--parameters", str(PARAMETERS), "--against", str(FOLDER / "effects.mcap")]
    assert main([*command, str(tmp_path / "same"), *told]) == 0
    assert "/motor_commands_corrected  120 in both, none changed" in capsys.readouterr().out
    result = tmp_path / "result.json"
    loud = tmp_path / "loud.yaml"
    loud.write_text(PARAMETERS.read_text().replace("noise_n: 0.01", "noise_n: 0.02"))
    told[1] = str(loud)
    assert main([*command, str(tmp_path / "loud"), *told, "--json", str(result)]) == 1
    out = capsys.readouterr().out
    assert "/pose_error_predicted      104 in both, 104 changed, first at 1000.000000 s" in out
    assert "covariance [%] by" in out
    assert "s [um] by" not in out
    changed = [topic["changed"] for topic in json.loads(result.read_text())["changes"]]
    assert changed == [104, 0, 0, 0, 0]


def test_against_itself_or_nothing_is_refused_before_the_replay(tmp_path, capsys):
    out = tmp_path / "out"
    command = ["replay", str(RECORDING), "-o", str(out), "--parameters", str(PARAMETERS)]
    assert main([*command, "--against", str(tmp_path / "none")]) == 2
    assert main([*command, "--against", str(out)]) == 2
    assert not out.exists()
    assert main(command) == 0
    assert main([*command, "--overwrite", "--against", str(out)]) == 2
    assert "is the output itself" in capsys.readouterr().err
    with pytest.raises(RecordingError, match="holds no output"):
        output_changes(RECORDING, out)


def pose(stamp_ns, move_um=0.0, turn_mdeg=0.0, sigma=1e-6):
    half = 0.5 * np.radians(1e-3 * turn_mdeg)
    turned = Quaternion(float(np.sin(half)), 0.0, 0.0, float(np.cos(half)))
    spread = tuple((sigma**2 * np.eye(6)).ravel().tolist())
    return PoseWithCovarianceStamped(
        Header(stamp_ns, "wrist_base"),
        PoseWithCovariance(Pose(Point(1e-6 * move_um, 0.0, 0.0), turned), spread),
    )


def write(path, messages):
    with RecordingWriter(path) as writer:
        for topic, message, log_time_ns in messages:
            writer.write(topic, message, log_time_ns)
    return path


def test_differences_are_told_by_quantity_and_stamp(tmp_path):
    """Stamps repeat, arrive at other times, and each run lacks one."""
    topic = "/pose_error_predicted"
    old = [pose(1), pose(2), pose(2, 5.0), pose(3), pose(4)]
    new = [pose(1), pose(2), pose(2, 5.0, 0.3), pose(4, 2.0, -0.2, 1.1e-6), pose(5)]
    found = output_changes(
        write(tmp_path / "old", [(topic, message, i) for i, message in enumerate(old)]),
        write(tmp_path / "new", [(topic, message, i + 70) for i, message in enumerate(new)]),
    )
    (changes,) = found
    assert (changes.common, changes.only_old, changes.only_new) == (4, 1, 1)
    assert (changes.changed, changes.first_ns) == (2, 2)
    sizes = {change.quantity: (change.size, change.stamp_ns) for change in changes.largest}
    assert sizes["s [um]"] == (pytest.approx(2.0, rel=1e-9), 4)
    assert sizes["rotation [mdeg]"] == (pytest.approx(0.3, rel=1e-9), 2)
    assert sizes["covariance [%]"] == (pytest.approx(21.0, rel=1e-9), 4)


STATE = JointState(Header(1, "wrist_corrected"), ("a", "b"), (0.1, 0.2), (0.0, float("nan")))
OTHERS = {
    "angle": (replace(STATE, position=(0.1, 0.2 + 1e-6)), "angle [mdeg]"),
    "speed": (replace(STATE, velocity=(1e-6, float("nan"))), "speed [mdeg/s]"),
    "lost speed": (replace(STATE, velocity=(float("nan"), float("nan"))), "speed [mdeg/s]"),
    "no speeds": (replace(STATE, velocity=()), None),
    "mark": (replace(STATE, header=Header(1, "")), None),
    "names": (replace(STATE, name=("b", "a")), None),
}


@pytest.mark.parametrize(("other", "quantity"), OTHERS.values(), ids=OTHERS)
def test_commands_differ_in_angles_speeds_and_form(tmp_path, other, quantity):
    topic = "/motor_commands_corrected"
    old = write(tmp_path / "old", [(topic, STATE, 1)])
    assert output_changes(old, write(tmp_path / "same", [(topic, STATE, 1)]))[0].same
    (changes,) = output_changes(old, write(tmp_path / "new", [(topic, other, 1)]))
    assert changes.changed == 1
    assert [change.quantity for change in changes.largest] == ([quantity] if quantity else [])


PLAN = JointTrajectory(
    Header(1, "wrist_corrected"), ("a", "b"), (JointTrajectoryPoint((0.1, 0.2), (0.3, 0.4)),) * 2
)
PLANS = {
    "angle": (JointTrajectoryPoint((0.1, 0.3), (0.3, 0.4)), "angle [mdeg]"),
    "speed": (JointTrajectoryPoint((0.1, 0.2), (0.3, 0.5)), "speed [mdeg/s]"),
    "form": (JointTrajectoryPoint((0.1, 0.2)), None),
}


@pytest.mark.parametrize(("point", "quantity"), PLANS.values(), ids=PLANS)
def test_trajectories_differ_in_any_of_their_points(tmp_path, point, quantity):
    topic = "/motor_trajectory_corrected"
    old = write(tmp_path / "old", [(topic, PLAN, 1)])
    other = replace(PLAN, points=(PLAN.points[0], point))
    (changes,) = output_changes(old, write(tmp_path / "new", [(topic, other, 1)]))
    assert changes.changed == 1
    assert [change.quantity for change in changes.largest] == ([quantity] if quantity else [])


def test_messages_without_a_stamp_are_matched_by_their_log_time(tmp_path):
    topic = "/motor_positions_corrected"
    old = write(tmp_path / "old", [(topic, Float64MultiArray(data=(0.1, i)), i) for i in range(3)])
    moved = [(topic, Float64MultiArray(data=(0.1, i + (i == 2))), i) for i in range(1, 3)]
    (changes,) = output_changes(old, write(tmp_path / "new", moved))
    assert (changes.common, changes.only_old, changes.changed, changes.first_ns) == (2, 1, 1, 2)


def test_a_foreign_type_on_an_output_is_refused(tmp_path):
    topic, kind = "/pose_error_predicted", "std_msgs/msg/Int64"
    path = tmp_path / "foreign"
    with RecordingWriter(path) as writer:
        own = channel_of(topic, Float64MultiArray)
        writer.write_raw(replace(own, ros_type=kind), b"\0\1\0\0" + bytes(8), 1)
    with pytest.raises(RecordingError, match=f"{topic} carries {kind}"):
        output_changes(path, path)


def test_the_stored_recording_holds_the_faults_it_is_there_for():
    """Without them the regression would say less than it claims."""
    states = [m for _, _, m in open_recording(RECORDING).messages(["/joint_states"])]
    assert any(np.isnan(state.position).any() for state in states)
    assert {len(state.velocity) for state in states} == {0, 3}
