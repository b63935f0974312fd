"""Angles that are held, wild ones and wrong speeds are told from what motors and drivers do."""

import numpy as np
import pytest

from wrist_stiffness.sessions.reading.joint_states import (
    fault_of,
    gains,
    without_held,
    without_wild,
)
from wrist_stiffness.sessions.reading.signals import Signal

COUNT, FINE_COUNT = np.radians(0.015), np.radians(8e-3)
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


def motion(rate_hz, speed=0.5, seconds=20.0):
    """Return angles in counts and true speeds of a swing."""
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    phase = np.outer(time, [1.0, 1.3])
    angles = FINE_COUNT * np.round(speed * np.sin(phase) / [1.0, 1.3] / FINE_COUNT)
    stamps = np.round(1e9 * time).astype(np.int64)
    return Signal(stamps, angles), Signal(stamps, speed * np.cos(phase))


@pytest.mark.parametrize("rate_hz", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("speed", [0.05, 0.5])
def test_right_speeds_are_believed_slow_and_fast(rate_hz, speed):
    angles, told = motion(rate_hz, speed)
    assert gains(told, angles) == pytest.approx([1.0, 1.0], abs=0.05)
    assert fault_of(told, angles) == ""
    late = Signal(told.time_ns + 50_000_000, told.values)
    assert fault_of(late, angles) == ""


@pytest.mark.parametrize("rate_hz", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize(("motor", "factor"), [(0, -1.0), (1, np.degrees(1.0)), (1, 0.0)])
def test_wrong_speeds_are_named_with_their_motor(rate_hz, motor, factor):
    angles, told = motion(rate_hz)
    values = told.values.copy()
    values[:, motor] *= factor
    said = fault_of(Signal(told.time_ns, values), angles)
    assert f"speeds of motor_{motor + 1}" in said
    assert float(said.split(" are ")[1].split(" times")[0]) == pytest.approx(factor, rel=0.05)


def test_a_motor_at_rest_says_nothing_of_its_speeds():
    angles, told = motion(100.0)
    still = Signal(angles.time_ns, np.zeros_like(angles.values))
    assert np.isnan(gains(told, still)).all()
    assert fault_of(told, still) == ""


def test_one_state_says_nothing():
    one = Signal(np.array([0]), np.zeros((1, 2)))
    assert fault_of(one, one) == ""
