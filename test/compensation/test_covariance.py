"""Stated covariances against Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.monitor import residual_of_pose
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import (
    PredictionStream,
    load_covariance,
    tangent_compliance,
)
from wrist_stiffness.model.block import Sample
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.shipped import shipped_file

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


def assert_same_spread(found, stated, tolerance=SAMPLING):
    """Compare the spread along the axes of the stated covariance."""
    values, axes = np.linalg.eigh(stated / np.outer(SCALE, SCALE))
    there = (found / SCALE) @ axes
    large = values > 1e-6 * values.max()
    assert np.allclose(there.std(axis=0)[large], np.sqrt(values[large]), rtol=tolerance)


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
        prediction = stream.on_joint_state(1, ("motor_1_joint", "motor_2_joint"), THETA)
        covariances.append(prediction.covariance)
    added = load_covariance(exact, exact.predict(THETA, Load(DOWN)), Load(DOWN), NOISE)
    assert np.allclose(covariances[1] - covariances[0], added, rtol=1e-9)


UNCERTAIN = (
    ("link_stiffness", "link_1", {"flexibility_percent": (20.0, 4.0)}),
    ("bushing_stiffness", "joint_3", {"flexibility_percent": (-10.0, 3.0)}),
    ("encoder_offset", "motor_2", {"offset_mdeg": (10.0, 2.0)}),
    ("load_bias", "load_sensor", {"fx_N": (0.02, 0.01), "my_Nmm": (1.0, 0.4)}),
    ("creep", "joint_1", {"delayed_percent": (30.0, 6.0), "time_constant_s": (5.0, 0.5)}),
    ("backlash", "motor_1", {"width_mdeg": (20.0, 3.0)}),
)
"""Effects, some with a memory: estimates and their standard uncertainties."""

HISTORY = [(0.0, 0.1), (2.0, 0.5), (4.0, 0.3)]
"""Seconds and angle of motor 1; at the end it has turned back, and creep is on its way."""

EFFECT_DRAWS = 500
EFFECT_SAMPLING = 3.0 / np.sqrt(2.0 * EFFECT_DRAWS)


def with_parameters(model, draw, stated=True):
    """Return the model with its effects at `draw(estimate, uncertainty)`."""
    return model.with_effects(
        *(
            Effect(
                find_law(name),
                place,
                {
                    key: Estimate(draw(*pair), pair[1]) if stated else Estimate(draw(*pair))
                    for key, pair in parameters.items()
                },
            )
            for name, place, parameters in UNCERTAIN
        )
    )


def at_the_end(model, load=DOWN, off=(0.0, 0.0)):
    session = model.session()
    for time, first in HISTORY:
        theta = np.array([first, -0.2]) + off
        prediction = session.advance(Sample(time, theta, Load(load)))
    return prediction


def drawn(exact, rng):
    """Return a model without stated uncertainties, which cost time, at drawn parameters."""
    return with_parameters(exact, lambda value, sigma: value + sigma * rng.normal(), stated=False)


def test_uncertain_parameters_of_effects_spread_as_stated(exact):
    """Beside the encoder step, which is in the stated covariance too and is taken off."""
    rng = np.random.default_rng(3)
    stated = at_the_end(with_parameters(exact, lambda value, sigma: value))
    encoder = exact.table_covariance(stated.configuration, np.zeros(6))
    found = [at_the_end(drawn(exact, rng)).twist for _ in range(EFFECT_DRAWS)]
    assert_same_spread(np.array(found), stated.covariance - encoder, EFFECT_SAMPLING)


def test_parameters_encoder_and_load_together_spread_as_a_stream_states(exact):
    rng = np.random.default_rng(4)
    model = with_parameters(exact, lambda value, sigma: value)
    stream = PredictionStream(model, StreamSettings(load_noise=NOISE))
    for time, first in HISTORY:
        stamp = round((1.0 + time) * 1e9)
        stream.loads.add(stamp, "wrist_base", DOWN[:3], DOWN[3:])
        names = ("motor_1_joint", "motor_2_joint")
        shown = stream.on_joint_state(stamp, names, [first, -0.2])
    step = exact.table.geometry.limits.encoder_step
    found = []
    for _ in range(EFFECT_DRAWS):
        off, load = step * rng.uniform(-0.5, 0.5, 2), DOWN + NOISE * rng.normal(size=6)
        actual = at_the_end(drawn(exact, rng), load, off)
        rotation, shift = actual.motion
        pose = rotation @ actual.configuration.platform
        found.append(residual_of_pose(pose, shift, shown))
    assert_same_spread(np.array(found), shown.covariance, EFFECT_SAMPLING)


def test_the_stated_error_of_the_table_covers_its_interpolation():
    """The closed form judges the spline of the shipped table at poses and loads of any kind."""
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    spline, exact = (model.with_evaluation(kind) for kind in ("spline", "closed_form"))
    rng = np.random.default_rng(5)
    lower, upper = model.table.workspace.rectangle
    squares = []
    for _ in range(300):
        theta = rng.uniform(lower, upper)
        load = Load(rng.normal(size=6) * np.repeat([1.0, 0.02], 3))
        shown = spline.predict(theta, load)
        encoder = model.table_covariance(shown.configuration, np.zeros(6))
        stated = shown.covariance - encoder
        off = shown.twist - exact.predict(theta, load).twist
        squares.append(off**2 / stated.diagonal())
    rms = np.sqrt(np.mean(squares, axis=0))
    assert np.all(rms < 1.0)
    # Nor is it stated so large that it says nothing.
    assert rms.max() > 0.1
