"""How well dwells repeat, on a table made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.comparing.compare import by_side, repeatability
from wrist_stiffness.comparing.comparison import sizes


def along(component, values):
    out = np.zeros((len(values), 6))
    out[:, component] = values
    return out


def repeated(dwells, rng, extra):
    """Pairs of dwells, half of them approached from both sides."""
    observations = dwells(rng)
    n = observations.n_units
    label = np.arange(n) // 4
    shared = extra * rng.normal(size=(n // 4, 6))[label]
    return replace(
        observations,
        values=observations.values * 2 + shared,
        replicate=label,
    )


def test_lost_motion_shows_in_repeats_from_any_side_only(dwells):
    rng = np.random.default_rng(11)
    observations = repeated(dwells, rng, 0.0)
    gap = along(2, 10e-6 * observations.covariates["approach_1"])
    observations = observations.with_values(observations.values + gap)
    assert repeatability(observations)["s_um"] > 9
    assert repeatability(by_side(observations))["s_um"] == pytest.approx(2 * np.sqrt(3), rel=0.15)


def test_one_gauge_repeats_as_well_as_that_gauge(dwells):
    """Axes that it does not see have no scatter of their own, least of all a metre."""
    everything = repeated(dwells, np.random.default_rng(11), 0.0)
    gauge = everything.with_values(everything.values * [np.nan, np.nan, 1, np.nan, np.nan, np.nan])
    assert list(repeatability(gauge)) == ["s_um"]
    assert repeatability(gauge)["s_um"] < repeatability(everything)["s_um"]


def test_uncertainty_of_an_error_is_its_scatter_over_repetitions(dwells):
    draws = [sizes(dwells(rng))["s_um"] for rng in np.random.default_rng(12).spawn(60)]
    scatter = np.std([each.rms for each in draws], ddof=1)
    assert np.mean([each.rms_uncertainty for each in draws]) == pytest.approx(scatter, rel=0.3)
