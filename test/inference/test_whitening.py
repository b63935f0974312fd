import numpy as np
import pytest
from scipy.linalg import toeplitz

from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.whitening import NoiseModel, Wander, Whitener, component_factors

TIME = 4.0


def some_shares(rng, n):
    """Long means wander more than they scatter, single measurements do not."""
    return rng.uniform(0, 1, (n, 1))


def covariance_in_time(times, sessions, shares):
    gap = np.abs(times[:, None] - times)
    same = sessions[:, None] == sessions
    slow = np.sqrt(shares * shares.T)
    return slow * np.exp(-gap / TIME) * same + np.diag(1 - shares[:, 0])


def test_the_filter_is_the_inverse_cholesky_factor(rng):
    times = np.cumsum(rng.uniform(0.2, 3, 12))
    sessions = np.repeat([0, 1], [7, 5])
    columns, shares = rng.normal(size=(12, 1, 3)), some_shares(rng, 12)
    wander = Wander.of(np.ones((12, 1), bool), times, sessions, shares, TIME)
    factor = np.linalg.cholesky(covariance_in_time(times, sessions, shares))
    expected = np.linalg.solve(factor, columns[:, 0])
    np.testing.assert_allclose(wander(columns)[:, 0], expected, atol=1e-12)
    assert wander.log_sum == pytest.approx(2 * np.log(np.diag(factor)).sum())


def test_a_lost_unit_does_not_disturb_the_filter(rng):
    times, sessions = np.arange(10.0), np.zeros(10, dtype=int)
    columns, shares = rng.normal(size=(10, 1, 1)), some_shares(rng, 10)
    measured = np.ones((10, 1), bool)
    measured[4] = False
    white = Wander.of(measured, times, sessions, shares, TIME)(columns)
    kept = measured[:, 0]
    factor = np.linalg.cholesky(covariance_in_time(times, sessions, shares)[np.ix_(kept, kept)])
    np.testing.assert_allclose(
        white[kept, 0, 0], np.linalg.solve(factor, columns[kept, 0, 0]), atol=1e-12
    )
    assert white[4, 0, 0] == 0


def test_coupled_components_become_independent(rng):
    covariance = toeplitz([2.0, 0.9, 0.3])
    values = rng.multivariate_normal(np.zeros(3), covariance, 20000)
    table = Observations(values, {}, covariance)
    noise = NoiseModel(np.zeros((3, 3)), 0.0, 1.0, np.inf, "given")
    white = noise.whiten(table, values[:, :, None]).reshape(-1, 3)
    # Standard deviation of a sample covariance of 20,000 rows: 0.01.
    np.testing.assert_allclose(np.cov(white.T), np.eye(3), atol=0.04)


def test_numbers_of_the_variance_of_a_model_come_out_with_unit_scatter(rng):
    table = Observations(np.zeros((30, 2)), {}, rng.uniform(1, 9, (30, 1, 1)) * np.eye(2))
    noise = NoiseModel(np.diag([2.0, 3.0]), 0.0, 1.0, np.inf, "given", scale=4.0)
    sizes = np.sqrt(noise.variance(table))
    white = noise.whiten(table, sizes[:, :, None])
    assert white == pytest.approx(1.0)


def test_unmeasured_components_are_left_out_of_the_coupling():
    covariance = np.array([[[4.0, 1.0], [1.0, 9.0]]])
    factor = component_factors(covariance, np.array([[True, False]]))
    np.testing.assert_allclose(factor[0], [[0.5, 0], [0, 1]])


@pytest.fixture
def two_sessions(rng):
    """Units that state different scatter each, in two sessions."""
    stated = rng.uniform(0.1, 4.0, (12, 1, 1))
    times, sessions = np.cumsum(rng.uniform(0.2, 3, 12)), np.repeat([0, 1], [7, 5])
    return Observations(rng.normal(size=(12, 1)), {}, stated, times, sessions)


@pytest.mark.parametrize("all_wanders", [True, False])
def test_whitening_is_the_inverse_cholesky_factor_of_what_wanders_and_what_does_not(
    two_sessions, all_wanders
):
    noise = NoiseModel(np.array([[1.5]]), 0.6, TIME, np.inf, "given", all_wanders)
    stated = two_sessions.covariance[:, 0]
    slow = 0.6 * (stated + 1.5 if all_wanders else np.full((12, 1), 1.5))
    size = np.sqrt(stated + 1.5)
    covariance = size * size.T
    covariance *= covariance_in_time(two_sessions.times, two_sessions.sessions, slow / size**2)
    white = noise.whiten(two_sessions, two_sessions.values[:, :, None])
    expected = np.linalg.solve(np.linalg.cholesky(covariance), two_sessions.values)
    np.testing.assert_allclose(white, expected, atol=1e-12)


def test_columns_are_whitened_alike_one_after_the_other_and_together(rng, two_sessions):
    whiten = Whitener(NoiseModel(np.array([[1.5]]), 0.6, TIME, np.inf, "given"), two_sessions)
    columns = rng.normal(size=(12, 1, 3))
    each = np.hstack([whiten(columns[:, :, [k]]) for k in range(3)])
    np.testing.assert_allclose(whiten(columns), each, rtol=1e-13)


def test_clocks_that_begin_anew_with_each_session_are_as_good_as_one(rng):
    """As tables have them, each from zero; the first day was a thousand wanders long."""
    times, sessions = np.tile(1000.0 * TIME * np.arange(6.0), 2), np.repeat([0, 1], 6)
    columns, shares = rng.normal(size=(12, 1, 3)), some_shares(rng, 12)
    anew, on = (
        Wander.of(np.ones((12, 1), bool), each, sessions, shares, TIME)(columns)
        for each in (times, times + 1e5 * sessions)
    )
    np.testing.assert_array_equal(anew, on)
