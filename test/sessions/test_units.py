"""Units of a session: dwells and half seconds of motion, and the path that is kept of it."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.model.block import Block
from wrist_stiffness.sessions.observing import _stands
from wrist_stiffness.sessions.units import MOST_MOVING, PATH_S, UNIT_S, cut

STEP = np.radians(0.015)


def ramp(time, start, end, low, high):
    return low + (high - low) * np.clip((time - start) / (end - start), 0.0, 1.0)


def session(rate=100.0, noise=0.0, seconds=12.0):
    """Cut a made-up timeline of a move of motor 1, a rest, a load at rest and a rest.

    0    rest    3  move  5      rest      8  load  9     rest     12
    """
    time = np.arange(0.0, seconds, 1.0 / rate)
    theta = np.zeros((len(time), 2))
    theta[:, 0] = STEP * np.round(ramp(time, 3.0, 5.0, 0.0, 0.5) / STEP)
    load = np.zeros((len(time), 6))
    load[:, 2] = ramp(time, 8.0, 9.0, 0.0, -1.0)
    load += noise * np.random.default_rng(1).normal(size=load.shape)
    return Block(time, theta, load)


def cut_all(block):
    return cut(block, STEP, np.ones(len(block), dtype=bool))


@pytest.mark.parametrize("rate", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, 2e-3])
def test_rests_are_dwells_and_changes_are_not(rate, noise):
    block = session(rate, noise)
    found = cut_all(block)
    first = [block.time[found.label == u].min() for u in np.flatnonzero(found.dwell)]
    last = [block.time[found.label == u].max() for u in np.flatnonzero(found.dwell)]
    slack = 0.15 + 2.0 / rate
    assert first == pytest.approx([0.0, 5.0, 9.0], abs=slack)
    assert last == pytest.approx([3.0, 8.0, 12.0], abs=slack)


@pytest.mark.parametrize("end", [4.9, 5.0, 5.1])
def test_a_motor_that_comes_to_rest_is_no_stand_yet(end):
    """Its count shows already what it will be at rest, and hides another part of it."""
    block = session(rate=10.0)
    way = np.sin(0.5 * np.pi * ramp(block.time, 3.0, end, 0.0, 1.0))
    block.theta[:, 0] = STEP * np.round(0.5 * way / STEP)
    found = cut_all(block)
    stands = _stands(found, STEP, np.inf)
    time = np.array([block.time[found.label == u].mean() for u in range(len(stands))])
    assert (stands[(time > 3.0) & ~found.dwell & (time < 6.0)] == -1).all()
    # Load that comes on at rest changes no count.
    loaded = stands[time > 6.0]
    assert len(loaded) > 3
    assert (loaded == loaded[0]).all()
    assert loaded[0] >= 0


def test_a_count_that_flickers_while_the_load_comes_on_is_a_stand():
    block = session(rate=50.0)
    speed = np.zeros_like(block.theta)
    speed[block.time > 6.0, 0] = STEP / 0.05 * np.resize([1.0, 0.0, -1.0], (block.time > 6.0).sum())
    found = cut_all(replace(block, theta_dot=speed))
    time = np.array([block.time[found.label == u].mean() for u in range(len(found.dwell))])
    loaded = _stands(found, STEP, np.inf)[time > 6.0]
    assert (loaded == loaded[-1]).all()
    assert loaded[-1] >= 0


def test_a_motor_at_rest_has_no_speed_however_its_count_flickers():
    block = session()
    told = np.full_like(block.theta, 0.02)
    found = cut_all(replace(block, theta_dot=told))
    resting = found.dwell[found.unit] & (found.unit >= 0)
    assert (found.block.theta_dot[resting] == 0.0).all()
    assert (found.block.theta_dot[~resting & (found.unit >= 0)] == 0.02).all()


def moving_times(block, found):
    return [block.time[found.label == u] for u in np.flatnonzero(~found.dwell)]


def test_a_unit_in_motion_is_half_a_second_of_regular_moments():
    block = session()
    times = [each for each in moving_times(block, cut_all(block)) if each[-1] < 6.0]
    # A stretch may begin between two moments of the grid.
    assert max(len(each) for each in times) in (round(UNIT_S / PATH_S), round(UNIT_S / PATH_S) + 1)
    assert all(np.ptp(each) < UNIT_S for each in times)
    steps = np.concatenate([np.diff(each) for each in times])
    assert steps.max() < PATH_S + 0.011
    assert np.sum(steps < PATH_S - 0.011) <= 1
    assert sum(len(each) for each in times) == pytest.approx(2.0 / PATH_S, abs=5)


def test_a_long_motion_is_thinned_by_whole_units():
    time = np.arange(0.0, 400.0, 0.1)
    angle = 0.5 * np.sin(2.0 * np.pi * time / 7.3)
    block = Block(time, np.stack([angle, angle], axis=1), np.zeros((len(time), 6)))
    times = moving_times(block, cut_all(block))
    assert 0.4 * MOST_MOVING < len(times) <= MOST_MOVING
    assert max(np.ptp(each) for each in times) < UNIT_S


def test_the_path_keeps_a_turning_point():
    time = np.arange(0.0, 4.0, 1e-3)
    angle = 0.5 * np.sin(2.0 * np.pi * time / 1.37)
    block = Block(time, np.stack([angle, angle], axis=1), np.zeros((len(time), 6)))
    found = cut_all(block)
    assert np.ptp(found.block.theta[:, 0]) == pytest.approx(np.ptp(angle), rel=1e-4)
    assert len(found.kept) < len(time) / 50


def test_shares_of_a_unit_add_up_and_keep_a_linear_mean():
    found = cut_all(session())
    used = found.unit >= 0
    total = np.bincount(found.unit[used], found.weight[used])
    assert total == pytest.approx(np.ones(len(found.dwell)))
    mean = np.bincount(found.unit[used], found.weight[used] * found.block.time[used])
    times = session().time
    exact = [times[found.label == u].mean() for u in range(len(found.dwell))]
    assert mean == pytest.approx(np.array(exact), abs=1e-9)


def test_approach_and_order_of_loading_are_told():
    block = session()
    found = cut_all(block)
    last = found.label == np.flatnonzero(found.dwell)[-1]
    assert (found.sense[last, 0] == 1.0).all()
    assert found.at_rest[last].all()


def test_the_approach_is_that_of_the_motion_whatever_a_count_says_as_it_ends():
    """Speeds of dense joint states are of a moment: half a count either way is a slow speed."""
    block = session()
    speed = np.gradient(ramp(block.time, 3.0, 5.0, 0.0, 0.5), block.time)
    speed[block.time > 5.02] = -STEP / 0.05
    told = replace(block, theta_dot=np.stack([speed, np.zeros_like(speed)], axis=1))
    found = cut_all(told)
    last = found.label == np.flatnonzero(found.dwell)[-1]
    assert (found.sense[last, 0] == 1.0).all()


def test_a_slow_sweep_is_no_rest():
    time = np.arange(0.0, 60.0, 0.02)
    theta = STEP * np.round(np.stack([0.002 * time, np.zeros_like(time)], axis=1) / STEP)
    found = cut_all(Block(time, theta, np.zeros((len(time), 6))))
    assert not found.dwell.any()


def test_poses_measured_one_by_one_are_dwells_of_one():
    time = 30.0 * np.arange(8.0)
    theta = np.random.default_rng(2).uniform(-0.5, 0.5, (8, 2))
    found = cut_all(Block(time, theta, np.zeros((8, 6))))
    assert found.dwell.tolist() == [True] * 8
    assert found.label.tolist() == list(range(8))
    assert (found.block.theta_dot == 0.0).all()


def test_rows_without_a_measurement_tell_the_path_but_are_no_unit_in_motion():
    block = session(1000.0)
    measured = np.zeros(len(block), dtype=bool)
    measured[::50] = True
    found = cut(block, STEP, measured)
    moving = ~found.dwell[found.label] & (found.label >= 0)
    assert moving.any()
    assert measured[moving].all()


def crept(counts):
    """Cut five seconds in which motor 1 creeps by some encoder counts."""
    time = np.arange(0.0, 5.0, 0.01)
    theta = np.zeros((len(time), 2))
    theta[:, 0] = STEP * np.round(counts * time / 5.0)
    return cut_all(Block(time, theta, np.zeros((len(time), 6))))


def test_a_flickering_count_is_at_rest_and_a_slow_creep_is_not():
    assert crept(1).dwell.tolist() == [True]
    assert not crept(8).dwell.any()


@pytest.mark.parametrize("readings", [1, 2, 3])
def test_a_pose_that_was_read_a_few_times_is_one_rest(readings):
    """Half a second apart; between two poses nothing was read."""
    time = (8.0 * np.arange(20)[:, None] + 0.5 * np.arange(readings)).ravel()
    theta = np.repeat(STEP * np.arange(40.0).reshape(20, 2) * 50.0, readings, axis=0)
    found = cut_all(Block(time, theta, np.zeros((len(time), 6))))
    assert found.dwell.all()
    assert found.label.tolist() == np.repeat(np.arange(20), readings).tolist()
    # Two poses in one burst are a motion.
    moving = theta.copy()
    moving[readings : 2 * readings] += np.linspace(0.0, 0.2, readings)[:, None]
    found = cut_all(Block(time, moving, np.zeros((len(time), 6))))
    assert found.dwell.sum() == 20 - (readings > 1)
