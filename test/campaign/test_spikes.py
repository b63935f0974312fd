"""Spikes stand out from what neighbours usually do, and only they."""

import numpy as np
import pytest

from wrist_stiffness.campaign.reading.spikes import spikes

LEAST = np.full((500, 1), 1e-6)


def noisy(size, at=(100, 101, 400)):
    values = 5e-6 * np.random.default_rng(4).standard_normal((500, 1))
    values[list(at), 0] += size
    return values


@pytest.mark.parametrize("size", [150e-6, -150e-6])
def test_thirty_deviations_are_a_spike(size):
    assert np.flatnonzero(spikes(noisy(size), LEAST)).tolist() == [100, 101, 400]


def test_eight_deviations_are_not_yet_a_lost_beam():
    assert not spikes(noisy(40e-6), LEAST).any()


def test_smaller_ones_than_the_least_are_none():
    assert not spikes(noisy(150e-6), 1e3 * LEAST).any()


def test_each_measurement_has_a_least_of_its_own_also_where_others_are_missing():
    values, least = noisy(150e-6), LEAST.copy()
    values[:90], least[400] = np.nan, 1e-3
    assert np.flatnonzero(spikes(values, least)).tolist() == [100, 101]
