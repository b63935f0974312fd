"""One joint state alone may be wild; what motors do is not."""

import numpy as np
import pytest

from wrist_stiffness.sessions.reading.joint_states import without_wild
from wrist_stiffness.sessions.reading.signals import Signal

COUNT = np.radians(0.015)


def swinging(rate_hz, period_s=1.0):
    """Ten seconds of a swing of 10 deg, in counts that chatter."""
    time = np.arange(0.0, 10.0, 1.0 / rate_hz)
    angle = np.radians(10.0) * np.sin(2.0 * np.pi * time / period_s)
    angle += COUNT * np.random.default_rng(2).integers(-1, 2, len(time))
    time_ns = 1_700_000_000_000_000_000 + np.round(1e9 * time).astype(np.int64)
    return Signal(time_ns, np.stack([angle, 0.5 * angle], axis=1))


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 1000.0])
def test_what_motors_do_is_kept(rate_hz):
    signal = swinging(rate_hz)
    assert without_wild(signal)[1] == 0
    steps = Signal(signal.time_ns, np.where(signal.values > 0.0, np.radians(3.0), 0.0))
    assert without_wild(steps)[1] == 0


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 1000.0])
def test_a_single_wild_one_is_left_out_also_in_motion(rate_hz):
    signal = swinging(rate_hz)
    signal.values[[40, 120], [0, 1]] += np.radians(1.0)
    kept, left_out = without_wild(signal)
    assert left_out == 2
    np.testing.assert_array_equal(
        np.setdiff1d(signal.time_ns, kept.time_ns), signal.time_ns[[40, 120]]
    )


def test_stamps_that_jitter_make_no_angle_wild_and_hide_no_wild_one():
    """A millisecond of jitter at up to 90 deg/s; half a minute."""
    rng, time = np.random.default_rng(3), 0.01 * np.arange(3000)
    angle = COUNT * np.round(np.radians(10.0) * np.sin(2.0 * np.pi * time / 0.7) / COUNT)
    stamps = 1_700_000_000_000_000_000 + np.round(
        1e9 * (time + 1e-3 * rng.standard_normal(len(time)))
    ).astype(np.int64)
    sound = Signal(stamps, np.stack([angle, 0.5 * angle], axis=1))
    assert without_wild(sound)[1] == 0
    sound.values[[400, 1200], [0, 1]] += np.radians(1.0)
    kept, _ = without_wild(sound)
    np.testing.assert_array_equal(np.setdiff1d(stamps, kept.time_ns), stamps[[400, 1200]])


def test_stamps_that_are_right_though_irregular_make_no_angle_wild():
    """Read whenever the bus was free."""
    rng = np.random.default_rng(3)
    time = 0.01 * (np.arange(3000) + rng.uniform(-0.4, 0.4, 3000))
    angle = COUNT * np.round(np.radians(10.0) * np.sin(2.0 * np.pi * time / 0.7) / COUNT)
    time_ns = 1_700_000_000_000_000_000 + np.round(1e9 * time).astype(np.int64)
    assert without_wild(Signal(time_ns, np.stack([angle, 0.5 * angle], axis=1)))[1] == 0


def test_in_sparse_states_a_motor_may_have_gone_out_and_back():
    signal = swinging(10.0)
    signal.values[40] += np.radians(20.0)
    assert without_wild(signal)[1] == 0


def test_beside_a_gap_a_motor_may_have_gone_out_and_back():
    """One state between two gaps of 60 ms; nobody knows what the motor did in them."""
    signal = swinging(100.0, period_s=10.0)
    signal.values[500] += np.radians(3.0)
    for gaps in (range(495, 500), range(501, 506)):
        assert without_wild(signal)[1] == 1
        kept = np.setdiff1d(np.arange(len(signal)), gaps)
        assert without_wild(Signal(signal.time_ns[kept], signal.values[kept]))[1] == 0
