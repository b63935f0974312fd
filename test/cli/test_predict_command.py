"""`predict`: the numbers of the error model, in the units of a person, and what is refused."""

import json

import numpy as np
import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.lookup.verification import random_loads
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")
ANGLES_DEG = (20.0, -10.0)


def predicted(tmp_path, *options):
    """Return what `predict --json` wrote at `ANGLES_DEG`."""
    path = tmp_path / "predicted.json"
    angles = ["--angles", *map(str, ANGLES_DEG)]
    assert main(["predict", *angles, *map(str, options), "--json", str(path)]) == 0
    return json.loads(path.read_text())


def direct(wrench):
    return load_model(MODEL).predict(np.radians(ANGLES_DEG), Load(np.array(wrench, dtype=float)))


@pytest.mark.parametrize(
    "load", [(0, 0, -1), (0.3, -0.2, 0.5, 0.01, -0.02, 0.03)], ids=["force", "force and moment"]
)
def test_values_are_those_of_the_error_model(tmp_path, capsys, load):
    told = predicted(tmp_path, "--load", *load)
    prediction = direct([*load, *[0.0] * (6 - len(load))])
    rotation, shift = prediction.motion
    assert told["shift_um"] == pytest.approx(1e6 * shift, rel=1e-12)
    assert told["s_um"] == pytest.approx(1e6 * np.linalg.norm(shift), rel=1e-12)
    # Independent of the twist: the angle of the rotation matrix from its skew part.
    skew = np.array([rotation[2, 1], rotation[0, 2], rotation[1, 0]])
    skew -= np.array([rotation[1, 2], rotation[2, 0], rotation[0, 1]])
    angle_mdeg = 1e3 * np.degrees(np.arcsin(np.linalg.norm(skew) / 2.0))
    assert told["phi_mdeg"] == pytest.approx(angle_mdeg, rel=1e-6)
    shown = capsys.readouterr().out
    assert f"{told['s_um']:.3f} um" in shown
    assert f"{told['phi_mdeg']:.3f} mdeg" in shown


def test_no_load_is_own_weight_alone(tmp_path, capsys):
    told = predicted(tmp_path)
    assert told["shift_um"] == pytest.approx(1e6 * direct(np.zeros(6)).motion[1], rel=1e-12)
    assert told["s_um"] > 0.0
    assert "share" not in capsys.readouterr().out


def test_load_that_turns_with_the_platform(tmp_path):
    load = np.array([0.2, 0.4, -0.6, 0.01, 0.02, -0.01])
    platform = load_model(MODEL).table.mechanism.forward(np.radians(ANGLES_DEG)).platform
    told = predicted(tmp_path, "--load", *load, "--on-platform")
    wanted = direct(block_diagonal(platform) @ load)
    assert told["shift_um"] == pytest.approx(1e6 * wanted.motion[1], rel=1e-9)


def test_energy_shares_add_up_and_tilt_is_the_normals(tmp_path):
    told = predicted(tmp_path, "--load", 0, 0, -1)
    assert sum(told["energy_share"].values()) == pytest.approx(1.0)
    assert min(told["energy_share"].values()) >= 0.0
    table = load_model(MODEL).table
    normal = table.geometry.platform.normal
    platform = table.mechanism.forward(np.radians(ANGLES_DEG)).platform
    tilt = np.degrees(np.arccos(normal @ platform @ normal))
    assert told["tilt_deg"] == pytest.approx(tilt, rel=1e-9)
    assert told["other_evaluation"] is None


@pytest.mark.slow
def test_both_evaluations_agree_within_the_stated_error(tmp_path, capsys):
    told = predicted(tmp_path, "--load", 0, 0, -1, "--both")
    stated = load_model(MODEL).table.header.errors["predicted"]["operative"]
    for name, quantity in (("s_um", "s"), ("phi_mdeg", "phi")):
        other = told["other_evaluation"][name]
        assert told[name] == pytest.approx(other, rel=stated[quantity])
        assert told[name] != other
    assert "by the table's spline: s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--angles", "nan", "0"], "(nan, 0.000) deg: not finite"),
        (["--angles", "inf", "0"], "not finite"),
        (["--angles", "170", "0"], "outside the table's domain"),
        (["--angles", "0", "x"], "'x'"),
        (["--angles", "0", "0", "3.5"], "3.5 is no file; is it a number too many?"),
        (["--angles", "0"], "--angles"),
        ([], "--angles"),
        (["--angles", "0", "0", "--load", "0", "0", "-50"], "force 50 N at O, the table ends at"),
        (["--angles", "0", "0", "--load", "0", "0", "0", "0", "9", "0"], "moment 9 N m at O"),
        (["--angles", "0", "0", "--load", "0", "nan", "0"], "nan"),
        (["--angles", "0", "0", "--load", "1", "2"], "3 or 6 numbers, not 2"),
        (["missing.yaml", "--angles", "0", "0"], "missing.yaml: cannot be read"),
        (["--angles", "0", "0", "--json", "nowhere/out.json"], "folder nowhere does not exist"),
    ],
)
def test_refuses(tmp_path, monkeypatch, refused, options, named):
    monkeypatch.chdir(tmp_path)
    assert named in refused("predict", *options)
    assert list(tmp_path.iterdir()) == []


def test_past_first_order_the_exact_closure_is_told(tmp_path, capsys):
    """A moment as large as the table's range turns the platform by more than 2 mrad somewhere."""
    model = load_model(MODEL)
    rng = np.random.default_rng(26)
    poses = rng.uniform(*model.table.workspace.rectangle, (400, 2))
    poses = poses[model.table.workspace.domain(poses)]
    loads = random_loads(model.table.geometry.limits, len(poses), rng)
    loads[:, 3:] *= 0.0999 / np.linalg.norm(loads[:, 3:], axis=1, keepdims=True)
    found = [model.predict(*pair) for pair in zip(poses, map(Load, loads), strict=True)]
    size = np.array([each.phi for each in found])
    asked = {"below": np.argmin(size), "past": np.argmax(size)}
    assert size[asked["below"]] < 2e-3 < size[asked["past"]]
    told = {}
    for name, index in asked.items():
        path = tmp_path / f"{name}.json"
        angles, load = np.degrees(poses[index]).tolist(), loads[index].tolist()
        options = ["--angles", *map(repr, angles), "--load", *map(repr, load)]
        assert main(["predict", *options, "--json", str(path)]) == 0
        told[name] = json.loads(path.read_text())
        assert ("past first order" in capsys.readouterr().out) == (name == "past")
    assert told["below"]["exact"] is None
    # Finite rotations add terms of the order of the rotation itself, and no more.
    exact, phi = told["past"]["exact"], size[asked["past"]]
    for name in ("s_um", "phi_mdeg"):
        off = abs(exact[name] - told["past"][name])
        assert off > 0.0
        assert off < 10.0 * phi * told["past"][name]
