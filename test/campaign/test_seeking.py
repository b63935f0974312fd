"""The search for the point: effects enter while they pay, and hold their places against others."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching import stepwise
from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.candidates import turns_normal, wrist_candidates
from wrist_stiffness.campaign.searching.contributions import contributions
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.place import WORTH, Reached, point_of
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

SECONDS = 40.0
WIDTH = 1e-3
DELAY_S = 0.01
HIDDEN = (
    HiddenEffect("backlash", "motor_1", "single", WIDTH, 5),
    HiddenEffect("time_delay", "motor_2", "plain", DELAY_S, 5),
)
WIDTH_MDEG = 1e3 * np.degrees(WIDTH)
PRICE = 7.0


@pytest.fixture(scope="module")
def units(model, in_the_cell):
    """Forty seconds of a wrist with play in one motor's gear, and late stamps of the other."""
    settings = CellSettings(
        rate_hz=10.0, program_seconds=SECONDS, program_seed=41, hidden=HIDDEN, base="exact"
    )
    return (as_units(model, in_the_cell(model.table, settings, 3)),)


@pytest.fixture(scope="module")
def alone(model, units):
    return fit_base(model, units)


@pytest.fixture(scope="module")
def candidates(alone):
    return wrist_candidates(point_of(alone), ())


def effect(name, **values):
    law, place = name.split("@")
    found = find_law(law)
    usual = {p.key: p.mean for p in found.parameters(place)}
    return effect_at(found, place, usual | values)


def reached(model, units, alone, *extras):
    base = fit_base(model, units, extras, alone)
    return Reached(base, {each.name: PRICE for each in extras}, alone.cost)


@pytest.fixture(scope="module")
def both(model, alone, candidates):
    """Where the search arrives from the base alone."""
    return stepwise.extended(Fitter(model), Reached(alone, {}, alone.cost), candidates)


@pytest.mark.slow
def test_two_effects_at_once_both_enter_first_with_their_values(both):
    assert set(list(both.prices)[:2]) == {"backlash@motor_1", "time_delay@motor_2"}
    width = both.effects["backlash@motor_1"].estimates["width_mdeg"].value
    delay = both.effects["time_delay@motor_2"].estimates["delay_ms"].value
    assert width == pytest.approx(WIDTH_MDEG, rel=0.1)
    assert delay == pytest.approx(1e3 * DELAY_S, rel=0.1)


@pytest.mark.slow
def test_what_does_not_pay_beside_the_others_is_taken_out(model, units, alone):
    idle = effect("time_delay@load_sensor", delay_ms=1.0)
    width = effect("backlash@motor_1", width_mdeg=40.0)
    late = effect("time_delay@motor_2", delay_ms=8.0)
    thinned = stepwise._thinned(Fitter(model), reached(model, units, alone, idle, width, late))
    assert thinned.prices.keys() == {"backlash@motor_1", "time_delay@motor_2"}


@pytest.mark.slow
def test_the_place_of_a_wrong_effect_goes_to_the_right_one(model, units, alone, candidates):
    wrong = effect("time_delay@pose_sensor", delay_ms=1.0)
    width = effect("backlash@motor_1", width_mdeg=40.0)
    start = reached(model, units, alone, wrong, width)
    swapped = stepwise._contested(Fitter(model), start, wrong.name, candidates)
    assert swapped.prices.keys() == {"backlash@motor_1", "time_delay@motor_2"}
    assert swapped.base.cost < start.base.cost
    # The right one keeps its place.
    assert stepwise._contested(Fitter(model), swapped, width.name, candidates) is swapped


@pytest.mark.slow
def test_a_rival_that_explains_less_is_not_fitted_with_the_base(model, units, alone, candidates):
    width = effect("backlash@motor_1", width_mdeg=57.0)
    start = reached(model, units, alone, width, effect("time_delay@motor_2", delay_ms=10.0))
    rivals = [each for each in candidates if each.name != width.name]
    promised = start.screen(without=width.name).leaders(rivals)[0][0]
    assert promised > WORTH

    def never(*given):
        pytest.fail("fitted, which takes seconds")

    assert stepwise._contested(never, start, width.name, rivals) is start


@pytest.mark.slow
def test_contributions_tell_how_much_each_effect_adds_and_what_is_proven(both):
    ranked = contributions(both.base, {"backlash@motor_1"})
    kinds = {each.name: each.kind for each in ranked}
    assert kinds["backlash@motor_1"] == "finding"
    assert kinds["time_delay@motor_2"] == "suspect"
    assert kinds["link_stiffness@link_1"] == "tolerance"
    assert not any("encoder_offset" in name or "load_bias" in name for name in kinds)
    assert {each.name for each in ranked[:2]} == {"backlash@motor_1", "time_delay@motor_2"}
    assert [each.signal for each in ranked] == sorted((e.signal for e in ranked), reverse=True)
    play = next(each for each in ranked if each.name == "backlash@motor_1")
    size, error = play.sizes["phi_mdeg"]
    # Half the width to either side; motor 1 turns the platform by as much, the zero takes the mean.
    assert size == pytest.approx(WIDTH_MDEG / 2.0, rel=0.15)
    assert 0.0 < error < 0.1 * size


@pytest.mark.slow
def test_what_the_data_do_not_show_of_an_effect_stays_at_its_usual_size(model, units, alone):
    spring = effect("platform_compliance@platform")
    true = effect("backlash@motor_1", width_mdeg=57.0), effect("time_delay@motor_2", delay_ms=10.0)
    found = fit_base(model, units, [*true, spring], alone).effects(0)
    own = next(each for each in found if each.name == spring.name)
    scale = {p.key: p.scale for p in spring.parameters}
    sizes = np.array([abs(e.value) / scale[key] for key, e in own.estimates.items()])
    assert sizes.max() < 5.0
    assert np.median(sizes) < 1.0


@pytest.mark.slow
def test_an_extra_on_its_bound_stays_an_effect(both):
    base = both.base
    bound = find_law("backlash").parameters("motor_1")[0].upper
    z = base.z.copy()
    for place, unknown in enumerate(base.problem.unknowns):
        if base.problem.free[unknown.free].effect.name == "backlash@motor_1":
            # What the way to steps and back rounds to.
            z[place] = (bound - unknown.mean) / unknown.step * (1.0 + 1e-15)
    found = replace(base, z=z).beyond()["backlash@motor_1"]
    assert found.estimates["width_mdeg"].value == bound


def test_of_the_catalogue_those_laws_are_tried_that_are_asked_for(alone, candidates):
    asked = ("backlash", "time_delay")
    found = [each.name for each in wrist_candidates(point_of(alone), (), laws=asked)]
    assert found == [each.name for each in candidates if each.law.id in asked] != []


@pytest.mark.parametrize("scale", [np.inf, 0.0])
def test_a_law_of_another_package_must_say_how_large_it_usually_is(alone, monkeypatch, scale):
    """What it explains would be no number, and the order of the candidates chance."""
    law = find_law("backlash")
    (width,) = law.parameters("motor_1")
    monkeypatch.setattr(law, "parameters", lambda place: (replace(width, scale=scale),))
    said = f"backlash@motor_1: width_mdeg has the scale {scale:g}; a diagnosis needs its usual"
    with pytest.raises(InputError, match=said):
        wrist_candidates(point_of(alone), (), laws=("backlash",))


def test_motors_can_turn_back_what_points_the_platform_elsewhere():
    normal = np.tile([0.0, 0.6, 0.8], (3, 1))
    shift = np.zeros((3, 6, 1))
    shift[:, :3, 0] = 1e-5
    assert not turns_normal(shift, normal)
    spin = shift.copy()
    spin[:, 3:, 0] = 1e-3 * normal
    assert not turns_normal(spin, normal)
    tilt = shift.copy()
    tilt[:, 3, 0] = 1e-3
    assert turns_normal(tilt, normal)
    # One of several is enough.
    assert turns_normal(np.concatenate([shift, tilt], axis=2), normal)


@pytest.mark.slow
def test_what_only_shifts_the_platform_is_not_compensable(candidates):
    said = {each.name: each.candidate().compensable for each in candidates}
    assert said["thermal_expansion@platform"] == "no"
    assert said["thermal_expansion@link_2"] == "needs_signal"
    assert said["drift@pose_sensor"] == "no"
    assert said["gravity@platform"] == said["backlash@motor_1"] == "yes"
    assert said["transmission_error@motor_2"] == "yes"
