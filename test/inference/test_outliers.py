"""Units that no model explains are found although a fit to all of them would follow them."""

import numpy as np
import pytest

from wrist_stiffness.inference import Candidate, Nuisance, Observations, Parameter, diagnose
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
    found = lost_units(Observations(values, {"x": x}), columns[:, :, :0], columns, 7.0)
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
    found = lost_units(Observations(values, {"x": x}), columns[:, :, :0], columns, 7.0)
    assert np.flatnonzero(found).tolist() == [7]


def short_table(rng, n, m=1):
    """Noise with a slope on a zero thirty times as large; a list of laws longer than the rows."""
    x = rng.uniform(-1.0, 1.0, (n, 4))
    waves = np.column_stack([x, x**2, np.sin(3.0 * x), x[:, :1] * x[:, 1:]])
    structure = (waves[:, None, :, None] * np.eye(m)[:, None, :]).reshape(n, m, -1)
    base = np.broadcast_to(np.eye(m), (n, m, m))
    values = rng.normal(size=(n, m)) + rng.normal(0.0, 30.0, m) + 2.0 * x[:, :1]
    return values, base, structure


@pytest.mark.parametrize("n", [12, 13, 16, 20])
@pytest.mark.parametrize("m", [1, 3])
def test_a_short_table_loses_no_good_row_beside_many_laws(rng, n, m):
    """Its zero is in the model whatever else is, and what few rows leave by chance is no scatter.

    One good row of a thousand may look lost; sixty tables have a thousand rows.
    """
    lost = 0
    for _ in range(60):
        values, base, structure = short_table(rng, n, m)
        lost += lost_units(Observations(values, {}), base, structure, 7.0).sum()
    assert lost <= 60 * n / 1000


@pytest.mark.parametrize("m", [1, 3])
def test_a_lost_row_is_found_in_a_short_table(rng, m):
    found = 0
    for row in range(12):
        values, base, structure = short_table(rng, 12, m)
        values[row] += 40.0
        found += np.flatnonzero(
            lost_units(Observations(values, {}), base, structure, 7.0)
        ).tolist() == [row]
    assert found >= 11


def test_a_diagnosis_of_few_rows_keeps_them_all(rng):
    waves = [
        Candidate(
            f"wave {k}",
            "part",
            (Parameter("size", plausible=1.0),),
            lambda t, _, k=k: np.sin(k * t.covariate("x") + k)[:, None, None] * np.eye(3)[:, :1],
        )
        for k in range(1, 7)
    ]
    zero = Nuisance("zero", lambda t: np.broadcast_to(np.eye(3), (t.n_units, 3, 3)))
    for n in (12, 13, 14, 16):
        for _ in range(5):
            conditions = {name: rng.uniform(-1.0, 1.0, n) for name in "xyzuv"}
            values = rng.normal(size=(n, 3)) + rng.normal(0.0, 30.0, 3)
            units = Observations(values, conditions, np.eye(3))
            assert diagnose(units, waves, (zero,), ordered=False).lost == ()


def test_a_session_of_one_row_cannot_be_lost(rng):
    """Its own zero follows it: it leaves nothing that could be compared."""
    values, base, structure = short_table(rng, 20)
    own = np.zeros((20, 1, 1))
    own[4] = 1.0
    values[4] += 500.0
    base = np.concatenate([base, own], axis=2)
    assert not lost_units(Observations(values, {}), base, structure, 7.0).any()
