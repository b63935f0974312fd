"""All tolerances together: a wrist that is off its drawing says so, and where to look first."""

from dataclasses import replace

import pytest
from measured_wrist import wrong_wrist
from scipy.spatial.transform import Rotation

from wrist_stiffness.identification.strained import strain
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.catalogue import HiddenEffect


@pytest.fixture(scope="module")
def day(model, in_the_cell):
    settings = wrong_wrist(120.0, 41, 3)
    return in_the_cell(model.table, settings, 5)


def moved_by(model, session, effects):
    """The session of a wrist with these effects more."""
    bare, grown = model.with_effects().batch_with(session.block, [(), effects])
    change = grown.measured - bare.measured
    turned = Rotation.from_rotvec(change[:, 3:]).as_matrix() @ session.rotation
    return replace(session, shift=session.shift + change[:, :3], rotation=turned)


def strained(model, session):
    return strain(WristProblem(model, (as_units(model, session),)).begin())


def test_a_wrist_within_its_tolerances_is_not_strained(model, day):
    found = strained(model, day)
    assert found.sentence == ""
    assert found.chance > 0.01
    assert found.freedom > 5
    assert found.square < 2.0 * found.freedom


@pytest.mark.parametrize("seed", [10, 20])
def test_bores_that_are_tilted_where_they_are_are_within_their_tolerances(model, in_the_cell, seed):
    """A tilt at a bushing moves the axis at O; without that these have chances of 1 and 3 %."""
    settings = wrong_wrist(60.0, seed, seed, rate_hz=20.0)
    found = strained(model, in_the_cell(model.table, settings, 1))
    assert found.sentence == ""
    assert found.chance > 0.1


@pytest.mark.slow
def test_parts_that_are_each_a_little_soft_are_too_much_together(model, day):
    """Each within two and a half standard deviations, which alarms nobody."""
    laws = [find_law(f"{kind}_stiffness") for kind in ("link", "bushing")]
    off = tuple(
        effect_at(law, place, {p.key: 2.5 * p.scale for p in law.parameters(place)})
        for law in laws
        for place in law.places
    )
    found = strained(model, moved_by(model, day, off))
    assert found.chance < 1e-3
    assert found.sentence.startswith("The wrist is outside its tolerances (chi-square")


def test_a_load_sensor_far_off_is_to_be_measured_first(model, day):
    """It says a third too little."""
    wrong = replace(day, block=replace(day.block, load=day.block.load / 1.5))
    found = strained(model, wrong)
    assert found.first == "load_scale@load_sensor scale_percent"
    assert found.times < -4.0
    assert "times its tolerance; with that all others are within theirs" in found.sentence


def test_a_fault_whose_slopes_show_nothing_is_asked_for_where_tolerances_make_up_for_it(
    model, in_the_cell
):
    """A flange that stands open touches nothing: tolerances bent the contact as it was measured."""
    opened = HiddenEffect("flange_contact", "joint_2", "open", 2e-5, 3)
    settings = wrong_wrist(60.0, 3, 3, rate_hz=20.0, hidden=(opened,))
    day = in_the_cell(model.table, settings, 5)
    before = strained(model, day)
    assert "outside its tolerances" in before.sentence
    answer = diagnose_sessions(model, [day])
    (finding,) = answer.diagnosis.findings
    assert finding.names == ("flange_contact@joint_2",)
    assert "Without it the wrist is outside its tolerances" in finding.evidence
    assert answer.strain.sentence == ""
    assert answer.strain.square < 0.5 * before.square
