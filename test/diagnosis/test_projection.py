import numpy as np
import pytest

from wrist_stiffness.diagnosis.projection import leading_directions, make_base, orthonormal


def test_a_prior_row_shrinks_like_bayes(rng):
    column, values, prior = rng.normal(size=(20, 1)), rng.normal(size=20), 0.3
    base = make_base(np.column_stack([column, values]), np.array([prior]), 20)
    precision = column[:, 0] @ column[:, 0] + prior**-2
    mean = column[:, 0] @ values / precision
    np.testing.assert_allclose(base.residual[:20], values - column[:, 0] * mean)
    assert base.energy == pytest.approx(
        np.sum((values - column[:, 0] * mean) ** 2) + (mean / prior) ** 2
    )
    assert base.freedom == 20


def test_a_column_inside_the_base_adds_nothing(rng):
    columns = rng.normal(size=(30, 3))
    base = make_base(np.column_stack([columns, rng.normal(size=30)]), np.full(3, np.inf), 30)
    assert base.directions(columns @ rng.normal(size=(3, 2))).shape[1] == 0


def test_scale_of_a_column_does_not_matter(rng):
    columns = rng.normal(size=(30, 2))
    one, other = orthonormal(columns), orthonormal(columns * [1e-9, 1e9])
    np.testing.assert_allclose(one @ one.T, other @ other.T, atol=1e-12)


def test_extending_equals_fitting_at_once(rng):
    columns, values = rng.normal(size=(30, 5)), rng.normal(size=30)
    first = make_base(np.column_stack([columns[:, :2], values]), np.full(2, np.inf), 30)
    step = first.extended(columns[:, 2:])
    once = make_base(np.column_stack([columns, values]), np.full(5, np.inf), 30)
    np.testing.assert_allclose(step.residual, once.residual, atol=1e-12)
    assert step.freedom == once.freedom == 25


@pytest.mark.parametrize("shape", [(40, 15), (15, 40)], ids=["tall", "wide"])
def test_leading_directions_are_the_singular_ones(rng, shape):
    columns = rng.normal(size=shape) * 10.0 ** -np.arange(shape[1])[::-1].clip(max=4)
    unit = columns / np.linalg.norm(columns, axis=0)
    wanted = np.linalg.svd(unit, full_matrices=False)[0][:, :6]
    found = leading_directions(columns, 6)
    np.testing.assert_allclose(found @ found.T, wanted @ wanted.T, atol=1e-9)
