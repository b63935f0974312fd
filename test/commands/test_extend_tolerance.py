"""A tolerance that was found is one no more: it is added like any effect, and it stays."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from measured_wrist import measured_in, random_poses

from wrist_stiffness.commands import calibrate as calibrating
from wrist_stiffness.commands import extend as extending
from wrist_stiffness.commands.calibrate import calibrate_model
from wrist_stiffness.commands.extend import extend_model
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.identification.extension import base_beside
from wrist_stiffness.identification.free_effects import unfitted
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import effect_named, find_law
from wrist_stiffness.shipped import shipped_file

SHIPPED = shipped_file("config/palmieri2015_model.yaml")
RUN = Run("extend ...", "2026-01-01T00:00:00+00:00")
GAPS = "flange_contact"
KNOWN = ["measurement_frame", "target_mounting", "axis_misalignment", GAPS]

SOFT = "bushing_stiffness@joint_2"
SOFTER_PERCENT = 3000.0
"""A hundred times what bushings differ by."""


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """Return a day's file and session of a wrist with a bushing that gave way."""
    model = load_model(SHIPPED)
    rng = np.random.default_rng(1)
    soft = effect(SOFT).with_values({"flexibility_percent": SOFTER_PERCENT})
    poses, notes = random_poses(rng, 80, 0.7), {"calibrated": KNOWN}
    day = measured_in(model.with_effects(soft), poses, rng, notes=notes)
    path = tmp_path / "day.mcap"
    path.write_bytes(b"measured")
    for workflow in (calibrating, extending):
        monkeypatch.setattr(workflow, "read_sessions", lambda *_: {path: day})
    return path, day


def effect(name):
    law, _, place = name.partition("@")
    return Effect(find_law(law), place)


def extended(model, name, path, output):
    return extend_model(model, effect_named(name), Recordings([path], {}), output, RUN).extension


@pytest.mark.slow
def test_a_soft_bushing_is_added_at_its_size_and_the_error_falls(recorded, tmp_path):
    path, day = recorded
    held_back = calibrate(load_model(SHIPPED), [day])
    found = extended(SHIPPED, SOFT, path, tmp_path / "soft.yaml")
    (flexibility,) = found.own
    assert abs(flexibility.value - SOFTER_PERCENT) < 3.5 * flexibility.sigma
    assert flexibility.sigma < 0.05 * SOFTER_PERCENT
    for quantity in found.quantities:
        assert found.after.rmse(quantity) < 1.2 * found.fit.noise[quantity.key]
    assert held_back.after["s_um"] > 1.5 * found.fit.noise["s_um"]
    # What stood in for it goes back; of itself nothing is said there.
    assert SOFT not in {before.effect for before, _ in found.base_moved}
    assert "load_scale@load_sensor" in {before.effect for before, _ in found.base_moved}


@pytest.mark.slow
def test_what_was_added_stays_when_the_same_recording_is_fitted_again(recorded, tmp_path):
    path, _ = recorded
    soft, more = tmp_path / "soft.yaml", tmp_path / "more.yaml"
    extended(SHIPPED, SOFT, path, soft)
    assert load_model(soft).lineage[-1].added == SOFT
    again = extended(soft, "backlash@motor_1", path, more)
    (flexibility,) = (p for p in again.parameters if p.effect == SOFT)
    assert abs(flexibility.value - SOFTER_PERCENT) < 3.5 * flexibility.sigma
    assert SOFT in {each.name for each in load_model(more).effects}
    with pytest.raises(InputError, match=f"{SOFT}: the model has it already"):
        extended(more, SOFT, path, tmp_path / "twice.yaml")


@pytest.mark.slow
def test_a_tolerance_that_was_only_calibrated_may_still_be_added(recorded, tmp_path):
    path, _ = recorded
    mine, soft = tmp_path / "mine.yaml", tmp_path / "soft.yaml"
    calibrate_model(SHIPPED, Recordings([path], {}), mine, RUN)
    assert SOFT in {each.name for each in load_model(mine).effects}
    (flexibility,) = extended(mine, SOFT, path, soft).own
    assert abs(flexibility.value - SOFTER_PERCENT) < 3.5 * flexibility.sigma
    assert [each.name for each in load_model(soft).effects].count(SOFT) == 1


def test_a_finding_that_was_taken_out_again_may_be_added_again():
    """Its step stays in the lineage."""
    step = Step("extend", "2026-01-01", "ab" * 32, {}, added=SOFT)
    model = replace(load_model(SHIPPED), lineage=(step,))
    soft = effect(SOFT).with_values({"flexibility_percent": SOFTER_PERCENT})
    base_beside(model, effect(SOFT), ())
    with pytest.raises(InputError, match=f"{SOFT}: the model has it already"):
        base_beside(model.with_effects(soft), effect(SOFT), ())


@pytest.mark.parametrize("name", ["encoder_offset@motor_1", "load_bias@load_sensor"])
def test_what_is_set_up_anew_is_no_finding(recorded, tmp_path, name):
    with pytest.raises(InputError, match=f"{name}: 'calibrate' fits it anew to every recording"):
        extended(SHIPPED, name, recorded[0], tmp_path / "none.yaml")
    assert not Path(tmp_path / "none.yaml").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "gap_um"), [("backlash@motor_1", 1.5), ("axis_misalignment@joint_3", 30.0)]
)
def test_gaps_are_as_shims_left_them_unless_an_axis_moved_later(recorded, name, gap_um):
    _, day = recorded
    notes = {"calibrated": [each for each in KNOWN if each not in ("axis_misalignment", GAPS)]}
    found = extending.extend(load_model(SHIPPED), effect(name), [replace(day, notes=notes)])
    gaps = [p for p in found.parameters if p.effect.startswith(GAPS)]
    assert gaps
    assert {gap.prior_sigma for gap in gaps} == {gap_um}
    assert {gap.usual for gap in gaps} == {gap_um}


def test_with_an_axis_that_was_added_the_gaps_stay_that_it_left():
    model = load_model(SHIPPED)
    names = ("axis_misalignment@joint_3", "flange_contact@joint_3", SOFT)
    fitted = [
        replace(each, estimates={p.key: Estimate(1.0, 0.5) for p in each.parameters})
        for each in map(effect, names)
    ]
    for added, stay in ((names[0], names[:2]), (SOFT, (SOFT,)), ("", ())):
        step = Step("extend", "2026-01-01", "ab" * 32, {}, added=added)
        child = replace(model.with_effects(*fitted), lineage=(step,))
        assert tuple(each.name for each in unfitted(child).effects) == stay
