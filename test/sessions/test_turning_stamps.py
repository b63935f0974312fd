"""Which extremes between poses tell the way."""

import numpy as np

from wrist_stiffness.sessions.reading.path import turning_stamps
from wrist_stiffness.sessions.reading.signals import Signal

SECOND = 1_000_000_000
TIME_NS = np.arange(0, 4 * SECOND, SECOND // 100)


def swinging(size):
    """One swing to either side between the poses at 0.5 and 3.5 s: up at 1.5 s, down at 2.5 s."""
    t = 1e-9 * TIME_NS
    inside = (t >= 1.0) & (t <= 3.0)
    return Signal(TIME_NS, (size * np.where(inside, np.sin(np.pi * (t - 1.0)), 0.0))[:, None])


POSES_NS = np.array([SECOND // 2, 7 * SECOND // 2])


def test_both_extremes_of_a_gap_are_told():
    found = turning_stamps(swinging(1.0), POSES_NS, np.array([0.3]))
    np.testing.assert_array_equal(found, [3 * SECOND // 2, 5 * SECOND // 2])


def test_a_swing_below_the_least_is_no_turn():
    assert len(turning_stamps(swinging(0.2), POSES_NS, np.array([0.3]))) == 0


def test_poses_close_together_tell_the_way_themselves():
    close = np.arange(0, 4 * SECOND, SECOND // 10)
    assert len(turning_stamps(swinging(1.0), close, np.array([0.3]))) == 0
