"""Residuals of units: exact poses, blanks, lost beams, replicates."""

import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.shared import own_covariance
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.columns import SessionModel
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.observing import counts_known, predict_units, tabulate
from wrist_stiffness.sessions.unit_session import all_units, as_units

POSES_DEG = ((0, 0), (20, 10), (-15, 25), (20, 10))
ADDED = np.array([3e-6, -2e-6, 5e-6, 2e-4, -1e-4, 3e-4])
"""Twist by which the platform is measured off its prediction [m, rad]."""


def observe(model, sessions):
    return tabulate(model, all_units(model, sessions))


@pytest.fixture
def session(model):
    """Four poses held for two seconds each, moves of a second between them, 10 Hz."""
    time = np.arange(0.0, 12.0, 0.1)
    knots = np.concatenate([[3.0 * i, 3.0 * i + 2.0] for i in range(4)])
    values = np.radians(np.repeat(POSES_DEG, 2, axis=0))
    theta = np.stack([np.interp(time, knots, each) for each in values.T], axis=1)
    block = Block(time, theta, np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], (len(time), 1)))
    off, moved = exp_twist(ADDED)
    bent, shift = exp_twist(model.batch(block).measured)
    nominal = model.table.mechanism.forward(theta).platform
    return MeasuredSession(
        "four poses", block, moved + shift @ off.T, off @ bent @ nominal, np.diag([1e-12] * 6)
    )


def blanked(session, shift=(), rotation=False):
    """Return the session with some components of the position, or the rotation, not measured."""
    position = session.shift.copy()
    position[:, list(shift)] = np.nan
    turned = np.full_like(session.rotation, np.nan) if rotation else session.rotation
    return MeasuredSession(session.name, session.block, position, turned, session.covariance)


def test_the_residual_is_the_twist_between_measured_and_predicted(model, session):
    values = observe(model, [session]).observations.values
    # Both are means over the same moments; turns do not add up beyond the first order.
    assert values == pytest.approx(np.tile(ADDED, (len(values), 1)), abs=1e-9)


def test_a_few_of_the_units_are_the_same_on_the_same_path(model, session):
    whole = as_units(model, session)
    few = whole.thinned(3)
    times, own = (each.mean(each.block.time) for each in (whole, few))
    rows = np.searchsorted(times, own)
    measured = np.flatnonzero(whole.measured)
    assert (rows[0], len(rows), rows[-1]) == (measured[0], 3, measured[-1])
    np.testing.assert_array_equal(times[rows], own)
    for name in ("values", "samples"):
        np.testing.assert_array_equal(getattr(few, name), getattr(whole, name)[rows])
    assert few.block is whole.block
    assert predict_units(model, few).tolist() == predict_units(model, whole)[rows].tolist()
    assert whole.thinned(len(whole)) is whole


def test_one_dial_gauge_gives_one_component(model, session):
    seen = observe(model, [blanked(session, shift=(0, 1), rotation=True)]).observations
    assert np.isnan(seen.values[:, [0, 1, 3, 4, 5]]).all()
    # The unknown rotation is taken as predicted: 4e-4 rad of a few um are nanometres.
    assert seen.values[:, 2] == pytest.approx(ADDED[2], abs=1e-8)


def test_pointing_alone_leaves_the_position_blank(model, session):
    seen = observe(model, [blanked(session, shift=(0, 1, 2))]).observations
    assert np.isnan(seen.values[:, :3]).all()
    assert seen.values[:, 3:] == pytest.approx(np.tile(ADDED[3:], (len(seen.values), 1)), abs=1e-9)


def test_a_pose_held_twice_is_a_replicate(model, session):
    found = observe(model, [session])
    labels = found.observations.replicate[found.sessions[0].cut.dwell]
    assert labels[1] == labels[3] >= 0
    assert labels[0] == labels[2] == -1


def test_a_pose_held_under_another_load_is_no_replicate(model, session):
    session.block.load[session.block.time > 8.5, 2] = -0.5
    found = observe(model, [session])
    assert (found.observations.replicate == -1).all()


def test_a_lost_beam_in_a_dwell_is_left_out(model, session):
    shift = session.shift + 1e-7 * np.random.default_rng(1).normal(size=session.shift.shape)
    shift[5] += 1e-3
    seen = observe(model, [MeasuredSession("a glitch", session.block, shift, session.rotation)])
    assert seen.sessions[0].lost == 1
    assert np.abs(seen.observations.values[0, :3] - ADDED[:3]).max() < 2e-7


def test_poses_beyond_the_table_are_refused_only_if_nothing_is_left(model, session):
    far = Block(session.block.time, session.block.theta + 2.0, session.block.load)
    with pytest.raises(InputError, match="four poses: none of 120 measurements"):
        observe(model, [MeasuredSession("four poses", far, session.shift, session.rotation)])


def test_means_of_angles_in_motion_know_more_than_those_of_a_rest(model, session):
    step = model.table.geometry.limits.encoder_step
    found = observe(model, [session])
    unit = found.sessions[0]
    turned = np.trace(found.observations.covariance[:, 3:, 3:], axis1=1, axis2=2)
    dwell, moments = unit.cut.dwell, unit.samples
    known = counts_known(unit.cut, step)
    assert known[dwell] == pytest.approx(1.0)
    # Both motors sweep a hundred counts between two moments.
    both = ~dwell & (moments == moments[~dwell].max()) & (known.min(axis=1) > 1.0)
    assert both.any()
    assert known[both] == pytest.approx(np.tile(moments[both, None], 2))
    assert turned[both].max() < 1.3 * turned[dwell].min() / moments[both].min()


def test_a_target_off_the_platform_leaves_nothing_in_motion(model, session):
    seen = MeasuredSession(
        session.name,
        session.block,
        session.shift + session.rotation @ np.array([1e-3, -5e-4, 8e-4]),
        session.rotation,
        session.covariance,
    )
    target = Effect(find_law("target_mounting"), "pose_sensor")
    target = target.with_values({"shift_x_um": 1e3, "shift_y_um": -500.0, "shift_z_um": 800.0})
    unit = as_units(model, seen)
    (predicted,) = SessionModel(model, unit, ()).along([(*model.effects, target)])
    left = unit.residual(predicted)
    assert np.abs(left[:, :3] - left[0, :3]).max() < 2e-8


def test_rests_between_which_only_the_load_changes_hide_the_same_counts(model):
    """0  rest  2  load  3  rest  5  move  6  rest  8: the first two rests are one stand."""
    time = np.arange(0.0, 8.0, 0.1)
    theta = np.stack([np.interp(time, (5.0, 6.0), (0.1, 0.4)), np.full(len(time), 0.2)], axis=1)
    load = np.zeros((len(time), 6))
    load[:, 2] = -np.interp(time, (2.0, 3.0), (0.5, 1.0))
    block = Block(time, theta, load)
    rotation, shift = exp_twist(model.batch(block).measured)
    nominal = model.table.mechanism.forward(theta).platform
    white = np.diag(np.repeat([1e-12, 1e-10], 3))
    unit = observe(model, [MeasuredSession("a day", block, shift, rotation @ nominal, white)])
    stand, dwell = unit.observations.stand, unit.sessions[0].cut.dwell
    first, second, third = stand[dwell]
    assert first == second >= 0
    assert third != first
    time = unit.observations.times
    changing = ~dwell & (time < 4.0)
    assert changing.any()
    assert (stand[changing] == first).all()
    assert (stand[(time > 5.2) & (time < 5.7)] == -1).all()
    own = own_covariance(unit.observations, unit.observations.covariance)
    assert own[0] == pytest.approx(white, rel=1e-6)
