"""Columns of an effect that was found add up to the effect."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.campaign.candidates import meeting

SMALL = 1e-4


def turned(vectors, angles):
    """Change of vectors (u, 3) by turns about x, y and z, as a shift of six numbers (u, 6)."""
    moved = Rotation.from_rotvec(angles).apply(vectors) - vectors
    return np.hstack([moved, np.zeros_like(moved)])


def test_two_large_turns_are_met_where_their_tangents_miss_by_a_tenth():
    vectors = np.random.default_rng(2).normal(size=(50, 3))
    angles = np.array([0.6, -0.4, 0.0])
    tangents = np.stack([turned(vectors, SMALL * row) / SMALL for row in np.eye(3)], axis=-1)
    whole = turned(vectors, angles)
    assert np.linalg.norm(tangents @ angles - whole) > 0.1 * np.linalg.norm(whole)
    met = meeting(tangents, angles, whole)
    np.testing.assert_allclose(met @ angles, whole, atol=1e-12)
    # The turn that is not there keeps its tangent.
    np.testing.assert_array_equal(met[:, :, 2], tangents[:, :, 2])


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_a_law_that_does_nothing_here_is_left_alone(value):
    columns = np.zeros((4, 6, 2))
    np.testing.assert_array_equal(meeting(columns, np.full(2, value), np.zeros((4, 6))), columns)
