"""Exponential and logarithm of SE(3) against SciPy's rotations and the matrix exponential."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion, rotation_vector
from wrist_stiffness.mechanism.vectors import skew

twists = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array)
sizes = st.sampled_from([0.0, 1e-12, 1e-8, 1e-5, 0.99e-4, 1.01e-4, 1e-3, 0.1, 1.0])


@given(twists, sizes)
def test_exponential_is_that_of_the_matrix(direction, size):
    twist = size * direction
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = skew(twist[3:]), twist[:3]
    wanted = expm(matrix)
    rotation, shift = exp_twist(twist)
    np.testing.assert_allclose(rotation, wanted[:3, :3], atol=1e-14)
    np.testing.assert_allclose(shift, wanted[:3, 3], rtol=1e-12, atol=1e-14 * size)


@given(twists, sizes)
def test_logarithm_undoes_the_exponential(direction, size):
    twist = size * direction
    # The angle of a rotation matrix is known to rounding of its entries, 1e-16.
    np.testing.assert_allclose(log_motion(*exp_twist(twist)), twist, rtol=1e-9, atol=2e-16)


@pytest.mark.parametrize("angle", [1.9, 2.2, 3.0, 3.1415, np.pi - 1e-9])
def test_logarithm_of_large_turns(angle):
    axis = np.array([1.0, -2.0, 0.5]) / np.sqrt(5.25)
    rotation = Rotation.from_rotvec(angle * axis).as_matrix()
    found = log_motion(rotation, np.zeros(3))
    np.testing.assert_allclose(found[3:], angle * axis, rtol=1e-9)
    # One large turn among small ones, as a lost beam is among measured errors.
    small = Rotation.from_rotvec(1e-7 * axis).as_matrix()
    beside = rotation_vector(np.stack([[small, rotation], [np.full((3, 3), np.nan), small]]))
    np.testing.assert_allclose(beside[0, 1], angle * axis, rtol=1e-9)
    np.testing.assert_allclose(beside[[0, 1], [0, 1]], [1e-7 * axis] * 2, rtol=1e-9)
    assert np.isnan(beside[1, 0]).all()


def test_many_at_once_as_one_by_one():
    found = np.random.default_rng(0).normal(size=(5, 4, 6)) * np.logspace(-9, 0, 5)[:, None, None]
    rotation, shift = exp_twist(found)
    assert rotation.shape == (5, 4, 3, 3)
    for place in np.ndindex(5, 4):
        one_rotation, one_shift = exp_twist(found[place])
        np.testing.assert_allclose(rotation[place], one_rotation, atol=1e-16)
        np.testing.assert_allclose(shift[place], one_shift, atol=1e-16)
    np.testing.assert_allclose(log_motion(rotation, shift), found, rtol=1e-7, atol=2e-16)
