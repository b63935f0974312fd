"""Which tolerance costs how much: against one alone, and on any number of processes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.commands.tolerances import (
    WRISTS_AT_A_TIME,
    _block,
    _wrists,
    study_tolerances,
    tolerances_of,
)
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.report.pictures.tolerances import draw_tolerances
from wrist_stiffness.shipped import shipped_file

MODEL = Path(shipped_file("config/palmieri2015_model.yaml"))
LOAD = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
WRISTS = 3 * WRISTS_AT_A_TIME


def alone(law, place, key, sigma):
    """Return what one tolerance does by itself, RMS over poses of s [um] and phi [mdeg]."""
    model = load_model(MODEL)
    block = _block(model.table, LOAD)
    up, down = (
        model.with_effects(Effect(find_law(law), place, {key: Estimate(sign * 0.1 * sigma)}))
        for sign in (1.0, -1.0)
    )
    slope = (up.batch(block).twist - down.batch(block).twist) / 0.2
    halves = slope[:, :3] * 1e6, np.degrees(1e3 * slope[:, 3:])
    return [np.sqrt((half**2).sum(axis=1).mean()) for half in halves]


@pytest.fixture(scope="module")
def study():
    return study_tolerances(MODEL, WRISTS, LOAD, {}, workers=1)


def test_a_cost_is_what_the_tolerance_does_alone(study):
    found = {cost.name: cost for cost in study.costs}
    for name in (
        "axis_misalignment@joint_1 tilt_w_mdeg",
        "axis_misalignment@joint_1 tilt_u_mdeg",
        "axis_misalignment@joint_4 tilt_v_mdeg",
        "link_stiffness@link_1 flexibility_percent",
        "bushing_stiffness@joint_1 flexibility_percent",
    ):
        cost = found[name]
        at, key = name.split()
        wanted = alone(*at.split("@"), key, cost.sigma)
        for (value, sigma), size in zip(cost.size.values(), wanted, strict=True):
            # The uncertainty of small ones is of their square.
            assert abs(value**2 - size**2) < 4.0 * sigma * (sigma + 2.0 * size) + (0.02 * size) ** 2


def test_the_costs_and_what_goes_with_none_are_the_whole(study):
    for key in ("s_um", "phi_mdeg"):
        parts = sum(cost.size[key][0] ** 2 for cost in (*study.costs, study.others))
        assert np.sqrt(parts) == pytest.approx(study.whole.size[key][0], rel=0.15)
    assert [cost.size["s_um"][0] for cost in study.costs] == sorted(
        (cost.size["s_um"][0] for cost in study.costs), reverse=True
    )


def test_flanges_are_shimmed_to_the_axes():
    model = load_model(MODEL)
    loads = np.array([LOAD, np.zeros(6)])
    home = Block(np.arange(2.0), np.zeros((2, 2)), loads, np.zeros((2, 2)))
    axes = tuple(t for t in tolerances_of({}) if t.key.startswith("shift"))

    def given_way(effects):
        loaded, free = model.with_effects(*effects).batch(home).twist
        return loaded - free

    nominal = given_way(())
    for wrist in _wrists(model, axes, 100.0 * np.eye(len(axes))):
        np.testing.assert_allclose(given_way(wrist), nominal, rtol=1e-6, atol=1e-12)


def test_a_tighter_tolerance_costs_less_and_none_costs_nothing(study):
    tight = {
        "axis_misalignment.shift_u_um": 3.0,
        "bushing_stiffness@joint_1.flexibility_percent": 0,
    }
    found = {cost.name: cost for cost in study_tolerances(MODEL, WRISTS, LOAD, tight).costs}
    own = {cost.name: cost for cost in study.costs}
    name = "axis_misalignment@joint_2 shift_u_um"
    ratio = found[name].size["s_um"][0] / own[name].size["s_um"][0]
    assert ratio == pytest.approx(0.1, abs=0.03)
    assert "bushing_stiffness@joint_1 flexibility_percent" not in found


def test_a_wrist_keeps_what_the_model_knows_of_it():
    """Where a tolerance is left out, a calibrated value of its parameter stays what it is."""
    known = Effect(
        find_law("axis_misalignment"),
        "joint_2",
        {"shift_u_um": Estimate(50.0), "tilt_v_mdeg": Estimate(100.0)},
    )
    model = load_model(MODEL).with_effects(known)
    drawn = tolerances_of({"axis_misalignment@joint_2.shift_u_um": 0.0})
    (wrist,) = _wrists(model, drawn, np.zeros((1, len(drawn))))
    (own,) = (effect for effect in wrist if effect.name == known.name)
    assert {key: each.value for key, each in own.estimates.items()} == {
        key: each.value for key, each in known.estimates.items()
    }


def test_a_wrist_without_flanges_has_nothing_to_shim():
    model = load_model(MODEL)
    bare = replace(
        model, table=replace(model.table, components=replace(model.table.components, contact={}))
    )
    drawn = tolerances_of({})
    (wrist,) = _wrists(bare, drawn, np.ones((1, len(drawn))))
    assert {effect.name for effect in wrist} == {f"{each.law}@{each.place}" for each in drawn}


@pytest.mark.slow
def test_two_processes_build_the_same_wrists(study):
    assert study_tolerances(MODEL, WRISTS, LOAD, {}, workers=2) == study


def test_wrong_limits_are_told():
    with pytest.raises(InputError, match="shift_q_um is none of"):
        tolerances_of({"axis_misalignment.shift_q_um": 1.0})
    with pytest.raises(InputError, match="= -1 is not a number"):
        tolerances_of({"flange_contact.gap_um": -1.0})
    with pytest.raises(InputError, match="20 wrists are too few: 34 tolerances need 102"):
        study_tolerances(MODEL, 20, LOAD, {})
    with pytest.raises(InputError, match="out of range"):
        study_tolerances(MODEL, WRISTS, [100.0, *LOAD[1:]], {})


def test_the_picture_shows_every_tolerance(study, tmp_path):
    draw_tolerances(study, tmp_path / "costs.png")
    assert (tmp_path / "costs.png").stat().st_size > 20_000
