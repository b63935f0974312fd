"""The base alone: it ends at the noise from any wrong base, and tolerances are its limits."""

from dataclasses import replace

import numpy as np
import pytest
from measured_wrist import wrong_wrist

from wrist_stiffness.identification.base_fit import best_valley, fit_base, fit_cleaned, free_base
from wrist_stiffness.identification.free_effects import commissioning
from wrist_stiffness.identification.problem import SILENT, FitProblem
from wrist_stiffness.identification.taken_up import taken_up
from wrist_stiffness.model.effect import Effect, Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.base import AXIS_SHIFT, AXIS_TILT, LOAD_SCALE, STIFFNESS
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

FRAME = "measurement_frame@pose_sensor"


@pytest.mark.slow
def test_no_wrong_flange_catches_the_fit(model, in_the_cell):
    """This base closed a flange that is open when its data were believed at once."""
    settings = wrong_wrist(120.0, 101, 1029)
    units = as_units(model, in_the_cell(model.table, settings, 1))
    found = fit_base(model, (units,))
    assert found.cost < 1.3 * 6 * units.measured.sum()
    assert np.abs(found.z * found.problem.weights).max() < 4.0


def test_what_changes_nothing_has_no_column(model, in_the_cell):
    """Differences of equal predictions are rounding; a basis would take it for a direction."""
    settings = CellSettings(rate_hz=10.0, program_seconds=30.0, program_seed=101)
    found = fit_base(model, (as_units(model, in_the_cell(model.table, settings, 1)),))
    length = np.linalg.norm(found.problem.whiten(found.columns), axis=0)
    unknowns = found.problem.unknowns
    names = [f"{found.problem.free[u.free].effect.name} {u.key}" for u in unknowns]
    # It slides link 3 along a pin: felt only where a flange of joint 4 touches.
    assert length[names.index("axis_misalignment@joint_3 shift_v_um")] == 0.0
    assert ((length == 0.0) | (length > SILENT)).all()
    assert np.count_nonzero(length) > 0.9 * len(length)


def test_of_a_base_is_told_what_it_moved_of_what_was_measured(model, in_the_cell):
    """A single gauge sees one direction and no turn."""
    settings = CellSettings(rate_hz=10.0, program_seconds=30.0, program_seed=101, base="wrong")
    session = in_the_cell(model.table, settings, 1)
    shift = np.where([False, False, True], session.shift, np.nan)
    gauge = replace(session, shift=shift, rotation=np.full_like(session.rotation, np.nan))
    found = fit_base(model, (as_units(model, gauge),))
    told = {each.name: each for each in taken_up(found, ["day"])}[f"{FRAME} in day"]
    assert " of phi" not in told.sentence
    free, unknowns = found.problem.free, found.problem.unknowns
    frame = [n for n, u in enumerate(unknowns) if free[u.free].effect.name == FRAME]
    moved = found.columns[:, 2, frame] @ found.z[frame]
    assert told.moved == {"s": pytest.approx(1e6 * np.sqrt(np.mean(moved**2)))}


def test_tolerances_are_limits_within_which_parts_are_evenly_spread(model):
    spread = {}
    for each in free_base(model)[0]:
        spread.setdefault(each.effect.law.id, {}).update(each.scale)
    limits = (STIFFNESS, AXIS_SHIFT, AXIS_TILT, LOAD_SCALE)
    draws = [np.random.default_rng(2).uniform(-limit, limit, 100_000).std() for limit in limits]
    soft, shift, tilt, scale = np.array(draws) * [100.0, 1e6, np.degrees(1e3), 100.0]
    assert spread["link_stiffness"]["flexibility_percent"] == pytest.approx(soft, rel=0.01)
    assert spread["bushing_stiffness"]["flexibility_percent"] == pytest.approx(soft, rel=0.01)
    assert spread["axis_misalignment"]["shift_u_um"] == pytest.approx(shift, rel=0.01)
    assert spread["axis_misalignment"]["tilt_u_mdeg"] == pytest.approx(tilt, rel=0.01)
    assert spread["load_scale"]["scale_percent"] == pytest.approx(scale, rel=0.01)


def effect(law, place, **values):
    return Effect(find_law(law), place, {key: Estimate(value) for key, value in values.items()})


@pytest.mark.slow
@pytest.mark.parametrize("program", ["rich", "production"])
def test_slopes_that_lead_no_further_do_not_end_a_calibration(model, in_the_cell, program):
    """The first needs wide differences, the second a wrist within its tolerances to begin with."""
    settings = wrong_wrist(60.0, 6, 6, rate_hz=20.0, experiment=program)
    free, held = commissioning(model)
    units = (as_units(model, in_the_cell(model.table, settings, 1)),)
    problem = FitProblem(model.with_effects(*held), units, free)
    found, _ = fit_cleaned(problem, best_valley(problem).z)
    assert found.variance < 1.0


@pytest.mark.slow
def test_wide_differences_lead_past_the_pins_that_turn_over(model, in_the_cell):
    """Play of 5 um and friction: slopes lead no further than the next pin that turns over.

    Of eight drawn wrists (1003 to 1010) wide differences lead further in seven.
    """
    hidden = (
        HiddenEffect("joint_clearance", "joint_3", "algebraic", 5e-6, 5),
        HiddenEffect("joint_friction", "joint_2", "coulomb", 0.2, 6),
    )
    settings = wrong_wrist(20.0, 101, 1008, hidden=hidden)
    units = (as_units(model, in_the_cell(model.table, settings, 1)),)
    base = fit_base(model, units)
    extras = [
        effect("joint_clearance", "joint_3", clearance_um=3.0),
        effect("joint_friction", "joint_2", coefficient=0.1),
    ]
    sharp = fit_base(model, units, extras, base)
    found = fit_base(model, units, extras, base, gradually=True)
    assert found.cost < 0.5 * sharp.cost
    play = found.beyond()["joint_clearance@joint_3"].estimates["clearance_um"]
    assert play.value == pytest.approx(5.0, rel=0.1)
