import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.monitor import (
    MonitorSettings,
    ResidualMonitor,
    residual_of_pose,
)
from wrist_stiffness.model.error_model import Load

NOISE = np.repeat([1e-6, 2e-5], 3)
SETTINGS = MonitorSettings(NOISE, baseline=400)
NO_VARIANCE = np.zeros(6)


def run(samples, settings=SETTINGS, variance=NO_VARIANCE):
    """Return the monitor and the samples at which the alarm was on."""
    monitor, alarms = ResidualMonitor(settings), []
    for i, sample in enumerate(samples):
        monitor.add(sample, variance)
        if monitor.alarm:
            alarms.append(i)
    return monitor, alarms


def noise(count, seed=0):
    return NOISE * np.random.default_rng(seed).normal(size=(count, 6))


def test_a_perfect_measurement_leaves_no_residual(model):
    prediction = model.predict(np.array([0.3, -0.1]), Load(np.array([1.0, 0, -1.0, 0, 0.02, 0])))
    rotation, shift = prediction.motion
    pose = rotation @ prediction.configuration.platform
    assert np.allclose(residual_of_pose(pose, shift, prediction), 0.0, atol=1e-15)


def test_a_further_motion_from_the_left_is_the_residual(model):
    prediction = model.predict(np.array([0.3, -0.1]), Load(np.array([1.0, 0, -1.0, 0, 0.02, 0])))
    rotation, shift = prediction.motion
    turn, move = Rotation.from_rotvec([1e-4, -2e-4, 3e-4]).as_matrix(), np.array([1e-5, 0, -2e-5])
    residual = residual_of_pose(
        turn @ rotation @ prediction.configuration.platform, turn @ shift + move, prediction
    )
    assert np.allclose(residual[3:], [1e-4, -2e-4, 3e-4], rtol=1e-9)
    # The shift is that of the screw: to first order the move, less half of the turn times it.
    assert np.allclose(residual[:3], move, atol=1e-8)


def test_noise_as_stated_raises_no_alarm_and_has_the_ratio_one():
    monitor, alarms = run(3e-6 + noise(20_000))
    assert alarms == []
    assert monitor.ratio == pytest.approx(1.0, abs=0.02)
    assert monitor.rms[0] == pytest.approx(np.hypot(3e-6, 1e-6), rel=0.02)


@pytest.mark.parametrize("component", range(6))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_change_of_one_deviation_is_found_soon(component, sign):
    samples = noise(3000)
    samples[1000:, component] += sign * NOISE[component]
    _, alarms = run(samples)
    assert 1000 <= alarms[0] < 1100


def test_the_alarm_ends_after_the_change_has_ended():
    samples = noise(3000)
    samples[1000:1500, 2] += 3.0 * NOISE[2]
    _, alarms = run(samples)
    assert 1490 < alarms[-1] < 1650


def test_where_it_is_said_to_fail_it_fails():
    small = noise(5000)
    small[1000:, 0] += 0.1 * NOISE[0]
    assert run(small)[1] == []
    early = noise(5000)
    early[:, 0] += 5.0 * NOISE[0]
    assert run(early)[1] == []


def test_the_uncertainty_of_the_model_counts_as_noise():
    samples = noise(2000)
    samples[1000:, 0] += 3.0 * NOISE[0]
    assert run(samples)[1]
    assert run(samples, variance=100.0 * NOISE**2)[1] == []


def test_what_is_not_measured_is_left_out():
    samples = noise(3000)
    samples[:, 3:] = np.nan
    samples[1000:, 1] += 2.0 * NOISE[1]
    monitor, alarms = run(samples)
    assert alarms[0] >= 1000
    assert np.all(np.isfinite(monitor.rms))
