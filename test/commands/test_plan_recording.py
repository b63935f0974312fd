"""What was recorded before counts; options arrive in the plan with their units."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.commands import plan as workflow
from wrist_stiffness.commands.plan import Options, plan_experiment
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.answer import Diagnosis, Finding
from wrist_stiffness.planning import pool
from wrist_stiffness.planning.information import chance_right
from wrist_stiffness.planning.question import TARE, WRIST
from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.shipped import shipped_file

MODEL = "config/palmieri2015_model.yaml"
LOADS = """
schema: 1
loads:
  - {kind: weight, name: brass, mass_kg: 0.1, point_mm: [20, 0, -18], change_s: 5}
"""
FOUND = Finding(
    (("backlash", "motor_1", 0.5), ("encoder_eccentricity", "motor_1", 0.5)),
    0.99,
    {"width_mdeg": (40.0, 1.0)},
    9.0,
    0.9,
    {},
    "yes",
    "",
    "",
)
NOISE = {"s_um": 1.5, "phi_mdeg": 7.0}
DIAGNOSIS = Diagnosis(
    "effect", 0.99, NOISE, NOISE, NOISE, NOISE, (FOUND,), (), {}, 0.0, (), ()
).as_json()
START_NS = 1_700_000_000_000_000_000
RATE_HZ = 10.0


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Loads and diagnosis; fewer settings to choose from, for the time of the tests."""
    patch = pytest.MonkeyPatch()
    patch.setattr(pool, "POOL", 10)
    folder = tmp_path_factory.mktemp("files")
    (folder / "loads.yaml").write_text(LOADS)
    (folder / "found.json").write_text(json.dumps(DIAGNOSIS))
    yield folder
    patch.undo()


def between(files, recordings=None, **options):
    return plan_experiment(
        shipped_file(MODEL),
        files / "loads.yaml",
        Options(None, in_motion=False, **options),
        files / "found.json",
        recordings,
    )


@pytest.fixture(scope="module")
def alone(files):
    return between(files)


def performed(model, timeline, path):
    """Write the recording of a rigid wrist that performs a plan."""
    time = np.arange(0.0, timeline.duration_s, 1.0 / RATE_HZ)
    ends = np.array([knot[0] for knot in timeline.knots])
    theta, wrench = (
        np.stack(
            [
                np.interp(time, ends, column)
                for column in np.transpose([knot[place] for knot in timeline.knots])
            ],
            axis=1,
        )
        for place in (1, 2)
    )
    turned = Rotation.from_matrix(model.table.mechanism.forward(theta).platform).as_quat()
    joints = ("motor_1_joint", "motor_2_joint")
    with RecordingWriter(path) as writer:
        for at, angles, load, q in zip(
            time, theta.tolist(), wrench.tolist(), turned.tolist(), strict=True
        ):
            stamp = START_NS + round(1e9 * at)
            header = Header(stamp, "wrist_base")
            pose = Pose(Point(0.0, 0.0, 0.0), Quaternion(*q))
            force = Wrench(Vector3(*load[:3]), Vector3(*load[3:]))
            state = JointState(Header(stamp, ""), joints, tuple(angles))
            writer.write("/joint_states", state, stamp)
            writer.write("/load_estimate", WrenchStamped(header, force), stamp)
            writer.write("/platform_pose_measured", PoseStamped(header, pose), stamp)
    return path


@pytest.mark.slow
def test_what_was_recorded_before_calibrates_but_leaves_open_what_is_asked(files, alone, tmp_path):
    """The plan was to settle it and has been performed, yet the diagnosis asks again."""
    model, first = alone.model, alone
    assert all(answer.settled for answer in first.plan.answers)
    recording = performed(model, first.plan.timeline, tmp_path / "day_1")
    second = between(files, Recordings([recording], {}))
    # It is long enough once half of the values that agree with the first recording are told apart.
    assert any(answer.settled for answer in second.plan.answers)
    assert all(chance_right(answer.discrimination) > 0.95 for answer in second.plan.answers)
    assert len(second.plan.visits) >= len(first.plan.visits) > 0
    for name in set(WRIST) - {TARE}:
        assert second.plan.calibration[name] > first.plan.calibration[name], name


def test_options_reach_the_plan_in_si(files, monkeypatch):
    seen = []

    def spy(model, question, conditions, earlier, progress):
        seen.append(conditions)
        raise InputError("far enough")

    monkeypatch.setattr(workflow, "plan", spy)
    options = Options(
        12.0,
        speed_deg_per_s=10.0,
        dwell_s=3.0,
        in_motion=False,
        noise_um=2.0,
        noise_mdeg=5.0,
        seed=4,
    )
    with pytest.raises(InputError, match="far enough"):
        plan_experiment(shipped_file(MODEL), files / "loads.yaml", options)
    (found,) = seen
    assert found.seconds == 720.0
    assert found.pace.speed == pytest.approx(np.radians(10.0))
    assert (found.pace.dwell_s, found.pace.in_motion, found.seed) == (3.0, False, 4)
    assert found.noise.white[:3] == pytest.approx(2e-6)
    assert found.noise.white[3:] == pytest.approx(np.radians(5e-3))
    assert [source.name for source in found.sources] == ["brass"]


def test_values_for_programs_are_those_of_the_plan(alone):
    planned = alone
    values, timeline = planned.as_values(), planned.plan.timeline
    assert values["duration_s"] == timeline.duration_s
    for row, dwell in zip(values["dwells"], timeline.dwells, strict=True):
        assert np.radians([row["motor_1_deg"], row["motor_2_deg"]]) == pytest.approx(
            dwell.visit.theta, abs=1e-6
        )
        assert row["approach"] == "".join("+" if s > 0 else "-" for s in dwell.visit.approach)
        names = [f"{axis}_N" for axis in ("fx", "fy", "fz")]
        names += [f"{axis}_Nm" for axis in ("mx", "my", "mz")]
        assert [row[name] for name in names] == pytest.approx(dwell.wrench, abs=1e-6)
        assert (row["hold_s"], row["load"]) == (dwell.hold_s, dwell.load.name or "none")
    for told, answer in zip(values["answers"], planned.plan.answers, strict=True):
        assert (told["truth"], told["rival"]) == (answer.goal.truth, answer.goal.rival)
        assert told["discrimination"] == answer.discrimination
    assert {answer["settled"] for answer in values["answers"]} == {True}
