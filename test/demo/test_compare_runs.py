"""Live against replayed: equal, late by a load, or different for no good reason."""

import numpy as np
import yaml
from compare_runs import compare_runs, pose_message

from wrist_stiffness.commands.replay import replay
from wrist_stiffness.model.block import Sample
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording.messages import Header, JointState, Vector3, Wrench, WrenchStamped
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")
MILLISECOND = 1_000_000
ANGLES = np.radians([5.0, 10.0])


def live_run(path, used_loads):
    """Loads of 0.1 i N and joint states at i ms; the state at i was predicted with a given load."""
    model = load_model(MODEL)
    with RecordingWriter(path) as writer:
        for i, used in enumerate(used_loads):
            ns = (i + 1) * MILLISECOND
            force = Wrench(Vector3(0.0, 0.0, -0.1 * i), Vector3())
            writer.write("/load_estimate", WrenchStamped(Header(ns, "wrist_base"), force), ns)
            names = ("motor_1_joint", "motor_2_joint")
            writer.write("/joint_states", JointState(Header(ns), names, tuple(ANGLES.tolist())), ns)
            if used is not None:
                load = Load(np.array([0.0, 0.0, -0.1 * used, 0.0, 0.0, 0.0]))
                made = model.predict(ANGLES, load)
                message = pose_message(Header(ns, "wrist_base"), made.twist, made.covariance)
                writer.write("/pose_error_predicted", message, ns)


def test_late_loads_are_told_from_other_differences(tmp_path):
    # The state at 2 saw the load of 1, that at 3 a load that never was, 5 was not predicted.
    live_run(tmp_path / "live", [0, 1, 1, 3.5, 4, None])
    replay(tmp_path / "live", MODEL, tmp_path / "replayed")
    found = compare_runs(tmp_path / "live", tmp_path / "replayed", MODEL)
    assert (found.equal, found.late, found.unexplained) == (3, 1, 1)
    assert (found.only_live, found.only_replay) == (0, 1)


def test_a_memory_carries_a_late_load_on(tmp_path):
    """Creep makes every sample after the late one differ, and the late load explains them all."""
    path = tmp_path / "creeping.yaml"
    creep = {"delayed_percent": 50.0, "time_constant_s": 0.1}
    effect = {"effect": "creep", "component": "joint_3", "parameters": creep}
    table = {"path": str(shipped_file("precomputed/palmieri2015.npz"))}
    path.write_text(
        yaml.safe_dump({"schema": 1, "name": "creeping", "table": table, "effects": [effect]})
    )
    used = [0, 1, 1, 3, 4, 4.5, 6]
    session = load_model(path).session()
    with RecordingWriter(tmp_path / "live") as writer:
        for i, taken in enumerate(used):
            ns = (i + 1) * 50 * MILLISECOND
            force = Wrench(Vector3(0.0, 0.0, -0.1 * i), Vector3())
            writer.write("/load_estimate", WrenchStamped(Header(ns, "wrist_base"), force), ns)
            names = ("motor_1_joint", "motor_2_joint")
            writer.write("/joint_states", JointState(Header(ns), names, tuple(ANGLES.tolist())), ns)
            load = Load(np.array([0.0, 0.0, -0.1 * taken, 0.0, 0.0, 0.0]))
            made = session.advance(Sample(ns / 1e9, ANGLES, load))
            message = pose_message(Header(ns, "wrist_base"), made.twist, made.covariance)
            writer.write("/pose_error_predicted", message, ns)
    replay(tmp_path / "live", path, tmp_path / "replayed")
    found = compare_runs(tmp_path / "live", tmp_path / "replayed", path)
    # 0.45 N was never measured: that sample is unexplained, and so is what it leaves behind.
    assert (found.equal, found.late, found.unexplained) == (2, 3, 2)
