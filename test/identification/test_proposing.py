"""Laws that nobody wrote are found in what a model leaves: form, component, direction and size."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from measured_wrist import problem_of_a_wrist_that_misses_something, wrong_wrist
from scipy.spatial.transform import Rotation

from wrist_stiffness.commands.extend import direction_of
from wrist_stiffness.identification import proposing, wrist_diagnosis, wrist_problem
from wrist_stiffness.identification.extension import extend
from wrist_stiffness.identification.proposal import Proposals, twins
from wrist_stiffness.identification.proposing import propose
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference import search
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.shipped import shipped_file

pytestmark = pytest.mark.slow

SECONDS = 120.0


@pytest.fixture(scope="module")
def day(model, in_the_cell):
    """A sound wrist beside a clamp that opens and closes on its own."""
    settings = wrong_wrist(SECONDS, 41, 3)
    session = in_the_cell(model.table, settings, 5)
    turns = np.random.default_rng(2).uniform(0.0, 6.0, int(SECONDS / 8.0) + 1)
    bar = turns[(session.block.time // 8.0).astype(int)]
    return replace(session, block=replace(session.block, covariates={"clamp_bar": bar}))


@cache
def base_on(session):
    """Effects of the wrist as it is on a day: what a fit of the shipped model finds."""
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    return WristProblem(model, (as_units(model, session),)).begin().base.effects(0)


def planted(model, session, place, direction, text, *others, **sizes):
    """The session with a law of the user's more in the wrist, and other effects."""
    law = FormulaLaw("planted", place, np.array(direction), text, ("clamp_bar",), tuple(sizes))
    # Beside the wrist as it is: a turn about a target that sits a millimetre off moves it as well.
    wrist = base_on(session)
    effects = (*wrist, effect_at(law, place, sizes), *others)
    bare, grown = model.with_effects().batch_with(session.block, [wrist, effects])
    change = grown.measured - bare.measured
    turned = Rotation.from_rotvec(change[:, 3:]).as_matrix() @ session.rotation
    return replace(session, shift=session.shift + change[:, :3], rotation=turned)


def proposed(model, session, most=1):
    """A second law takes longer, and changes nothing of the first."""
    problem = problem_of_a_wrist_that_misses_something(model, as_units(model, session))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proposing, "MOST_TERMS", most)
        return propose(problem, problem.begin())


def test_noise_and_tolerances_are_no_law(model, day):
    found = proposed(model, day)
    assert found.terms == ()
    assert found.probability < 0.5
    assert found.lines() == []


def test_of_a_wrist_that_never_moved_no_law_is_asked(model, day):
    still = day.take(np.arange(1))
    found = proposed(model, still)
    assert (found.terms, found.asked) == ((), 0)


def test_a_time_that_is_over_before_every_law_was_judged_is_said(model, day):
    problem = WristProblem(model, (as_units(model, day),))
    found = propose(problem, problem.begin(), seconds=1e-3)
    assert not found.complete
    assert found.lines()[-1].startswith("The time was over")


def test_a_law_that_explains_nothing_is_not_proposed(model, day, monkeypatch):
    session = planted(
        model, day, "frame", [0, 0, 1.0, 0, 0, 0], "lift_um * lag(clamp_bar, 4)", lift_um=0.8
    )
    real = proposing._proposal
    monkeypatch.setattr(proposing, "_proposal", lambda *a: replace(real(*a), explains=-0.18))
    assert proposed(model, session).terms == ()


def test_a_late_clamp_under_the_frame_is_found_and_can_be_added(model, day):
    session = planted(
        model, day, "frame", [0, 0, 1.0, 0, 0, 0], "lift_um * lag(clamp_bar, 4)", lift_um=2.5
    )
    found = proposed(model, session, most=2)
    assert found.probability > 0.99
    assert found.complete
    (law,) = found.terms
    assert (law.form.kind, law.form.of) == ("a late follower", ("clamp_bar",))
    assert law.component == "frame"
    assert law.direction[0, 2] > 0.95
    assert law.value == pytest.approx(2.5, abs=4.0 * law.sigma)
    assert law.sigma < 0.2
    assert law.shape[0] == pytest.approx(4.0, rel=0.3)
    assert law.explains > 0.9
    assert "at frame or the stand of the instrument for every bar of clamp_bar" in law.sentence
    effect = law.effect("lifted")
    assert isinstance(effect, Effect)
    added = extend(model, effect, [session])
    assert added.own[0].value == pytest.approx(law.value, abs=3.0 * law.sigma)
    # It leaves what is left of the same day without the clamp.
    sound, (shift, _) = extend(model, effect, [day]).before, added.quantities
    assert added.after.rmse(shift) == pytest.approx(sound.rmse(shift), rel=0.1)
    assert added.before.rmse(shift) > 2.0 * sound.rmse(shift)
    told = law.command("wrist.yaml", ["monday"], "lifted")
    assert "--direction" in told
    assert "--component frame" in told


def test_a_wave_of_the_difference_of_the_angles_in_a_link_is_found_there(model, day):
    text = "turn_mdeg * sin(18 * (theta_1 - theta_2) + 0.5)"
    session = planted(model, day, "link_3", [0, 0, 0, 0, 1.0, 0], text, turn_mdeg=40.0)
    found = proposed(model, session)
    law = found.terms[0]
    assert law.form.name == "a wave of theta_1 - theta_2"
    assert law.component == "link_3"
    assert abs(law.direction[0, 4]) > 0.95
    assert law.shape[0] == pytest.approx(18.0, rel=0.05)
    assert law.value == pytest.approx(40.0, abs=4.0 * law.sigma)
    assert found.places["link_3"] > 0.9


def test_a_dent_in_a_passive_joint_is_found_at_its_angle(model, day):
    text = "lift_um * exp(-((turn_3 - 0.1) ** 2) / 0.005)"
    session = planted(model, day, "joint_3", [0, 0.8, 0.6, 0, 0, 0], text, lift_um=20.0)
    found = proposed(model, session)
    law = found.terms[0]
    assert law.form.name == "a spot of turn_3"
    assert "joint_3" in (law.component, *twins(law.component))
    assert law.shape == pytest.approx((0.1, 0.05), abs=0.02)
    assert "deg of joint_3" in law.sentence


def test_what_pulls_at_the_platform_is_a_wrench_that_the_sensor_does_not_say(model, day):
    # A small one: under newtons flanges close, and slopes tell little.
    text = "pull_N * sin(14 * theta_1)"
    session = planted(model, day, "load_sensor", [0, 0.6, 0.8, 0, 0, 0], text, pull_N=0.4)
    found = proposed(model, session)
    law = found.terms[0]
    assert law.component == "load_sensor"
    assert law.key == "size_N"
    assert law.value * law.direction[0, :3] == pytest.approx([0.0, 0.24, 0.32], abs=0.1)
    assert law.form.name == "a wave of theta_1"
    assert "at load_sensor or whatever pulls at the platform" in law.sentence
    added = extend(model, law.effect("pull"), [session])
    assert added.after.rmse(added.quantities[0]) < 0.8 * added.before.rmse(added.quantities[0])


def test_what_answers_to_both_speeds_is_one_law_that_can_be_added(model, day, tmp_path):
    """A rotor on the tool: either speed alone is explained better by another component."""
    text = "spin_Nmm * theta_dot_1, spin_Nmm * theta_dot_2"
    ways = [[0, 0, 0, 0, 1.0, 0], [0, 0, 0, -0.8, 0, 0.2]]
    found = proposed(model, planted(model, day, "tool", ways, text, spin_Nmm=40.0))
    law = found.terms[0]
    assert (law.form.name, law.component) == ("a share of theta_dot_1 and theta_dot_2", "tool")
    assert law.value * law.direction[:, 3:] == pytest.approx(40.0 * np.array(ways)[:, 3:], abs=6.0)
    assert law.sentence.startswith("at tool or whatever pulls and turns with the platform: ")
    assert "rad/s of theta_dot_1; " in law.sentence
    again = found.lines("there/proposed_1.yaml", ["day"])
    assert again[1] == "   explains 100 % of the error above the noise; over 99 % sure"
    assert "--name proposed_2 --fit day -o proposed_2.yaml" in again[2]
    words = law.command("m.yaml", ["day"])
    assert "'size_Nmm * theta_dot_1, size_Nmm * theta_dot_2'" in words
    assert direction_of(law.way.split()) == pytest.approx(law.direction, abs=1e-3)
    path = tmp_path / "wrist.yaml"
    save_model(replace(model, effects=(law.effect("rotor"),)), path)
    assert load_model(path).effects[0].law.direction == pytest.approx(law.direction)


def test_a_clamp_that_comes_loose_is_told_by_all_forces_and_the_time(model, day):
    text = ", ".join(f"soft_um * f{axis} * (time - {day.block.time[0]:.3f})" for axis in "xyz")
    ways = np.concatenate([[[0.6, 0, 0], [0, 1.0, 0.3], [0, 0.3, 0.8]], np.zeros((3, 3))], axis=1)
    found = proposed(model, planted(model, day, "link_3", ways, text, soft_um=0.3))
    assert found.terms[0].form.name == "a product of fx, fy, fz and time"
    assert "link_3" in (found.terms[0].component, *twins(found.terms[0].component))


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("dip_um * exp(7 * (cos(2 * 3.14159 * time / 37.3 + 2) - 1))", "a pulse of time"),
        ("dip_um * (time / 29 + 0.3 - floor(time / 29 + 0.3))", "a saw-tooth of time"),
        ("dip_um * exp(-(theta_dot_2 ** 2) / 0.002)", "a rest of theta_dot_2"),
    ],
)
def test_what_comes_again_and_again_and_what_is_there_at_rest(model, day, text, kind):
    way = [0.8, 0.6, 0, 0, 0, 0]
    found = proposed(model, planted(model, day, "frame", way, text, dip_um=12.0))
    law = found.terms[0]
    assert (law.form.name, law.component) == (kind, "frame")
    assert law.value * law.direction[0] == pytest.approx(12.0 * np.array(way), abs=2.0)


def test_beside_an_effect_that_is_named_a_law_is_proposed_for_the_rest(model, day, monkeypatch):
    # Of all others the answer would be the same, a minute later.
    asked = [(find_law("backlash"), place) for place in ("motor_1", "motor_2")]
    monkeypatch.setattr(
        wrist_problem,
        "searched",
        lambda absent: [each for each in asked if f"{each[0].id}@{each[1]}" not in absent],
    )
    play = effect_at(find_law("backlash"), "motor_2", {"width_mdeg": 70.0})
    both = planted(
        model, day, "frame", [0, 0, 1.0, 0, 0, 0], "lift_um * clamp_bar", play, lift_um=2.0
    )
    found = diagnose_sessions(model, [both])
    assert [each.name for each in found.diagnosis.findings] == ["backlash@motor_2"]
    assert found.proposals.terms[0].formula == "size_um * clamp_bar"
    assert found.proposals.terms[0].value == pytest.approx(2.0, abs=0.3)
    lines = found.proposals.lines("m.yaml", ["day"], ["backlash@motor_2"])
    first, second = [line for line in lines if line.startswith("   wrist-stiffness")]
    assert first.endswith("extend m.yaml --effect backlash@motor_2 --fit day -o found_1.yaml")
    assert "extend found_1.yaml --formula 'size_um * clamp_bar'" in second


def test_a_search_out_of_fits_is_followed_by_a_law_all_the_same(model, day, monkeypatch):
    """Only one out of time is not."""
    nothing = Proposals((), (), 0.0, {}, 0)
    monkeypatch.setattr(
        wrist_problem, "searched", lambda absent: [(find_law("backlash"), "motor_2")]
    )
    monkeypatch.setattr(wrist_diagnosis, "propose", lambda *asked: nothing)
    monkeypatch.setattr(search, "MOST_FITS", 0)
    play = effect_at(find_law("backlash"), "motor_2", {"width_mdeg": 70.0})
    both = planted(
        model, day, "frame", [0, 0, 1.0, 0, 0, 0], "lift_um * clamp_bar", play, lift_um=2.0
    )
    found = diagnose_sessions(model, [both])
    assert (found.diagnosis.ended, found.diagnosis.verdict) == (search.MANY_FITS, "unknown")
    assert found.proposals is nothing


def test_what_gives_under_its_own_load_is_told_by_the_load_through_it(model, day):
    # The moment through joint_1 about its own axis; that on the platform turns with the pose.
    text = "gives_mdeg * tanh(mx / 0.01)"
    session = planted(model, day, "joint_1", [0, 0, 0, 1.0, 0, 0], text, gives_mdeg=40.0)
    found = proposed(model, session)
    law = found.terms[0]
    assert law.form.name == "a saturating function of mx"
    # Before and behind a joint a turn about its own axis is the same.
    assert law.component in ("joint_1", "link_1")
    assert {"joint_1", "link_1"} <= set(found.places)
    assert law.value * law.direction[0, 3] == pytest.approx(40.0, rel=0.15)


def test_a_shift_and_a_turn_together_are_one_law_that_can_be_added(model, day):
    text = "lift_um * exp(-((turn_2 - 0.05) ** 2) / 0.01)"
    session = planted(model, day, "joint_2", [0, 0.6, 0.8, 0, 0, 20.0], text, lift_um=15.0)
    found = proposed(model, session, most=2)
    (law,) = found.terms
    assert law.form.name == "a spot of turn_2"
    assert law.probability > 0.9
    assert law.value == pytest.approx(15.0, rel=0.2)
    assert law.direction[0] == pytest.approx([0, 0.6, 0.8, 0, 0, 20.0], abs=6.0)
    assert direction_of(law.way.split()) == pytest.approx(law.direction[0], abs=0.01)
    assert "mdeg about" in law.sentence
    added = extend(model, law.effect("dent"), [session])
    assert added.after.rmse(added.quantities[0]) < 0.8 * added.before.rmse(added.quantities[0])


def test_a_law_beside_something_that_follows_none_is_told_as_less_sure(model, day):
    """What a law leaves above the noise may as well be what is missing itself."""
    lift = model, day, "frame", [0, 0, 1.0, 0, 0, 0], "lift_um * clamp_bar"
    text = "wild_um * sin(23 * theta_1) * sin(19 * theta_2)"
    wild = FormulaLaw("wild", "frame", np.eye(6)[0], text, (), ("wild_um",))
    beside = effect_at(wild, "frame", {"wild_um": 3.0})
    sure, unsure = (
        proposed(model, planted(*lift, *others, lift_um=2.0)).terms[0] for others in ((), (beside,))
    )
    assert sure.formula == unsure.formula == "size_um * clamp_bar"
    assert sure.probability > 0.98
    assert unsure.probability < 0.8


def test_what_is_otherwise_beyond_a_line_across_the_workspace(model, day):
    text = "hop_um * tanh((0.8 * theta_1 - 0.6 * theta_2 - 0.1) / 0.03)"
    session = planted(model, day, "frame", [0.6, 0, 0.8, 0, 0, 0], text, hop_um=8.0)
    found = proposed(model, session)
    law = found.terms[0]
    assert law.form.name == "a jump of theta_1 and theta_2"
    way = np.array([np.cos(law.shape[0]), np.sin(law.shape[0])])
    assert abs(way @ [0.8, -0.6]) > 0.98
    assert abs(law.value * law.direction[0, :3]) == pytest.approx([4.8, 0.0, 6.4], abs=1.5)


def test_what_comes_with_time_is_not_put_down_to_a_thermometer_that_hardly_moved(model, day):
    grown = np.linspace(20.0, 20.01, len(day.block))
    block = replace(day.block, temperatures={"frame": grown, "link_3": grown + 0.001})
    text = "slope_um * tanh(theta_1 / 0.1) * (time - 60) / 60"
    session = planted(
        model, replace(day, block=block), "link_3", [0, 1.0, 0, 0, 0, 0], text, slope_um=12.0
    )
    found = proposed(model, session)
    assert not any("T_" in name for law in found.terms for name in law.form.of)
