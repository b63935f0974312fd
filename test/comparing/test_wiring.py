"""A sign, unit or name that a cell got wrong is told, and nothing else is taken for one."""

import re
from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.simulation.cell import CellSettings

POSES = 60
NOISE = np.repeat([0.7e-6, np.radians(1e-3)], 3)


@pytest.fixture(scope="module")
def model(table):
    return ErrorModel("wrist", table, "closed_form")


def session(model, effects=(), on_platform=False, acts=1.0):
    """Poses measured one by one under random loads, of which a share acts on the platform."""
    rng = np.random.default_rng(3)
    theta = rng.uniform(-0.6, 0.6, (POSES, 2))
    load = rng.normal(size=(POSES, 6)) * np.repeat([0.5, 0.01], 3)
    block = Block(2.0 * np.arange(POSES), theta, load, load_on_platform=on_platform)
    noise = rng.normal(size=(POSES, 6)) * NOISE
    acting = replace(block, load=acts * load)
    bent, shift = exp_twist(model.with_effects(*effects).batch(acting).measured)
    wobble, _ = exp_twist(np.hstack([np.zeros((POSES, 3)), noise[:, 3:]]))
    rotation = wobble @ bent @ model.table.mechanism.forward(theta).platform
    return MeasuredSession("day", block, shift + noise[:, :3], rotation, np.diag(NOISE**2))


def told(model, measured):
    return compare_models([("m", model)], [measured]).mistake


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (-1.0, "with the load's sign turned the error falls from"),
        (1e-3, "with the load times 1000"),
        (1.0 / 9.80665, "is it in kilograms?"),
        (1.0 / 4.4482216, r"is it in pounds (lbf)?"),
    ],
    ids=["sign", "kN", "kg", "lbf"],
)
def test_a_load_of_a_wrong_sign_or_unit_is_told(model, factor, words):
    measured = session(model)
    block = replace(measured.block, load=factor * measured.block.load)
    assert words in told(model, replace(measured, block=block))


def test_a_load_that_never_acted_is_told(model, monkeypatch):
    """A weight of the plan that nobody hung on: positions in metres explained it less well."""
    monkeypatch.setitem(globals(), "NOISE", NOISE / 5.0)
    assert "with the load left out the error falls from" in told(model, session(model, acts=0.0))


def test_a_load_in_the_other_frame_is_told(model):
    measured = session(model, on_platform=True)
    block = replace(measured.block, load_on_platform=False)
    assert "the load in the other frame" in told(model, replace(measured, block=block))


def test_positions_in_millimetres_are_told(model):
    points = replace(session(model), rotation=np.full((POSES, 3, 3), np.nan))
    sentence = told(model, replace(points, shift=1e3 * points.shift))
    assert "with positions divided by 1000" in sentence
    assert "are they in mm?" in sentence


@pytest.mark.parametrize("pointed", [True, False], ids=["pose", "points"])
def test_positions_in_metres_where_millimetres_belong_are_told(model, pointed):
    measured = session(model)
    if not pointed:
        measured = replace(measured, rotation=np.full((POSES, 3, 3), np.nan))
    metres = replace(measured, shift=1e-3 * measured.shift, covariance=None)
    sentence = told(model, metres)
    fall = re.search(r"positions times 1000 the error falls from (\S+) to (\S+) um", sentence)
    assert float(fall[1]) > 2.0 * float(fall[2])
    right = compare_models([("m", model)], [replace(measured, covariance=None)]).models[0]
    assert float(fall[2]) == pytest.approx(right.explained.error["s_um"], rel=0.02)
    assert "are they in m where mm belong" in sentence


@pytest.mark.parametrize(
    ("load", "shift", "words"),
    [
        (1.0, 1.0, ""),
        (1.0 / 9.80665, 1.0, "is it in kilograms?"),
        (1.0 / 4.4482216, 1.0, "is it in pounds (lbf)?"),
        (1.0, 1.0 / 25.4, "are they in inches where mm belong"),
        (1.0, 1e3, "are they in mm?"),
    ],
    ids=["right", "kg", "lbf", "inches", "mm"],
)
def test_units_are_told_below_the_noise_of_a_tracker(model, in_the_cell, load, shift, words):
    """A wrong unit leaves 1.3 x the noise: many poses tell it, no single one does."""
    settings = CellSettings(rate_hz=20.0, program_seconds=60.0, instrument="tracker")
    measured = in_the_cell(model.table, settings, 3)
    block = replace(measured.block, load=load * measured.block.load)
    seen = replace(measured, block=block, shift=shift * measured.shift, covariance=None)
    sentence = told(model, seen)
    assert words in sentence if words else sentence == ""


@pytest.mark.parametrize("softer", [2.0, 4.4482216, 9.80665])
def test_a_soft_joint_is_no_wrong_unit(model, softer):
    """Its share of the compliance grows as all would under another unit."""
    law = Effect(find_law("bushing_stiffness"), "joint_1")
    soft = law.with_values({"flexibility_percent": 100.0 * (softer - 1.0)})
    found = compare_models([("m", model)], [session(model, (soft,))])
    assert found.over_noise(found.models[0]) > 1.1
    assert found.mistake == ""


def test_positions_in_metres_are_told_of_a_wrist_that_was_never_calibrated(model):
    axis = Effect(find_law("axis_misalignment"), "joint_2").with_values({"tilt_u_mdeg": 100.0})
    measured = session(model, (axis,))
    metres = replace(measured, shift=1e-3 * measured.shift, covariance=None)
    assert "with positions times 1000" in told(model, metres)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_positions_in_metres_are_told_of_a_tracker_on_a_wrist_within_its_tolerances(
    model, in_the_cell, seed
):
    """Other tolerances may make half or twice the load fit a little better."""
    settings = CellSettings(
        rate_hz=20.0, program_seconds=60.0, instrument="tracker", base="wrong", base_seed=seed
    )
    measured = in_the_cell(model.table, settings, 3)
    metres = replace(measured, shift=1e-3 * measured.shift, covariance=None)
    assert "with positions times 1000" in told(model, metres)


def test_a_wrist_stiffer_than_its_model_is_no_mistake(model):
    """Positions times 1000 would hide what the model says too much."""
    soft = model.with_effects(
        *(
            Effect(find_law("bushing_stiffness"), joint).with_values({"flexibility_percent": 900.0})
            for joint in ("joint_1", "joint_2", "joint_3")
        )
    )
    points = replace(session(model), rotation=np.full((POSES, 3, 3), np.nan))
    found = compare_models([("m", soft)], [points])
    assert found.over_noise(found.models[0]) > 2.0
    assert found.mistake == ""


def test_swapped_motors_are_told_where_no_rotation_names_them(model):
    points = replace(session(model), rotation=np.full((POSES, 3, 3), np.nan))
    swapped = replace(points.block, theta=points.block.theta[:, ::-1])
    assert "with the motors swapped" in told(model, replace(points, block=swapped))


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("bushing_stiffness@joint_1", {"flexibility_percent": 300.0}),
        ("gravity@platform", {"mass_g": 200.0}),
        ("backlash@motor_1", {"width_mdeg": 100.0}),
        ("load_scale@load_sensor", {"scale_percent": 90.0}),
        ("load_bias@load_sensor", {"fz_N": -2.0}),
    ],
)
def test_a_missing_effect_is_no_mistake(model, effect, values):
    law, _, place = effect.partition("@")
    hidden = Effect(find_law(law), place).with_values(values)
    found = compare_models([("m", model)], [session(model, (hidden,))])
    assert found.over_noise(found.models[0]) > 2.0
    assert found.mistake == ""


def test_a_unit_that_makes_all_numbers_small_is_no_mistake(model):
    soft = Effect(find_law("bushing_stiffness"), "joint_1").with_values(
        {"flexibility_percent": 2000.0}
    )
    points = replace(session(model, (soft,)), rotation=np.full((POSES, 3, 3), np.nan))
    found = compare_models([("m", model)], [points])
    assert found.over_noise(found.models[0]) > 2.0
    assert found.mistake == ""


def test_a_mistake_is_told_beside_a_fault_that_it_does_not_touch(model):
    """A gear makes most of phi; the load's sign is seen in s."""
    wave = Effect(find_law("encoder_eccentricity"), "motor_1").with_values({"cos_2_mdeg": 300.0})
    measured = session(model, (wave,))
    assert told(model, measured) == ""
    block = replace(measured.block, load=-measured.block.load)
    assert "with the load's sign turned" in told(model, replace(measured, block=block))


def test_what_explains_a_little_is_not_told(model):
    """Beside large errors of a gear and of a drift the frame of the load hardly matters."""
    wave = Effect(find_law("encoder_eccentricity"), "motor_1").with_values({"cos_2_mdeg": 300.0})
    drift = Effect(find_law("drift"), "pose_sensor").with_values({"shift_x_um_per_h": 900.0})
    measured = session(model, (wave, drift), on_platform=True)
    block = replace(measured.block, load_on_platform=False)
    assert told(model, replace(measured, block=block)) == ""


def test_a_lost_beam_is_no_noise_of_the_instrument(model):
    """One wild reading of sixty; a zone of poses that is off is the model's error."""
    measured = replace(session(model), covariance=None)
    sound = compare_models([("m", model)], [measured])
    shift = measured.shift.copy()
    shift[20, 0] += 9.0
    found = compare_models([("m", model)], [replace(measured, shift=shift)])
    assert (sound.lost, found.lost) == (0, 1)
    assert "Lost beams, left out: 1 of 60 dwells and moments." in found.verdict
    error, usual = found.models[0].explained.error, sound.models[0].explained.error
    assert error["s_um"] == pytest.approx(usual["s_um"], rel=0.2)
    dent = 2e-5 * np.exp(-np.sum(np.square(measured.block.theta / 0.25), axis=1))
    zone = replace(measured, shift=measured.shift + dent[:, None])
    assert compare_models([("m", model)], [zone]).lost == 0
