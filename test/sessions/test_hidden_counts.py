"""What an encoder hides turns the platform as much as a simulation says, and stands are kept."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model.block import Block
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.observing import hidden_counts, stands_of
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.sessions.units import cut

DRAWS = 4000


def cut_of(table, block):
    return cut(block, table.geometry.limits.encoder_step, np.ones(len(block), dtype=bool))


@pytest.mark.parametrize("motor", [0, 1])
def test_a_position_anywhere_within_a_count_turns_the_platform_as_told(table, motor):
    rng = np.random.default_rng(motor)
    step = table.geometry.limits.encoder_step
    shown = step * np.round(rng.uniform(-0.5, 0.5, (5, 2)) / step)
    dwells = Block(30.0 * np.arange(5.0), shown, np.zeros((5, 6)))
    found = hidden_counts(table, cut_of(table, dwells), shown)
    true = np.repeat(shown[:, None], DRAWS, axis=1)
    true[:, :, motor] += step * rng.uniform(-0.5, 0.5, (5, DRAWS))
    forward = table.mechanism.forward
    turned = forward(true).platform @ np.swapaxes(forward(shown).platform, -1, -2)[:, None]
    vector = Rotation.from_matrix(turned.reshape(-1, 3, 3)).as_rotvec().reshape(5, DRAWS, 3)
    covariance = np.swapaxes(vector, 1, 2) @ vector / DRAWS
    expected = found[:, 3:, [motor]] @ np.swapaxes(found[:, 3:, [motor]], 1, 2)
    size = np.trace(expected, axis1=1, axis2=2)[:, None, None]
    # A variance of 4000 uniform draws is known to 1.4 %.
    assert covariance / size == pytest.approx(expected / size, abs=0.05)
    assert (found[:, :3] == 0.0).all()


def test_stands_of_two_sessions_are_never_one(model, table):
    """In each: 0  rest  3  move  4  rest  7, and at rest the load comes on."""
    time = np.arange(0.0, 7.0, 0.1)
    theta = np.stack([np.interp(time, (3.0, 4.0), (0.1, 0.4)), np.full(len(time), 0.2)], axis=1)
    load = np.zeros((len(time), 6))
    load[:, 2] = -np.interp(time, (1.0, 2.0, 5.0, 6.0), (0.0, 1.0, 1.0, 2.0))
    block = Block(time, theta, load)
    rotation = table.mechanism.platform_rotation(theta)
    each = as_units(model, MeasuredSession("a day", block, np.zeros((len(time), 3)), rotation))
    first, second = np.split(stands_of(model, [each, each]), 2)
    assert ((first < 0) == (second < 0)).all()
    assert len(set(first[first >= 0])) == len(set(second[second >= 0])) == 2
    assert not set(first[first >= 0]) & set(second[second >= 0])


def read_at_poses(model, seed, moves, loaded=False):
    """Twelve poses, each read four times, ten seconds apart: after a new approach, or at rest."""
    rng, step = np.random.default_rng(seed), model.table.geometry.limits.encoder_step
    pose = np.repeat(step * np.round(rng.uniform(-0.5, 0.5, (12, 2)) / step), 4, axis=0)
    hidden = rng.uniform(-0.5, 0.5, (48, 2)) * step
    if not moves:
        hidden = np.repeat(hidden[::4], 4, axis=0)
    load = np.zeros((48, 6))
    load[:, :3] = loaded * rng.uniform(-1.0, 1.0, (48, 3))
    block = Block(10.0 * np.arange(48.0), pose, load)
    seen = model.batch(block).measured
    shift = seen[:, :3] + rng.normal(0.0, 5e-7, (48, 3))
    noise = Rotation.from_rotvec(seen[:, 3:] + rng.normal(0.0, 1e-5, (48, 3))).as_matrix()
    rotation = noise @ model.table.mechanism.platform_rotation(pose + hidden)
    return as_units(model, MeasuredSession("a day", block, shift, rotation))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_loads_put_on_one_after_the_other_at_rest_are_no_fault_of_the_pose(model, seed):
    problem = WristProblem(model, (read_at_poses(model, seed, moves=False, loaded=True),))
    assert not problem.begin().rough


@pytest.mark.parametrize("moves", [False, True])
def test_whether_motors_moved_between_readings_is_told_by_what_they_show(model, moves):
    stand = stands_of(model, [read_at_poses(model, 1, moves)])
    if moves:
        assert (stand == -1).all()
    else:
        assert [len(set(four)) for four in stand.reshape(12, 4).tolist()] == [1] * 12
        assert len(set(stand.tolist())) == 12


def test_seen_from_beside_a_hidden_count_is_a_shift_too(model):
    """The instrument's frame is a millimetre off, and the fit tells so."""
    aside, read = np.array([1e-3, -2e-3, 5e-4]), read_at_poses(model, 1, moves=True)
    values = read.values + np.concatenate([aside, np.zeros(3)])
    table = WristProblem(model, (replace(read, values=values),)).begin().table
    found = table.observations.shared
    expected = np.cross(np.swapaxes(found[:, 3:], 1, 2), aside)
    # With opposite signs both are the same count.
    both = np.abs(np.swapaxes(found[:, :3], 1, 2)), np.abs(expected)
    assert np.linalg.norm(both[0] - both[1]) < 0.1 * np.linalg.norm(both[1])
