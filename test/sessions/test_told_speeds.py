"""Speeds that drivers tell are believed only where the angles beside them say the same."""

import numpy as np
import pytest

from wrist_stiffness.sessions.reading.joint_states import fault_of, gains
from wrist_stiffness.sessions.reading.signals import Signal

COUNT = np.radians(8e-3)


def motion(rate_hz, speed=0.5, seconds=20.0):
    """Return angles in counts and true speeds of a swing."""
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    phase = np.outer(time, [1.0, 1.3])
    angles = COUNT * np.round(speed * np.sin(phase) / [1.0, 1.3] / COUNT)
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
