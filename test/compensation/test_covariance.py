"""Stated covariances against Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.load_covariance import load_covariance, tangent_compliance
from wrist_stiffness.compensation.monitor import residual_of_pose
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.model.error_model import ErrorModel, Load

THETA = np.array([0.3, -0.2])
DOWN = np.array([0.3, 0.0, -1.0, 0.0, 0.01, 0.0])
NOISE = np.array([4e-3, 1e-3, 2e-4, 1e-5, 4e-5, 2e-6])
DRAWS = 1500
# Of an estimated standard deviation, from as many draws: three of its own deviations.
SAMPLING = 3.0 / np.sqrt(2.0 * DRAWS)


@pytest.fixture(scope="module")
def exact(make_table):
    """Return a model whose table claims no error of its own."""
    table = make_table()
    header = replace(table.header, errors={"stated_relative": 0.0})
    return ErrorModel("exact", replace(table, header=header), "closed_form")


def assert_same_spread(found, stated):
    """Compare the spread along the axes of the stated covariance."""
    values, axes = np.linalg.eigh(stated / np.outer(SCALE, SCALE))
    there = (found / SCALE) @ axes
    large = values > 1e-6 * values.max()
    assert np.allclose(there.std(axis=0)[large], np.sqrt(values[large]), rtol=SAMPLING)


SCALE = np.repeat([1e-6, 1e-4], 3)


@pytest.mark.parametrize("on_platform", [False, True])
def test_noise_of_the_load_spreads_as_stated(exact, on_platform):
    rng = np.random.default_rng(1)
    load = Load(DOWN, on_platform)
    prediction = exact.predict(THETA, load)
    stated = load_covariance(exact, prediction, load, NOISE)
    draws = DOWN + NOISE * rng.normal(size=(DRAWS, 6))
    found = [exact.predict(THETA, Load(draw, on_platform)).twist for draw in draws]
    assert_same_spread(np.array(found), stated)


def test_the_encoder_step_spreads_as_stated(exact):
    """The motor stands anywhere within half a step of what the encoder shows."""
    rng = np.random.default_rng(2)
    step = exact.table.geometry.limits.encoder_step
    shown = exact.predict(THETA, Load(DOWN))
    found = []
    for off in step * rng.uniform(-0.5, 0.5, (DRAWS, 2)):
        actual = exact.predict(THETA + off, Load(DOWN))
        rotation, shift = actual.motion
        pose = rotation @ actual.configuration.platform
        found.append(residual_of_pose(pose, shift, shown))
    assert_same_spread(np.array(found), shown.covariance)


def test_tangent_compliance_is_the_derivative_with_contacts_held(exact):
    prediction = exact.predict(THETA, Load(DOWN))
    assert 0 < np.sum(prediction.active) < len(prediction.active)
    tangent = tangent_compliance(exact, prediction)
    for i, change in enumerate(np.diag(np.repeat([1e-4, 1e-6], 3))):
        more, less = (exact.predict(THETA, Load(DOWN + sign * change)) for sign in (1, -1))
        assert np.array_equal(more.active, less.active)
        slope = (more.twist - less.twist) / (2.0 * change[i])
        assert np.allclose(tangent[:, i], slope, rtol=1e-6, atol=1e-9 * np.abs(slope).max())


def test_a_stream_adds_the_loads_covariance_where_it_is_told_the_noise(exact):
    covariances = []
    for noise in (None, NOISE):
        stream = PredictionStream(exact, StreamSettings(frames=Frames(), load_noise=noise))
        stream.loads.add(1, "wrist_base", DOWN[:3], DOWN[3:])
        sample = stream.on_joint_state(1, ("motor_1_joint", "motor_2_joint"), THETA)
        covariances.append(sample.prediction.covariance)
    added = load_covariance(exact, exact.predict(THETA, Load(DOWN)), Load(DOWN), NOISE)
    assert np.allclose(covariances[1] - covariances[0], added, rtol=1e-9)
