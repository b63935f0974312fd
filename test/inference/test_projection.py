import numpy as np
import pytest

from wrist_stiffness.inference.projection import leading_directions, orthonormal


def test_scale_of_a_column_does_not_matter(rng):
    columns = rng.normal(size=(30, 2))
    one, other = orthonormal(columns), orthonormal(columns * [1e-9, 1e9])
    np.testing.assert_allclose(one @ one.T, other @ other.T, atol=1e-12)


@pytest.mark.parametrize("shape", [(40, 15), (15, 40)], ids=["tall", "wide"])
def test_leading_directions_are_the_singular_ones(rng, shape):
    columns = rng.normal(size=shape) * 10.0 ** -np.arange(shape[1])[::-1].clip(max=4)
    unit = columns / np.linalg.norm(columns, axis=0)
    wanted = np.linalg.svd(unit, full_matrices=False)[0][:, :6]
    found = leading_directions(columns, 6)
    np.testing.assert_allclose(found @ found.T, wanted @ wanted.T, atol=1e-9)
