"""Planted parameters are found within their uncertainty, and the uncertainty is honest."""

from dataclasses import replace

import numpy as np
import pytest
from measured_wrist import POSE_SCATTER as SIGMA
from measured_wrist import random_poses

from wrist_stiffness.commands.calibrate import Calibrated
from wrist_stiffness.identification.base_fit import best_valley, fit_cleaned
from wrist_stiffness.identification.calibration import calibrate, fitted, told_model
from wrist_stiffness.identification.free_effects import FreeEffect, commissioning, free_all
from wrist_stiffness.identification.likelihood import likelihood_of
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.identification.result import told_parameters
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.inference.discrepancy import PASSING, PASSING_DRIFT, SLOW_DRIFT
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.report.fit_lines import used_lines
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.refitted import AXES, GAPS, SET_UP
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise

FRAME = "measurement_frame@pose_sensor"


def effect(name, **values):
    law, component = name.split("@")
    return Effect(find_law(law), component).with_values(values)


def simulated(model, *hidden, seed=1, seconds=60.0, **settings):
    """Return a session of the virtual cell at 10 Hz, which knows nothing of the model's laws."""
    settings = CellSettings(
        rate_hz=10.0, program_seconds=seconds, program_seed=seed, hidden=hidden, **settings
    )
    cell = VirtualCell(model.table, settings, np.random.default_rng(seed))
    time = np.arange(round(10 * seconds)) / 10.0
    sample = cell.run(time, cell.desired(time))
    block = Block(time, sample.encoder, sample.wrench)
    return MeasuredSession("s", block, sample.measured_shift, sample.measured_rotation)


def measured(model, block, rng, sigma=SIGMA, drift=0.0):
    """Return a session in which the wrist is the model, with white noise and hidden counts.

    A drift is told in units of that noise; it lasts 20 s and 200 s, half of its variance each.
    """
    twist = model.batch(block).measured
    apart = np.abs(block.time[:, None] - block.time)
    slow = 0.5 * (np.exp(-apart / 20.0) + np.exp(-apart / 200.0))
    slow = np.linalg.cholesky(slow + 1e-9 * np.eye(len(slow)))
    rotation, shift = exp_twist(twist)
    noise = (rng.normal(size=twist.shape) + drift * slow @ rng.normal(size=twist.shape)) * sigma
    wobble, _ = exp_twist(np.concatenate([np.zeros((len(noise), 3)), noise[:, 3:]], axis=1))
    step = model.table.geometry.limits.encoder_step
    shaft = block.theta + step * rng.uniform(-0.5, 0.5, block.theta.shape)
    nominal = model.table.mechanism.forward(shaft).platform
    return MeasuredSession(
        "s", block, shift + noise[:, :3], wobble @ rotation @ nominal, np.diag(sigma**2)
    )


def poses(rng, n=40, load=0.5):
    return random_poses(rng, n, load, 0.02 * load)


def problem_of(model, sessions, free):
    return FitProblem(model, tuple(as_units(model, each) for each in sessions), tuple(free))


def fit(problem, start=None):
    return fitted(*fit_cleaned(problem, start))


def by_name(found):
    return {(p.effect, p.key): p for p in found.parameters}


@pytest.mark.slow
def test_parameters_planted_in_the_virtual_cell_are_recovered(model):
    softer, zero = 0.4, np.radians(0.05)
    session = simulated(
        model,
        HiddenEffect("bushing_stiffness", "joint_1", "plain", softer, 0),
        HiddenEffect("encoder_offset", "motor_2", "plain", zero, 0),
        seconds=150.0,
    )
    free = (
        free_all(effect("bushing_stiffness@joint_1")),
        free_all(effect("bushing_stiffness@joint_2")),
        free_all(effect("encoder_offset@motor_2"), per_session=True),
        free_all(effect("load_bias@load_sensor"), per_session=True),
    )
    found = by_name(fit(problem_of(model, [session], free)))
    soft = found["bushing_stiffness@joint_1", "flexibility_percent"]
    assert abs(soft.value - 100.0 * softer) < 3.0 * soft.sigma
    assert soft.sigma < 5.0
    offset = found["encoder_offset@motor_2", "offset_mdeg"]
    assert abs(offset.value - 50.0) < 3.0 * offset.sigma
    assert offset.sigma < 3.0
    other = found["bushing_stiffness@joint_2", "flexibility_percent"]
    assert abs(other.value) < 3.0 * other.sigma


def test_registrations_of_a_millimetre_are_recovered_to_the_noise(model):
    true = (
        effect("measurement_frame@pose_sensor", shift_x_um=1000.0, shift_z_um=-700.0,
               turn_y_mdeg=200.0, turn_z_mdeg=-150.0),
        effect("target_mounting@pose_sensor", shift_y_um=900.0, turn_x_mdeg=-200.0),
    )  # fmt: skip
    rng = np.random.default_rng(5)
    session = measured(model.with_effects(*true), poses(rng), rng)
    free = [free_all(effect(each.name), per_session=True) for each in true]
    found = fit(problem_of(model, [session], free))
    for each in found.parameters:
        planted = next(e for e in true if e.name == each.effect).estimates[each.key].value
        assert abs(each.value - planted) < 3.5 * each.sigma
        assert each.sigma < 10.0
    assert not found.rough
    assert found.arrived


def test_a_fit_that_stops_short_of_its_best_values_says_how_far(model, monkeypatch):
    rng = np.random.default_rng(6)
    session = measured(model, poses(rng), rng)
    free = [free_all(effect(FRAME), per_session=True)]
    found = fit(problem_of(model, [session], free))
    assert not any("short of" in line for line in used_lines([session], found))
    # At a kink no step gains anything.
    monkeypatch.setattr(WristFit, "_moved", lambda self, noise, step: None)
    z = found.z + 3.0 * found.covariance[0] / np.sqrt(found.covariance[0, 0])
    base = replace(found.base, z=z, residual=found.problem.residual(z))
    stuck = replace(found, base=base).settled()
    # By the noise as stated, which need not be the one that was found.
    assert stuck.off == pytest.approx(3.0, rel=0.3)
    (line,) = [line for line in used_lines([session], stuck) if "short of" in line]
    words = "standard uncertainties short of its best values: a contact opens or closes there"
    assert line == f"the fit ended {stuck.off:.1f} {words}"


@pytest.mark.slow
def test_errors_are_as_large_as_their_uncertainties_say(model):
    """Chi square of all errors over twenty seeds; parameters are drawn from their priors."""
    free = (
        free_all(effect("bushing_stiffness@joint_1")),
        free_all(effect("link_stiffness@link_2")),
        free_all(effect("measurement_frame@pose_sensor"), per_session=True),
        free_all(effect("encoder_offset@motor_1"), per_session=True),
    )
    total = count = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        true = [
            each.effect.with_values(
                {key: float(np.clip(rng.normal(0, s), -80, None)) for key, s in each.scale.items()}
            )
            for each in free
        ]
        drift = 0.5 * np.exp(rng.uniform(-1.0, 1.0))
        session = measured(model.with_effects(*true), poses(rng, 30), rng, drift=drift)
        found = fit(problem_of(model, [session], free))
        planted = {(e.name, key): v.value for e in true for key, v in e.estimates.items()}
        steps = [u.step for u in found.problem.unknowns]
        error = np.array([p.value - planted[p.effect, p.key] for p in found.parameters]) / steps
        total += error @ np.linalg.solve(found.covariance, error)
        count += len(error)
    # How large the drift is must be guessed from thirty poses.
    assert 0.75 < total / count < 1.5


def test_scatter_beyond_what_the_instrument_states_is_found(model):
    rng = np.random.default_rng(13)
    true = effect("measurement_frame@pose_sensor", shift_x_um=100.0)
    session = measured(model.with_effects(true), poses(rng, 200), rng, 4.0 * SIGMA)
    session = replace(session, covariance=np.diag(SIGMA**2))
    found = fit(problem_of(model, [session], [free_all(effect(true.name), per_session=True)]))
    # Noise is what the instrument states; what it scatters beyond is told beside it.
    assert found.rough
    left = np.hypot(found.noise["s_um"], found.discrepancy["s_um"])
    assert left == pytest.approx(4.0 * np.sqrt(3.0) * 1e6 * SIGMA[0], rel=0.35)
    known = by_name(found)["measurement_frame@pose_sensor", "shift_x_um"].sigma
    by_scatter = 1e6 * 4.0 * SIGMA[0] / np.sqrt(200)
    assert by_scatter < known < 2.0 * by_scatter


@pytest.mark.parametrize("slopes", [False, True])
def test_columns_are_the_derivative_of_the_residual(model, slopes):
    rng = np.random.default_rng(2)
    session = measured(model, poses(rng, 12), rng)
    free = [
        each for each in commissioning(model)[0] if each.effect.law.id != "flange_contact"
    ] + [free_all(effect("joint_clearance@joint_1"))]  # fmt: skip
    problem = problem_of(model, [session], free)
    # A flange that is about to touch has two derivatives: what only flanges feel stays at zero.
    names = [(problem.free[u.free].effect.name, u.key) for u in problem.unknowns]
    z = np.where([n == ("axis_misalignment@joint_3", "shift_v_um") for n in names], 0.0, 0.2)
    columns = problem.columns(z, slopes=slopes)
    for place in range(len(z)):
        step = np.zeros(len(z))
        step[place] = 1e-3
        central = (problem.residual(z + step) - problem.residual(z - step)) / 2e-3
        scale = np.abs(central).max(axis=0) + 1e-9
        assert np.max(np.abs(columns[:, :, place] - central) / scale) < 0.05


@pytest.mark.parametrize("slopes", [False, True])
def test_columns_in_motion_beside_an_effect_with_a_past_are_the_derivative_too(model, slopes):
    pull = effect("cable_wrench@platform", fx_N=8.0, fz_1_N_per_rad=20.0, hysteresis_deg=4.0)
    session = simulated(model, seconds=30.0)
    free = [each for each in commissioning(model)[0] if each.effect.law.id != "flange_contact"]
    problem = problem_of(model.with_effects(pull), [session], free)
    z = np.full(len(problem.unknowns), 0.2)
    columns = problem.columns(z, slopes=slopes)
    off = []
    for place, step in enumerate(1e-3 * np.eye(len(z))):
        central = (problem.residual(z + step) - problem.residual(z - step)) / 2e-3
        off.append(np.linalg.norm(columns[:, :, place] - central) / np.linalg.norm(central))
    # Moments at which a flange is about to touch have two derivatives.
    assert max(off) < 0.15
    assert np.median(off) < 1e-3


def test_lost_beams_do_not_move_the_fit(model):
    rng = np.random.default_rng(7)
    true = effect("bushing_stiffness@joint_1", flexibility_percent=40.0)
    session = measured(model.with_effects(true), poses(rng, 100), rng)
    free = (free_all(effect(true.name)),)
    clean = fit(problem_of(model, [session], free))
    shift = session.shift.copy()
    shift[[20, 70]] += 5e-4
    lost = fit(problem_of(model, [replace(session, shift=shift)], free))
    assert lost.lost == 2
    (before,), (after,) = clean.parameters, lost.parameters
    assert abs(after.value - before.value) < 0.8 * before.sigma
    assert after.sigma < 1.3 * before.sigma


def test_what_no_data_tell_stays_and_is_said(model):
    rng = np.random.default_rng(3)
    session = measured(model, poses(rng, load=0.0), rng)
    free = (
        free_all(effect("load_scale@load_sensor", scale_percent=1.5)),
        free_all(effect("encoder_offset@motor_1")),
    )
    scale, offset = fit(problem_of(model, [session], free)).parameters
    assert not scale.excited
    assert scale.value == pytest.approx(1.5)
    assert scale.sigma == pytest.approx(3.0, rel=1e-3)
    assert offset.excited


def test_a_noisy_load_does_not_bias_a_stiffness(model):
    noisy = LoadSensor(Noise(0.1, 0.0), Noise(2e-3, 0.0))
    session = simulated(
        model,
        HiddenEffect("bushing_stiffness", "joint_1", "plain", 0.4, 0),
        load_sensor=noisy,
        seconds=120.0,
    )
    found = fit(problem_of(model, [session], (free_all(effect("bushing_stiffness@joint_1")),)))
    (soft,) = found.parameters
    assert abs(soft.value - 40.0) < 2.0 * soft.sigma


def test_two_sessions_have_registrations_of_their_own_and_one_wrist(model):
    rng = np.random.default_rng(11)
    soft = effect("bushing_stiffness@joint_1", flexibility_percent=30.0)
    sessions = [
        replace(
            measured(
                model.with_effects(soft, effect("measurement_frame@pose_sensor", shift_x_um=shift)),
                poses(rng),
                rng,
            ),
            name=name,
        )
        for name, shift in (("monday", 100.0), ("tuesday", -300.0))
    ]
    free = (
        free_all(effect("bushing_stiffness@joint_1")),
        FreeEffect(effect("measurement_frame@pose_sensor"), {"shift_x_um": 1000.0}, True),
    )
    found = fit(problem_of(model, sessions, free))
    stiffness, monday, tuesday = found.parameters
    assert (stiffness.session, monday.session, tuesday.session) == (None, "monday", "tuesday")
    for each, planted in ((stiffness, 30.0), (monday, 100.0), (tuesday, -300.0)):
        assert abs(each.value - planted) < 3.0 * each.sigma
    newest = {e.name: e for e in found.model().effects}["measurement_frame@pose_sensor"]
    assert newest.estimates["shift_x_um"].value == pytest.approx(tuesday.value)


@pytest.mark.slow
def test_what_makes_another_day_worse_is_not_handed_over(model):
    """Of two wrists the first one's axis is no knowledge of the second."""
    rng = np.random.default_rng(4)
    bent = model.with_effects(effect("axis_misalignment@joint_2", shift_u_um=60.0))
    days = [
        replace(measured(own, poses(rng), rng), name=name)
        for own, name in ((bent, "bent"), (model, "straight"))
    ]
    found = calibrate(model, days)
    assert found.refused["s_um"] > 3.0 * found.after["s_um"]
    assert {each.law.id for each in found.model.effects} <= {law for law, _ in SET_UP}
    assert "the part that judges comes out worse" in found.warnings[0]
    assert "or it is not the same wrist" in found.warnings[0]
    quiet = replace(found, refused=found.fit.noise)
    assert "Both are about noise and drift" in quiet.warnings[0]
    assert Calibrated(found, tuple(days), "").as_values()["warnings"] == list(found.warnings)


def test_parameters_that_are_told_together_only_name_each_other(model):
    """At one pose the instrument's place and the target's look the same; the zero does not."""
    rng = np.random.default_rng(21)
    block = replace(poses(rng), theta=np.radians(rng.uniform(-1e-4, 1e-4, (40, 2))))
    session = measured(model, block, rng)
    free = (
        FreeEffect(effect("measurement_frame@pose_sensor"), {"shift_x_um": 1e3}, True),
        FreeEffect(effect("target_mounting@pose_sensor"), {"shift_x_um": 1e3}, True),
        free_all(effect("encoder_offset@motor_1"), per_session=True),
    )
    found = fit(problem_of(model, [session], free))
    frame, target, zero = found.parameters
    assert frame.together == ("target_mounting@pose_sensor shift_x_um",)
    assert target.together == ("measurement_frame@pose_sensor shift_x_um",)
    assert zero.together == ()
    # Neither is known, and their sum is: only poses apart would tell them apart.
    assert min(frame.sigma, target.sigma) > 100.0
    assert 1e3 * np.sqrt(found.covariance[:2, :2].sum()) < 1.0


@pytest.mark.parametrize("correlation", [-0.5, 0.5])
def test_half_a_correlation_is_not_told_together(model, correlation):
    rng = np.random.default_rng(22)
    free = (
        free_all(effect("encoder_offset@motor_1"), per_session=True),
        free_all(effect("encoder_offset@motor_2"), per_session=True),
    )
    found = fit(problem_of(model, [measured(model, poses(rng), rng)], free))

    def together(share):
        covariance = np.array([[1.0, share], [share, 1.0]])
        return [
            each.together
            for each in told_parameters(found.problem, found.z, covariance, np.ones(2), {})
        ]

    assert together(correlation) == [(), ()]
    assert all(together(1.6 * correlation))


@pytest.mark.parametrize(
    ("planted", "at_bound"), [({"flexibility_percent": -60.0}, False), ({}, True)]
)
def test_an_estimate_on_the_border_of_what_can_be_is_said(model, planted, at_bound):
    """A bushing cannot be stiffer than rigid, nor a play less than nothing."""
    rng = np.random.default_rng(23)
    name = "bushing_stiffness@joint_1" if planted else "joint_clearance@joint_1"
    true = effect("bushing_stiffness@joint_1", **(planted or {"flexibility_percent": -60.0}))
    session = measured(model.with_effects(true), poses(rng), rng)
    (found,) = fit(problem_of(model, [session], (free_all(effect(name)),))).parameters
    assert found.at_bound == at_bound
    if at_bound:
        assert found.value == 0.0


def test_what_a_user_typed_without_uncertainty_is_believed(model):
    """Of an effect of the model, only what a fit has estimated is fitted again."""
    backlash = effect("backlash@motor_1", width_mdeg=30.0)
    typed = model.with_effects(backlash)
    free, held = commissioning(typed)
    assert held == (backlash,)
    assert all(each.effect.name != backlash.name for each in free)
    estimated = replace(backlash, estimates={"width_mdeg": Estimate(30.0, 2.0)})
    free, held = commissioning(model.with_effects(estimated))
    assert held == ()
    assert free[-1].effect == estimated
    assert dict(free[-1].scale) == {"width_mdeg": 20.0}


@pytest.mark.parametrize("seed", [7, 15, 16, 18, 20, 23, 28, 33, 37])
def test_rough_data_lead_into_the_best_valley_of_the_flanges(model, seed):
    """A fit ends no worse than one that begins at the truth; else flanges touch wrongly.

    From the means of the priors, 28 of 90 drawn wrists end elsewhere, these among them.
    """
    rng = np.random.default_rng(seed)
    block = poses(rng, 24, 0.1)
    joints = ("joint_2", "joint_3", "joint_4")
    free = [free_all(effect(f"{law}@{joint}")) for law in (GAPS, AXES) for joint in joints]
    free.append(free_all(effect(FRAME), per_session=True))
    drawn = problem_of(model, [measured(model, block, rng)], free)
    true = rng.normal(size=len(drawn.unknowns))
    session = measured(model.with_effects(*drawn.effects(true, 0)), block, rng)
    problem = problem_of(model, [session], free)
    led, best = (fit_cleaned(problem, start)[0] for start in (best_valley(problem).z, true))
    assert led.cost < best.cost + 2.0


def test_every_unit_has_the_whole_drift_however_long_the_session(model):
    """What columns cannot follow of it must not look like an error of the model."""
    rng = np.random.default_rng(2)
    block = poses(rng, 200)
    frame = FreeEffect(effect(FRAME), {"shift_x_um": 1000.0}, True)
    base, _ = fit_cleaned(problem_of(model, [measured(model, block, rng)], (frame,)))
    table = likelihood_of(base)
    expected = {SLOW_DRIFT: 1.0, PASSING_DRIFT: PASSING}
    followed = np.zeros_like(table.variance)
    for group in table.background.groups:
        if group.name in expected:
            followed += np.sum(group.features**2, axis=1)[:, None] * group.size**2
    drift = (1.0 + PASSING**2) * table.drift**2
    assert np.all(followed.mean(axis=0) < 0.8 * drift)
    noise = (table.variance + followed - drift)[:, :3]  # hidden counts turn the platform
    assert noise == pytest.approx(np.broadcast_to(SIGMA[:3] ** 2, noise.shape), rel=1e-9, abs=0.0)


def test_what_the_fit_cannot_follow_widens_its_uncertainty(model):
    """Repeated poses tell the scatter, so what a soft bushing leaves of them is a misfit."""
    rng = np.random.default_rng(1)
    block = poses(rng, 30)
    twice = Block(2.0 * np.arange(60), np.tile(block.theta, (2, 1)), np.tile(block.load, (2, 1)))
    soft = model.with_effects(effect("bushing_stiffness@joint_1", flexibility_percent=300.0))
    session = replace(measured(soft, twice, rng), covariance=None)
    free = (FreeEffect(effect(FRAME), {"shift_x_um": 1000.0}, True),)
    found = fit(problem_of(model, [session], free))
    assert found.rough
    values = as_units(model, session).values
    repeats = np.linalg.norm(np.std(values[:30] - values[30:], axis=0)[3:]) / np.sqrt(2.0)
    assert found.noise["phi_mdeg"] == pytest.approx(1e3 * np.degrees(repeats), rel=0.25)
    assert found.discrepancy["s_um"] > found.noise["s_um"]
    (shift,) = found.parameters
    assert abs(shift.value) < 3.0 * shift.sigma
    assert shift.sigma > 2.0 * 1e6 * SIGMA[0] / np.sqrt(60)


def test_what_moved_only_with_another_is_told_as_well(model):
    """At one pose the data tell the sum of two shifts; a model with one of them would be off."""
    rng = np.random.default_rng(21)
    block = replace(poses(rng, load=0.0), theta=np.zeros((40, 2)))
    session = measured(model.with_effects(effect(FRAME, shift_x_um=800.0)), block, rng)
    names = (FRAME, "target_mounting@pose_sensor")
    free = [FreeEffect(effect(name), {"shift_x_um": 1e3}, True) for name in names]
    found = fit(problem_of(model, [session], free))
    assert not any(parameter.excited for parameter in found.parameters)
    shift = [each.estimates["shift_x_um"].value for each in told_model(found).effects]
    assert len(shift) == 2
    assert sum(shift) == pytest.approx(800.0, abs=1.0)


def test_what_the_data_hardly_move_is_not_told(model):
    """Under a thousandth of a newton the load's scale does next to nothing."""
    rng = np.random.default_rng(3)
    session = measured(model, poses(rng, load=1e-3), rng)
    free = [free_all(effect(name)) for name in ("load_scale@load_sensor", FRAME)]
    found = fit(problem_of(model, [session], free))
    assert 0.0 < abs(by_name(found)["load_scale@load_sensor", "scale_percent"].moved) < 0.01
    assert [each.name for each in told_model(found).effects] == [FRAME]
