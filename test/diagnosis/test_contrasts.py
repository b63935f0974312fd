import numpy as np
import pytest

from wrist_stiffness.diagnosis import Observations, Quantity
from wrist_stiffness.diagnosis.contrasts import contrasts

MICRO = (Quantity("s", "um", (0, 1), 1e6),)


def observed(rng, change, n=300):
    conditions = {
        "approach": rng.choice([-1.0, 1.0], n),
        "load": rng.normal(0, 10, n),
        "hold": rng.exponential(20, n),
    }
    values = rng.normal(0, 1e-6, (n, 2)) + change(conditions)[:, None] * [0.6e-6, 0.8e-6]
    return Observations(values, conditions, quantities=MICRO)


def test_noise_alone_shows_no_contrast(rng):
    found = contrasts(observed(rng, lambda c: 0 * c["load"]))
    assert min(each.p_value for each in found) > 0.05


def test_lost_motion_is_told_with_its_size(rng):
    first = contrasts(observed(rng, lambda c: 2.5 * (c["approach"] > 0)))[0]
    assert first.condition == "approach"
    assert first.between_values == (-1, 1)
    assert first.size == pytest.approx(2.5, abs=4 * first.uncertainty)
    # Two groups of 150 units with 1 um in each component: 1 um * sqrt(2 / 150).
    assert first.uncertainty == pytest.approx(0.115, rel=0.15)
    assert "between approach = -1 and 1" in first.sentence


def test_what_acts_whatever_the_sign_of_the_load_is_seen(rng):
    first = contrasts(observed(rng, lambda c: (c["load"] / 10) ** 2))[0]
    assert first.condition == "load squared"


def test_blanks_are_left_out(rng):
    table = observed(rng, lambda c: 2.5 * (c["approach"] > 0))
    values = table.values.copy()
    values[::3, 0] = np.nan
    first = contrasts(table.with_values(values))[0]
    assert first.condition == "approach"
    assert first.size == pytest.approx(2.5, abs=4 * first.uncertainty)


def test_a_slope_is_told_over_two_standard_deviations(rng):
    first = contrasts(observed(rng, lambda c: 0.2 * c["load"]))[0]
    assert first.condition == "load"
    # 0.2 um per newton over twice 10 N; the spread of 300 loads is known to 4 %.
    assert first.size == pytest.approx(4.0, rel=0.12)
