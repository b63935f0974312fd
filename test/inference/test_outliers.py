"""Units that no model explains are found although a fit to all of them would follow them."""

import numpy as np
import pytest

from wrist_stiffness.inference import Candidate, Observations, Parameter, diagnose
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


@pytest.mark.parametrize("lost", [(), (7,)])
def test_coarse_digits_neither_hide_lost_units_nor_make_any(rng, lost):
    """Most values are rounded to 0: their deviations tell nothing of the scatter."""
    x = rng.uniform(-1.0, 1.0, 200)
    values = np.round(3.0 * np.maximum(x - 0.2, 0.0) + 0.25 * rng.normal(size=200))
    assert np.mean(values == 0.0) > 0.5
    values[list(lost)] = 2000.0
    hinge = Candidate(
        "hinge",
        "part",
        (Parameter("size"),),
        lambda table, shape: np.maximum(table.covariate("x") - 0.2, 0.0)[:, None, None],
    )
    units = Observations(1e-6 * values[:, None], {"x": x})
    result = diagnose(units, (hinge,), ordered=False)
    assert result.lost == lost
    assert result.noise["value_si"] == pytest.approx(0.27e-6, rel=0.2)


def test_a_beam_is_lost_where_all_others_are_rounded_to_nothing_or_one_digit(rng):
    values = np.where(rng.random((60, 2)) < 0.2, 1e-6, 0.0)
    values[7, 0] = 2e-3
    x = rng.uniform(-1.0, 1.0, 60)
    columns = x[:, None, None] * np.eye(2)
    found = lost_units(Observations(values, {"x": x}), columns, 7.0)
    assert np.flatnonzero(found).tolist() == [7]
