"""Why is the platform off?  Shares that add up, uncertainty, the rest, and the command."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.explain import explain
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Load, Sample
from wrist_stiffness.model.budget import budget
from wrist_stiffness.model.model_file import save_model

POSE = np.radians([20.0, -10.0])
LOAD = Load(np.array([0.4, -0.3, -1.0, 0.01, -0.02, 0.005]))


@pytest.fixture(scope="module")
def loaded(model, make):
    return model.with_effects(
        make.effect("link_stiffness@link_1", flexibility_percent=(40.0, 5.0)),
        make.effect("joint_clearance@joint_3", clearance_um=(8.0, 0.5)),
        make.effect("axis_misalignment@joint_1", shift_u_um=(20.0, 1.0), tilt_v_mdeg=10.0),
        make.effect("gravity@link_3", mass_g=30.0, x_mm=20.0),
        make.effect("load_bias@load_sensor", fx_N=(0.1, 0.01)),
        make.effect("joint_friction@joint_2", coefficient=0.3),
    )


@pytest.fixture
def model_path(loaded, tmp_path):
    save_model(loaded, tmp_path / "m.yaml")
    return tmp_path / "m.yaml"


def test_shares_add_up_to_the_twist_with_flanges_in_contact(model, loaded):
    for one in (model, loaded):
        parts = budget(one, Sample(0.0, POSE, LOAD))
        assert one.predict(POSE, LOAD).active.any()
        total = sum(share.twist for share in (*parts.elastic, *parts.effects))
        assert np.allclose(total, parts.twist, rtol=1e-9, atol=1e-16)
        assert np.allclose(parts.second_order, 0.0, atol=1e-15)
        assert np.allclose(parts.twist, one.predict(POSE, LOAD).twist, rtol=1e-12)


def test_without_flanges_elastic_shares_are_those_of_the_compliance(weightless):
    parts = budget(weightless, Sample(0.0, POSE, LOAD))
    configuration = weightless.table.mechanism.forward(POSE)
    shares = weightless.table.shares(configuration) @ LOAD.wrench
    found = np.array([share.twist for share in parts.elastic])
    assert np.allclose(found, shares, rtol=1e-9, atol=1e-18)


def test_a_softer_link_keeps_its_modelled_share(weightless, make):
    """The effect's share is what the change adds, not the part's own flexibility."""
    softer = weightless.with_effects(make.effect("link_stiffness@link_1", flexibility_percent=40.0))
    plain, parts = (budget(m, Sample(0.0, POSE, LOAD)) for m in (weightless, softer))
    assert np.allclose(parts.elastic[0].twist, plain.elastic[0].twist, rtol=1e-9)
    assert np.allclose(parts.effects[0].twist, 0.4 * plain.elastic[0].twist, rtol=1e-9)


@pytest.mark.parametrize("number", [0, 1, 2, 4])
def test_spread_is_what_both_sides_of_a_parameter_move(loaded, number):
    """Against the whole model evaluated again, contact and the other effects included."""
    effect = loaded.effects[number]
    (key, estimate) = next((k, e) for k, e in effect.estimates.items() if e.sigma > 0.0)
    parts = budget(loaded, Sample(0.0, POSE, LOAD))
    square = np.zeros((6, 6))
    for side in (-1.0, 1.0):
        other = effect.with_values({key: estimate.value + side * np.sqrt(3.0) * estimate.sigma})
        effects = [other if e is effect else e for e in loaded.effects]
        moved = loaded.with_effects(*effects).predict(POSE, LOAD).twist - parts.twist
        assert np.linalg.norm(moved) > 0.0
        square += np.outer(moved, moved) / 6.0
    spread = parts.effects[number].spread
    assert np.allclose(spread.T @ spread, square, rtol=1e-6, atol=1e-20)


def test_play_that_more_play_no_longer_moves_is_as_uncertain_as_drawn_ones(model, make):
    """Here the turn of the platform grows up to a clearance of 5 um and stays."""
    play = make.effect("joint_clearance@joint_3", clearance_um=(6.0, 2.0))
    load = Load(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    found = model.with_effects(play).predict(POSE, load)
    clearance = np.linspace(0.0, 14.0, 57)
    models = (model.with_effects(play.with_values({"clearance_um": each})) for each in clearance)
    turns = np.array([each.predict(POSE, load).twist[3:] for each in models])
    axis = found.twist[3:] / found.phi
    drawn = np.abs(np.random.default_rng(0).normal(6.0, 2.0, 20_000))
    spread = np.interp(drawn, clearance, turns @ axis).std()
    plain = model.table_covariance(found.configuration, found.twist)
    stated = np.sqrt(axis @ (found.covariance - plain)[3:, 3:] @ axis)
    assert stated == pytest.approx(spread, rel=0.1)


def test_an_effect_at_its_bound_is_as_uncertain_as_elsewhere(weightless, make):
    """A compliance cannot be negative: what is past the bound is mirrored, not lost."""
    spreads = []
    for value in (0.0, 400.0):
        soft = make.effect("drive_compliance@motor_1", compliance_mdeg_per_Nm=(value, 100.0))
        found = weightless.with_effects(soft).predict(POSE, LOAD)
        plain = weightless.table_covariance(found.configuration, found.twist)
        spreads.append(np.sqrt(np.trace((found.covariance - plain)[3:, 3:])))
    assert spreads[0] == pytest.approx(spreads[1], rel=1e-6)
    assert spreads[0] > 0.0


def test_uncertain_parameters_widen_the_prediction(model, make):
    sure, unsure = (
        model.with_effects(
            make.effect("encoder_offset@motor_1", offset_mdeg=(30.0, sigma))
        ).predict(POSE, LOAD)
        for sigma in (0.0, 20.0)
    )
    column = model.table.mechanism.jacobian(sure.configuration)[:, 0]
    added = np.zeros((6, 6))
    added[3:, 3:] = np.outer(column, column) * np.radians(20e-3) ** 2
    assert np.allclose(unsure.covariance - sure.covariance, added, rtol=1e-6, atol=1e-16)


def pose_off_by(rest, loaded):
    """Return the pose that is a twist away from the predicted one, as an instrument tells it."""
    rotation, shift = exp_twist(loaded.predict(POSE, LOAD).twist + rest)
    turned = rotation @ loaded.table.mechanism.forward(POSE).platform
    return [*shift, *Rotation.from_matrix(turned).as_quat()]


def test_rows_add_up_to_s_and_phi_and_name_the_rest(model_path, loaded):
    predicted = loaded.predict(POSE, LOAD).twist
    rest = np.array([5e-6, 0.0, -2e-6, 1e-5, 0.0, 0.0])
    found = explain(model_path, POSE.tolist(), LOAD, measured=pose_off_by(rest, loaded))
    assert found.measured
    # The row tells the part along the measured shift, the verdict the whole length.
    measured = (predicted + rest)[:3]
    assert found.rows[-1].along[0] == pytest.approx(rest[:3] @ measured / np.linalg.norm(measured))
    assert found.verdict.startswith(
        "in all, whatever the direction, 5.39 um and 0.573 mdeg are not explained, "
    )
    last = found.rows[-1]
    assert last.kind == "rest"
    assert np.allclose(last.twist, rest, atol=1e-12)
    along = np.sum([row.along for row in found.rows], axis=0)
    total = predicted + rest
    assert np.allclose(along, [np.linalg.norm(total[:3]), np.linalg.norm(total[3:])], rtol=1e-6)
    values = found.as_values()
    assert sum(row["s_um"] for row in values["rows"]) == pytest.approx(values["s_um"], rel=1e-6)
    play = next(row for row in values["rows"] if row["name"] == "joint_clearance@joint_3")
    assert "play" in play["meaning"]
    assert play["s_sigma_um"] > 0.0


def test_a_rest_within_the_uncertainty_is_no_reason_to_search(model_path, loaded):
    prediction = loaded.predict(POSE, LOAD)
    size, direction = np.linalg.eigh(prediction.covariance[:3, :3])
    verdicts = []
    for sigmas in (1.9, 2.1):
        moved = np.concatenate([sigmas * np.sqrt(size[2]) * direction[:, 2], np.zeros(3)])
        pose = pose_off_by(moved, loaded)
        verdicts.append(explain(model_path, POSE.tolist(), LOAD, measured=pose).verdict)
    assert "no more than the uncertainty" in verdicts[0]
    assert "2.1 x and 0 x the uncertainty of the prediction in that direction: " in verdicts[1]
    assert "an effect is missing" in verdicts[1]
    assert explain(model_path, POSE.tolist(), LOAD).verdict == ""


def test_an_instrument_that_is_not_registered_is_told_in_plain_numbers(model_path, loaded):
    pose = pose_off_by(np.array([1.2e-3, 0.0, 0.0, 0.0, 0.0, 0.0]), loaded)
    told = explain(model_path, POSE.tolist(), LOAD, measured=pose).verdict
    assert "1200 um" in told
    assert "e+" not in told


def test_where_the_sensor_stands_is_no_reason_why_the_platform_is_off(loaded, make, tmp_path):
    believed = loaded.with_effects(
        *loaded.effects,
        make.effect("measurement_frame@pose_sensor", shift_z_um=(900.0, 20.0)),
        make.effect("target_mounting@pose_sensor", shift_x_um=560.0, turn_x_mdeg=-170.0),
    )
    save_model(believed, tmp_path / "m.yaml")
    found = explain(tmp_path / "m.yaml", POSE.tolist(), LOAD)
    prediction = believed.predict(POSE, LOAD)
    assert np.allclose(found.total, prediction.twist, rtol=1e-9, atol=1e-15)
    assert not any("pose_sensor" in row.name for row in found.rows)
    along = np.sum([row.along for row in found.rows], axis=0)
    assert along[0] == pytest.approx(prediction.shift_norm, rel=1e-6)
    about = found.total[:3] / np.linalg.norm(found.total[:3])
    assert found.sigma[0] == pytest.approx(
        np.sqrt(about @ prediction.covariance[:3, :3] @ about), rel=1e-6
    )
    (note,) = (text for text in found.warnings if "pose_sensor" in text)
    assert "(measurement_frame@pose_sensor, target_mounting@pose_sensor) say where it" in note
    rigid = loaded.table.mechanism.forward(POSE).platform
    pose = [0.001, 0.0, 0.0, *Rotation.from_matrix(rigid).as_quat()]
    measured = explain(tmp_path / "m.yaml", POSE.tolist(), LOAD, measured=pose)
    assert sum("pose_sensor" in row.name for row in measured.rows) == 2
    assert not any("pose_sensor" in text for text in measured.warnings)


def test_an_effect_with_a_past_is_told_to_be_unknown_at_one_pose(model, make, tmp_path):
    worn = model.with_effects(
        make.effect("backlash@motor_2", width_mdeg=80.0),
        make.effect("joint_clearance@joint_3", clearance_um=8.0),
        make.effect("gravity@link_3", mass_g=30.0),
    )
    save_model(worn, tmp_path / "m.yaml")
    (note,) = explain(tmp_path / "m.yaml", POSE.tolist(), LOAD).warnings
    assert note.startswith("effects with a memory (backlash@motor_2) are not known at one pose")


def test_command_prints_a_table_and_writes_json(model_path, tmp_path, capsys):
    out = tmp_path / "out.json"
    angles = ["--angles", "20", "-10", "--load", "0.4", "-0.3", "-1"]
    assert main(["explain", str(model_path), *angles, "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "joint_3 has play" in printed
    assert "predicted" in printed
    values = json.loads(out.read_text())
    assert len(values["rows"]) == 8 + 6
    assert main(["explain", *angles, "--temperature", "link_1=25"]) == 0
    measured = ["--measured", "0.01", "0", "0", "0", "0", "0", "1"]
    assert main(["explain", "--angles", "0", "0", *measured]) == 0
    assert "not explained" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("extra", "text"),
    [
        (["--load", "1"], "--load takes 3 or 6 numbers, not 1"),
        (["--measured", "0", "0", "0", "0", "0", "0", "2"], "length 2.0000, not 1"),
        (["--measured", "nan", "0", "0", "0", "0", "0", "1"], "all finite"),
        (["--measured", "0", "0", "0", "0", "0", "0.2", "0.98"], "23.1 deg (limit 5 deg)"),
        (["--measured", "300", "0", "0", "0", "0", "0", "1"], "more than 100 mm"),
        (["--temperature", "link1=25"], "temperature of 'link1': no such place"),
        (["--temperature", "link_1=warm"], "--temperature link_1=warm: write NAME=NUMBER"),
        (["--covariate", "=3"], "--covariate =3: write NAME=NUMBER"),
        (["--covariate", "a=3", "--covariate", "a=4"], "--covariate a=4: a is 3 already"),
        (["--load", "0", "0", "-9"], "9 N"),
    ],
)
def test_bad_input_is_one_line(model_path, capsys, extra, text):
    assert main(["explain", str(model_path), "--angles", "0", "0", *extra]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


def test_a_covariate_that_nothing_uses_is_told(model, tmp_path):
    """Either of two that a law uses is missed; a misspelt one would be, too."""
    save_model(model, tmp_path / "m.yaml")
    text = (tmp_path / "m.yaml").read_text()
    formula = (
        "effects:\n"
        "- {effect: formula, id: sag, component: link_2, direction: [0, 0, 0, 1, 0, 0],\n"
        "   expression: 'sag_mdeg * clamp * wind', covariates: [clamp, wind],\n"
        "   parameters: {sag_mdeg: 2.0}}"
    )
    (tmp_path / "m.yaml").write_text(text.replace("effects: []", formula))
    given = {"clamp": 1.0, "wind": 2.0, "clmap": 1.0}
    found = explain(tmp_path / "m.yaml", POSE.tolist(), LOAD, covariates=given)
    assert found.warnings == ("covariate clmap: no effect of the model uses it",)


def test_measured_pose_needs_seven_numbers(model_path):
    with pytest.raises(InputError, match="needs x y z qx qy qz qw"):
        explain(model_path, [0.0, 0.0], LOAD, measured=[0.0, 0.0, 0.0])
