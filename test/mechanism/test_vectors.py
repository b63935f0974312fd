"""Vector algebra against NumPy and by its definitions."""

import numpy as np
import pytest

from wrist_stiffness.mechanism.vectors import (
    angle_between,
    cross,
    dot,
    skew,
    triad,
    unit,
)

ROUNDING = 1e-14


@pytest.fixture
def pairs():
    rng = np.random.default_rng(3)
    return rng.normal(size=(2, 50, 3))


def test_products_are_numpys(pairs):
    u, v = pairs
    assert np.allclose(cross(u, v), np.cross(u, v), rtol=0.0, atol=ROUNDING)
    assert np.allclose(dot(u, v), np.sum(u * v, axis=1), rtol=0.0, atol=ROUNDING)
    assert np.allclose(np.einsum("nij,nj->ni", skew(u), v), np.cross(u, v), atol=ROUNDING)


def test_a_triad_is_a_right_handed_frame_that_begins_with_its_axis(pairs):
    u, v = unit(pairs[0]), pairs[1]
    frame = triad(u, v)
    assert np.allclose(np.swapaxes(frame, -1, -2) @ frame, np.eye(3), atol=ROUNDING)
    assert np.allclose(np.linalg.det(frame), 1.0, atol=ROUNDING)
    assert np.array_equal(frame[..., 0], u)
    assert np.allclose(dot(frame[..., 1], v), 0.0, atol=ROUNDING)


@pytest.mark.parametrize("small", [1e-12, 1e-9, 1e-5])
def test_angles_near_0_and_pi_keep_their_digits(small):
    u, v = np.array([1.0, 0.0, 0.0]), np.array([np.cos(small), np.sin(small), 0.0])
    assert angle_between(u, v) == pytest.approx(small, rel=1e-12)
    # Near pi the double itself has a step of 4e-16.
    assert np.pi - angle_between(u, -v) == pytest.approx(small, abs=1e-15)
