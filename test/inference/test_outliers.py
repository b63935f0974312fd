"""Units that no model explains are found although a fit to all of them would follow them."""

import numpy as np
import pytest

from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.outliers import lost_units

N = 60


@pytest.mark.parametrize("lost", [[], [7], [54, 55, 56, 57, 58, 59]])
def test_lost_units_are_found_where_a_slope_could_follow_them(rng, lost):
    """A tenth of all at the end of the range draws a plain fit along, until nothing stands out."""
    x = np.linspace(-1.0, 1.0, N)
    values = rng.normal(size=(N, 2))
    values[lost] += 40.0
    columns = np.zeros((N, 2, 4))
    for component in range(2):
        columns[:, component, 2 * component : 2 * component + 2] = np.stack([x**0, x], axis=1)
    found = lost_units(Observations(values, {"x": x}), columns, 7.0)
    assert np.flatnonzero(found).tolist() == lost
