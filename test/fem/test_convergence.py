"""Richardson's extrapolation, and a mesh study of a whole wrist on coarse meshes."""

import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.fem.convergence import (
    FASTEST_ORDER,
    QUANTITIES,
    SLOWEST_ORDER,
    mesh_convergence,
    richardson,
)
from wrist_stiffness.mechanism.geometry_file import mechanism_of


def test_richardson_recovers_order_and_limit_of_a_power_law():
    sizes = np.array([2.25, 1.5, 1.0])
    limits, orders = np.array([3.0, -2.0]), np.array([0.9, 1.3])
    values = limits - 0.1 * sizes[:, None] ** orders
    order, limit = richardson(values, 1.5)
    np.testing.assert_allclose(order, orders, rtol=1e-9)
    np.testing.assert_allclose(limit, limits, rtol=1e-9)


@pytest.mark.parametrize("last", [1.0, 0.9, 2.5], ids=["stalled", "turned", "running away"])
def test_a_sequence_that_does_not_settle_gets_the_slowest_order(last):
    order, limit = richardson(np.array([[0.0], [1.0], [last]]), 2.0)
    assert order[0] == SLOWEST_ORDER or last == 1.0
    assert abs(limit[0] - last) >= abs(last - 1.0)


def test_an_order_too_good_to_be_true_is_not_believed():
    order, _ = richardson(np.array([[0.0], [1.0], [1.001]]), 2.0)
    assert order[0] == FASTEST_ORDER


@pytest.mark.parametrize("factors", [(2.0, 1.0), (1.0, 1.5, 2.25), (3.0, 2.0, 1.0)])
def test_levels_must_fall_geometrically(make_wrist, coarse, factors):
    wrist = make_wrist()
    pose = mechanism_of(wrist).forward(np.zeros((1, 2)))
    with pytest.raises(InputError, match="falling geometric sequence"):
        mesh_convergence(wrist, pose, coarse, factors)


@pytest.mark.slow
def test_finer_meshes_are_softer_and_the_stated_error_holds(make_wrist, coarse):
    """The error stated from three coarse meshes covers the step to a fourth, finer one."""
    wrist = make_wrist()
    poses = mechanism_of(wrist).forward(np.array([[0.0, 0.0], [0.4, -0.3]]))
    study = mesh_convergence(wrist, poses, coarse, (1.69, 1.3, 1.0, 1.0 / 1.3))
    assert study.values.shape == (4, len(QUANTITIES))
    assert np.all(np.diff(study.elements) > 0)
    # Displacement elements are too stiff: compliance grows from below.
    assert np.all(np.diff(study.values, axis=0) > 0)
    assert np.all(study.errors() < 0)
    _, limit = richardson(study.values[:3], 1.3)
    assert np.all(study.values[3] < limit)
    # What a mesh of 14,000 tetrahedra for the whole wrist is good for.
    assert np.all(study.errors()[-1] > -0.05)
