"""Angles that are read less often than sent are told from angles that rest or creep by counts."""

import numpy as np
import pytest

from wrist_stiffness.sessions.reading.joint_states import without_held
from wrist_stiffness.sessions.reading.signals import Signal

COUNT = np.radians(0.015)
TIME_NS = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(2000)


ENCODERS = pytest.mark.parametrize(
    "count", [COUNT, *(2.0 * np.pi / 2.0**bits for bits in (12, 18))], ids=["usual", "12", "18"]
)


def counted(angle, count=COUNT):
    return np.stack([np.round(angle / count), np.round(0.3 * angle / count)], axis=1) * count


def moves(count=COUNT):
    """Swings of 10 deg with rests between."""
    t = 0.01 * np.arange(2000)
    return counted(np.radians(10.0) * np.sin(np.clip(t % 5.0, 0.0, 2.0 * np.pi / 2.0)), count)


@ENCODERS
@pytest.mark.parametrize("every", [2, 5, 10])
def test_repetitions_are_left_out(every, count):
    rows = np.arange(2000)
    kept, held_s = without_held(Signal(TIME_NS, moves(count)[rows - rows % every]))
    assert held_s == pytest.approx(0.01 * every)
    np.testing.assert_array_equal(kept.time_ns, TIME_NS[::every])


@ENCODERS
@pytest.mark.parametrize("speed_deg_s", [0.2, 1.0, 5.0, 30.0])
def test_slow_motion_in_counts_is_no_repetition(speed_deg_s, count):
    signal = Signal(TIME_NS, counted(np.radians(speed_deg_s) * 0.01 * np.arange(2000), count))
    assert without_held(signal) == (signal, 0.0)


def test_counts_that_are_zeroed_anew_are_no_repetition():
    """By a third of a count, which is no step of the encoder then."""
    angles = counted(np.radians(0.2) * 0.01 * (np.arange(2000) % 1000))
    angles[1000:] += COUNT / 3.0
    signal = Signal(TIME_NS, angles)
    assert without_held(signal) == (signal, 0.0)


def test_a_count_that_is_rounded_in_two_ways_is_one_count():
    angles = counted(np.radians(0.2) * 0.01 * (np.arange(2000) % 1000), 2.0 * np.pi / 2.0**12)
    angles[1000:] *= 1.0 + 1e-15
    signal = Signal(TIME_NS, angles)
    assert without_held(signal) == (signal, 0.0)


def test_moves_with_rests_between_are_no_repetition():
    signal = Signal(TIME_NS, moves())
    assert without_held(signal) == (signal, 0.0)


def test_one_joint_state_is_none():
    signal = Signal(TIME_NS[:1], np.zeros((1, 2)))
    assert without_held(signal) == (signal, 0.0)


def test_a_few_jumps_tell_nothing():
    """Nine jumps of a driver that starts, two states apart, in twenty seconds."""
    jumps = np.minimum(np.arange(2000) // 2, 9)
    signal = Signal(TIME_NS, counted(np.radians(0.5) * jumps))
    assert without_held(signal) == (signal, 0.0)


@pytest.mark.parametrize(("every", "jitter"), [(10.003, 0.3), (5.0, 0.3), (2.5, 0.0)])
def test_out_of_step_with_the_encoders_no_held_angle_is_kept_in_motion(every, jitter):
    """A reading may be a state late or early; what is kept is no older than one state."""
    rng, rows = np.random.default_rng(1), np.arange(2000)
    reading = np.sort(every * np.arange(-1, 2000) + jitter * rng.standard_normal(2001))
    moment = reading[np.searchsorted(reading, rows, side="right") - 1]
    motion = np.radians(10.0) * np.sin(2.0 * np.pi * rows / 300.0)
    held = np.radians(10.0) * np.sin(2.0 * np.pi * moment / 300.0)
    kept, held_s = without_held(Signal(TIME_NS, counted(held)))
    assert held_s > 0.0
    now = counted(motion)[np.searchsorted(TIME_NS, kept.time_ns)]
    # One state is 0.2 deg in the middle of the swing.
    assert np.degrees(np.abs(kept.values - now)).max() < 0.3
