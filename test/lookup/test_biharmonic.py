"""Biharmonic spline: against literal formulas, SciPy and brute force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.biharmonic import BiharmonicSpline

HALF_RANGE = np.array([1.1, 0.8])


def square_grid(count, half_range=HALF_RANGE):
    axis = np.linspace(-1.0, 1.0, count)
    return np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2) * half_range


def scattered(seed=0, inner=40):
    """Four corners, so that the box does not depend on an inner node, and random inner nodes."""
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * HALF_RANGE
    inside = np.random.default_rng(seed).uniform(-0.9, 0.9, (inner, 2)) * HALF_RANGE
    return np.vstack([corners, inside])


def queries(count=500, seed=1):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 2)) * HALF_RANGE


def smooth(theta):
    x, y = theta[..., 0], theta[..., 1]
    return np.stack([np.exp(0.5 * x) * np.cos(1.5 * y), np.sin(2.0 * x * y), 1.0 + x], axis=-1)


def literal_sum(spline, theta):
    """The spline as it is written, away from the nodes."""
    query = (theta - spline.offset) / spline.scale
    nodes = (spline.nodes - spline.offset) / spline.scale
    total = np.zeros(spline.coefficients.shape[1])
    for node, weight in zip(nodes, spline.coefficients, strict=False):
        r = np.sqrt(np.sum((query - node) ** 2))
        total += r**2 * np.log(r) * weight
    return total + np.array([1.0, *query]) @ spline.coefficients[-3:]


def test_values_at_the_nodes_are_reproduced():
    nodes = scattered()
    values = np.random.default_rng(2).normal(size=(len(nodes), 3))
    spline = BiharmonicSpline.fit(nodes, values)
    np.testing.assert_allclose(spline(nodes), values, atol=1e-11)


def test_a_plane_is_reproduced():
    nodes, theta = square_grid(5), queries()
    slopes = np.array([[2.0, -0.3], [0.5, 4.0]])
    spline = BiharmonicSpline.fit(nodes, nodes @ slopes + [1.0, -7.0])
    np.testing.assert_allclose(spline(theta), theta @ slopes + [1.0, -7.0], atol=1e-12)


def test_it_agrees_with_scipy():
    nodes, theta = scattered(), queries()
    box = 2.0 * HALF_RANGE
    oracle = RBFInterpolator(
        nodes / box, smooth(nodes), kernel="thin_plate_spline", degree=1, smoothing=0.0
    )
    spline = BiharmonicSpline.fit(nodes, smooth(nodes))
    np.testing.assert_allclose(spline(theta), oracle(theta / box), atol=1e-11)


def test_value_agrees_with_the_literal_sum():
    spline = BiharmonicSpline.fit(scattered(), smooth(scattered()))
    for theta in queries(20):
        np.testing.assert_allclose(spline(theta), literal_sum(spline, theta), atol=1e-11)


def test_with_the_unit_box_the_unit_does_not_matter():
    nodes, theta = square_grid(5), queries()
    in_radians = BiharmonicSpline.fit(nodes, smooth(nodes))(theta)
    unit = np.array([180.0 / np.pi, 1.0 / 0.4])
    elsewhere = BiharmonicSpline.fit(nodes * unit, smooth(nodes))(theta * unit)
    np.testing.assert_allclose(elsewhere, in_radians, atol=1e-11)


def test_error_falls_with_the_grid_as_theory_says():
    # Surface splines of order 2 converge as h^2.5 in the mean square, held back by the edge
    # (Johnson 2001, Math. Comp. 70), and as h^4 inside, where the edge does not reach.
    theta = queries(3000)
    inside = np.abs(theta / HALF_RANGE).max(axis=-1) < 0.5
    mean_square, inner = [], []
    for count in (9, 17, 33):
        nodes = square_grid(count)
        error = BiharmonicSpline.fit(nodes, smooth(nodes))(theta) - smooth(theta)
        mean_square.append(np.sqrt(np.mean(error**2)))
        inner.append(np.abs(error[inside]).max())
    orders = np.log2(mean_square[:-1]) - np.log2(mean_square[1:])
    assert orders[0] < orders[1] == pytest.approx(2.5, abs=0.2)
    assert np.log2(inner[1] / inner[2]) > 3.8


def test_query_shapes_agree():
    # Longer than a block of queries: block borders must not show.
    nodes = square_grid(5)
    spline = BiharmonicSpline.fit(nodes, smooth(nodes))
    theta = queries(3000).reshape(3, 1000, 2)
    assert spline(theta).shape == (3, 1000, 3)
    for place in [(0, 0), (1, 23), (1, 24), (2, 999)]:
        np.testing.assert_allclose(spline(theta)[place], spline(theta[place]), atol=1e-13)
    assert spline(np.zeros((0, 2))).shape == (0, 3)
    assert np.isnan(spline([np.nan, 0.0])).all()


def test_the_same_query_gives_the_same_bits():
    nodes, theta = square_grid(9), queries()
    spline = BiharmonicSpline.fit(nodes, smooth(nodes))
    stored = replace(spline, coefficients=spline.coefficients.copy())
    for query in (theta, theta[17]):
        np.testing.assert_array_equal(spline(query), stored(query.copy()))


def test_fit_keeps_its_own_copy_of_the_nodes():
    nodes = square_grid(5)
    spline = BiharmonicSpline.fit(nodes, smooth(nodes))
    nodes += 1.0
    np.testing.assert_array_equal(spline.nodes, square_grid(5))


ONES = np.ones((9, 1))


@pytest.mark.parametrize(
    ("nodes", "values", "message"),
    [
        (square_grid(3)[:2], ONES[:2], "2 given; at least 3"),
        (np.zeros((0, 2)), np.zeros((0, 1)), "0 given; at least 3"),
        (square_grid(3) * [0.0, 1.0], ONES, "all 9 lie on a line"),
        (np.linspace(0, 1, 9)[:, None] * [1.0, 2.0] + 3.0, ONES, "all 9 lie on a line"),
    ],
)
def test_unusable_nodes_are_refused(nodes, values, message):
    with pytest.raises(InputError, match=message):
        BiharmonicSpline.fit(nodes, values)


def test_the_nearest_nodes_that_are_allowed_still_give_a_sound_spline():
    pair = square_grid(5)[12] + [[2.5e-6, 0.0]]
    nodes = np.vstack([square_grid(5), pair])
    spline = BiharmonicSpline.fit(nodes, smooth(nodes))
    without = BiharmonicSpline.fit(nodes[:-1], smooth(nodes[:-1]))
    np.testing.assert_allclose(spline(nodes), smooth(nodes), atol=1e-9)
    # The pair fixes the slope at one place: the surface changes by no more than it was off there.
    np.testing.assert_allclose(spline(queries()), without(queries()), atol=2e-3)
