"""Spikes stand out from what neighbours usually do, and only they."""

import numpy as np
import pytest

from wrist_stiffness.sessions.reading.lost_beams import spikes

LEAST = 1e-6
STILL = np.zeros(500)
NEVER = STILL > 0.0
MOVING = np.arange(500) % 5 == 0


def noisy(size, at=(100, 101, 400)):
    values = 5e-6 * np.random.default_rng(4).standard_normal((500, 1))
    values[list(at), 0] += size
    return values


@pytest.mark.parametrize("size", [150e-6, -150e-6])
def test_thirty_deviations_are_a_spike(size):
    assert np.flatnonzero(spikes(noisy(size), LEAST, STILL, NEVER)).tolist() == [100, 101, 400]


def test_eight_deviations_are_not_yet_a_lost_beam():
    assert not spikes(noisy(40e-6), LEAST, STILL, NEVER).any()


def test_smaller_ones_than_the_least_are_none():
    assert not spikes(noisy(150e-6), 1e3 * LEAST, STILL, NEVER).any()


def test_where_others_are_missing_spikes_are_found_all_the_same():
    values = noisy(150e-6)
    values[:90] = np.nan
    assert np.flatnonzero(spikes(values, LEAST, STILL, NEVER)).tolist() == [100, 101, 400]


@pytest.mark.parametrize(("share", "found"), [(0.0, [100, 101, 400]), (0.2, [])])
def test_as_much_as_motion_does_everywhere_is_no_spike(share, found):
    """Late stamps make a share of the swing of it."""
    values = noisy(150e-6)
    values[MOVING, 0] += share * 1e-3
    swing = np.full(500, 1e-3)
    assert np.flatnonzero(spikes(values, LEAST, swing, MOVING)).tolist() == found


def test_of_few_moves_all_is_put_down_to_the_motion_that_may_be():
    """Of 25, one is off: what the others do tells nothing yet."""
    swing = np.where(np.arange(500) % 20 == 0, 1e-3, 0.0)
    assert np.flatnonzero(
        spikes(noisy(150e-6, at=(101, 400)), LEAST, swing, swing > 0.0)
    ).tolist() == [101]


def test_noise_in_slow_motion_is_no_excuse_in_fast_motion():
    """Of 0.1 mm, the swing of slow moves, noise of 5 um is much; some are ten times as fast."""
    swing = np.where(np.arange(500) % 55 == 0, 1e-3, 1e-4)
    values = noisy(200e-6, at=(110, 275))
    assert np.flatnonzero(spikes(values, LEAST, swing, MOVING)).tolist() == [110, 275]


def test_few_moves_that_are_off_by_thrice_what_most_are_off_are_no_spikes():
    values = noisy(0.0, at=())
    off = np.where(np.arange(500) % 55 == 0, 0.3e-3, 0.1e-3)
    values[MOVING, 0] += off[MOVING]
    assert not spikes(values, LEAST, np.full(500, 1e-3), MOVING).any()
