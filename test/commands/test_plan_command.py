"""The command `plan`: files that others can use, errors that name place and value."""

import csv
import json

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from wrist_stiffness.cli.main import main
from wrist_stiffness.inference.answer import Diagnosis, Finding, NotExcited
from wrist_stiffness.model.model_file import file_sha256
from wrist_stiffness.planning import pool
from wrist_stiffness.planning.aims import Answer
from wrist_stiffness.planning.information import Goal
from wrist_stiffness.planning.plan import Plan
from wrist_stiffness.report.plan import plan_summary
from wrist_stiffness.shipped import shipped_file

LOADS = """
schema: 1
loads:
  - kind: actuator
    name: gripper
    frame: wrist_platform
    force_min_N: [-1, -1, -1]
    force_max_N: [1, 1, 1]
    moment_min_Nm: [0, 0, 0]
    moment_max_Nm: [0, 0, 0]
    point_mm: [0, 0, -18]
    change_s: 1
"""

FOUND = Finding(
    (("backlash", "motor_1", 0.5), ("drive_compliance", "motor_1", 0.5)),
    0.99,
    {"width_mdeg": (20.0, 1.0), "called_otherwise": (1.0, 0.1)},
    9.0,
    0.9,
    {},
    "yes",
    "",
    "",
)
NOISE = {"s_um": 1.5, "phi_mdeg": 7.0}
DIAGNOSIS = Diagnosis(
    "effect",
    0.99,
    NOISE,
    NOISE,
    NOISE,
    NOISE,
    (FOUND,),
    (),
    {},
    0.0,
    (),
    (NotExcited("thermal_softening", "joint_3", "warmth"),),
).as_json()


@pytest.fixture(scope="module", autouse=True)
def small_pool():
    """Fewer settings to choose from, for the time of the tests."""
    patch = pytest.MonkeyPatch()
    patch.setattr(pool, "POOL", 10)
    yield
    patch.undo()


def files(folder, diagnosis=DIAGNOSIS, loads=LOADS):
    (folder / "loads.yaml").write_text(loads)
    (folder / "found.json").write_text(json.dumps(diagnosis))
    return ["--diagnosis", str(folder / "found.json"), "--loads", str(folder / "loads.yaml")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    arguments = [*files(folder), "-o", str(folder / "next"), "--json", str(folder / "next.json")]
    assert main(["plan", *arguments]) == 0
    return folder


@pytest.fixture(scope="module")
def rows(folder):
    with (folder / "next/plan.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def trajectory(folder):
    with AnyReader([folder / "next/trajectory"]) as reader:
        ((connection, _, raw),) = reader.messages()
        assert connection.topic == "/motor_trajectory"
        return reader.deserialize(raw, connection.msgtype)


def test_trajectory_rests_where_the_table_says(rows, trajectory):
    assert list(trajectory.joint_names) == ["motor_1_joint", "motor_2_joint"]
    points = trajectory.points
    time = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points])
    theta = np.degrees([p.positions for p in points])
    assert time[0] > 0.0
    assert np.all(np.diff(time) > 0.0)
    assert not any(np.any(p.velocities) or np.any(p.accelerations) for p in points)
    for row in rows:
        begin, hold = float(row["time_s"]), float(row["hold_s"])
        for moment in (begin + 0.01 * hold, begin + 0.99 * hold):
            for motor in range(2):
                there = np.interp(moment, time, theta[:, motor])
                assert there == pytest.approx(float(row[f"motor_{motor + 1}_deg"]), abs=1e-3)


def test_table_summary_picture_and_json_belong_together(folder, rows):
    values = json.loads((folder / "next.json").read_text())
    assert len(values["dwells"]) == len(rows)
    assert all(answer["settled"] for answer in values["answers"])
    assert values["cannot"].keys() == {"thermal_softening@joint_3"}
    summary = (folder / "next/summary.txt").read_text()
    assert "backlash@motor_1 if true, against drive_compliance@motor_1" in summary
    assert "thermal_softening@joint_3: needs temperature of" in summary
    assert "Carry it out twice" in summary
    assert (folder / "next/plan.png").read_bytes().startswith(b"\x89PNG")
    loaded = [row for row in rows if row["load"] == "gripper"]
    assert loaded
    assert all(any(float(row[f"f{axis}_N"]) for axis in "xyz") for row in loaded)
    assert float(rows[-1]["time_s"]) < values["duration_s"]


def test_the_summary_counts_and_loads_are_those_of_the_table(folder, tmp_path, capsys):
    """A short commissioning has its load in the long holds alone, and said "loads: none"."""
    arguments = ["--commissioning", "--minutes", "3.5", *files(tmp_path)[2:]]
    assert main(["plan", *arguments, "-o", str(tmp_path / "first")]) == 0
    for made in (tmp_path / "first", folder / "next"):
        with (made / "plan.csv").open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        poses = len({(row["motor_1_deg"], row["motor_2_deg"]) for row in rows})
        first, by_hand, _ = (made / "summary.txt").read_text().splitlines()[:3]
        assert f"to {poses} poses; {len(rows)} measurements at rest; loads: gripper" in first
        assert "take it off after the row" in by_hand


def test_the_table_to_fill_in_has_every_turn_and_is_imported(folder, rows, tmp_path):
    """Of `plan.csv` alone a backlash of 68 mdeg was noise: the sides of approach were lost."""
    with (folder / "next/path.csv").open(newline="") as stream:
        header, *path = csv.reader(stream)
    times = [line[0] for line in path]
    for row in rows:
        at = times.index(row["time_s"])
        assert path[at][1:3] == path[at + 1][1:3] == [row["motor_1_deg"], row["motor_2_deg"]]
        assert path[at + 1][3:] == [row[name] for name in header[3:]]
        before = next(line for line in reversed(path[:at]) if line[1:3] != path[at][1:3])
        came = [float(to) > float(of) for to, of in zip(path[at][1:3], before[1:3], strict=True)]
        assert came == [side == "+" for side in row["approach"]]
    table, rests = tmp_path / "filled.csv", {row["time_s"] for row in rows}
    with table.open("w", newline="") as stream:
        filled = ([*line, "0.001" if line[0] in rests else ""] for line in path)
        csv.writer(stream).writerows([[*header, "z_mm"], *filled])
    assert main(["import", str(table), "-o", str(tmp_path / "filled")]) == 0


def test_what_many_rivals_leave_open_is_a_line_for_each_truth():
    rivals = {"creep@joint_1": 0.5, "backlash@motor_1": 0.25, "": 0.75, "gravity@link_3": 0.0}
    answers = tuple(Answer(Goal("inertia@platform", r), d, True) for r, d in rivals.items())
    lines = []
    for some in (answers[:2], answers[2:3], answers[3:]):
        lines += plan_summary(Plan(None, (), some, {}, {})).splitlines()[-1:]
    assert lines == [
        "  inertia@platform if true, against backlash@motor_1 and 1 more: 0.2 standard deviations, "
        "right in 55 %",
        "  inertia@platform against nothing: 0.8 standard deviations",
        "  inertia@platform if true, against gravity@link_3: not told apart",
    ]


def test_an_existing_folder_is_refused_before_any_work(folder, capsys):
    arguments = [*files(folder), "-o", str(folder / "next")]
    assert main(["plan", *arguments]) == 2
    error = capsys.readouterr().err
    assert "exists already and is not overwritten; choose another name or remove it" in error


def test_nothing_is_left_where_the_plan_cannot_be_written(tmp_path, capsys):
    arguments = [*files(tmp_path), "-o", str(tmp_path / "absent/next")]
    assert main(["plan", *arguments]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {"loads.yaml", "found.json"}


def test_what_no_load_can_settle_is_a_no_and_writes_nothing(tmp_path, capsys):
    silent = [{"effect": "drive_compliance", "component": "motor_1", "needs": "torque"}]
    diagnosis = {**DIAGNOSIS, "findings": [], "not_excited": silent}
    diagnosis["noise"] = {"s_um": 500.0, "phi_mdeg": 5000.0}
    arguments = [*files(tmp_path, diagnosis), "-o", str(tmp_path / "next")]
    assert main(["plan", *arguments]) == 1
    out = capsys.readouterr().out
    assert "no plan: nothing that these loads allow would settle any of the questions" in out
    assert "drive_compliance@motor_1 against nothing" in out
    assert not (tmp_path / "next").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"schema": 1},
            "schema: 1 is not 2, the version that this program reads: make the file anew with it",
        ),
        ({"findings": {}}, "found.json: findings: {} is not a list"),
        ({"noise": {"s_um": 0.0, "phi_mdeg": 1.0}}, "noise.s_um: 0.0 is not above 0"),
        ({"noise": {"gauges_um": 1.0}}, "position and rotation, not gauges_um alone"),
        ({"noise": {"s_um": 1.0}}, "not s_um alone"),
        (
            {"findings": [{"class": [], "parameters": {}}]},
            "findings[0].class: 0 entries, needs a list of at least 1",
        ),
        (
            {"findings": [{"class": [{"effect": "magic", "component": "joint_1"}]}]},
            "findings[0].class[0]: unknown effect 'magic'",
        ),
        (
            {"not_excited": [{"effect": "creep", "component": "link_1", "needs": ""}]},
            "not_excited[0]: creep: component 'link_1' is not one of joint_1",
        ),
        ({"findings": [], "not_excited": []}, "the diagnosis leaves nothing to separate"),
    ],
)
def test_errors_of_the_diagnosis_name_their_place(tmp_path, capsys, change, words):
    arguments = files(tmp_path, {**DIAGNOSIS, **change})
    assert main(["plan", *arguments, "-o", str(tmp_path / "next")]) == 2
    assert words in capsys.readouterr().err


def test_another_model_than_the_one_diagnosed_is_told(tmp_path, capsys):
    for name, told in (("other", True), ("palmieri2015_model", False)):
        model = shipped_file("config/palmieri2015_model.yaml")
        sha256 = "00" if told else file_sha256(model)
        made_from = {"models": {name: sha256}, "recordings": {"day_1": "11"}}
        arguments = files(tmp_path, {**DIAGNOSIS, "provenance": made_from})
        assert main(["plan", *arguments, "--minutes", "4", "-o", str(tmp_path / name)]) == 0
        first = (tmp_path / name / "summary.txt").read_text().splitlines()[0]
        assert first in capsys.readouterr().out
        words = f"{model} is not what {tmp_path / 'found.json'} was made from: give the model and"
        assert first.startswith(words) == told


def test_the_result_of_another_command_is_told(tmp_path, capsys):
    compared = {key: DIAGNOSIS[key] for key in ("schema", "noise")}
    assert main(["plan", *files(tmp_path, compared), "-o", str(tmp_path / "next")]) == 2
    words = (
        "found.json: no diagnosis of one wrist; 'diagnose --json FILE' without --each writes one"
    )
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--minutes", "-1"], "minutes = -1 is not a positive number"),
        (["--minutes", "1e9"], "1e+09 minutes are more than 120"),
        (["--speed", "0"], "speed_deg_per_s = 0 is not a positive number"),
        (["--seed", "-3"], "seed -3 is below 0"),
    ],
)
def test_errors_of_options(tmp_path, capsys, options, words):
    assert main(["plan", *files(tmp_path), *options, "-o", str(tmp_path / "next")]) == 2
    assert words in capsys.readouterr().err


def test_a_commissioning_needs_a_duration(tmp_path, capsys):
    # Said before any file is read: none of these is there.
    arguments = ["none.yaml", "--commissioning", "--loads", "none.yaml", "-o", str(tmp_path / "a")]
    assert main(["plan", *arguments]) == 2
    assert "error: give --minutes: how long the commissioning may take" in capsys.readouterr().err


def test_files_that_cannot_be_read(tmp_path, capsys):
    files(tmp_path)
    for name, words in (("absent.json", "cannot be read"), ("loads.yaml", "not a JSON file")):
        arguments = ["--diagnosis", str(tmp_path / name), "--loads", str(tmp_path / "loads.yaml")]
        assert main(["plan", *arguments, "-o", str(tmp_path / "next")]) == 2
        assert words in capsys.readouterr().err
