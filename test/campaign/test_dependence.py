import numpy as np
import pytest

from wrist_stiffness.campaign.comparing.dependence import dependences
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.blocks import time_blocks

N, M = 240, 6


def wander(rng, n=N, correlation=4.0):
    """Noise of unit scatter whose half wanders over a few units."""
    keep = np.exp(-1.0 / correlation)
    slow = np.empty((n, M))
    slow[0] = rng.normal(size=M)
    for i in range(1, n):
        slow[i] = keep * slow[i - 1] + np.sqrt(1 - keep**2) * rng.normal(size=M)
    return np.sqrt(0.5) * (slow + rng.normal(size=(n, M)))


def asked(rng, residual, conditions, blocks=16):
    return dependences(
        residual,
        np.ones((N, M)),
        np.ones((N, 1)),
        conditions,
        time_blocks(np.zeros(N, dtype=int), blocks),
        rng,
    )


def many(rng, count=25):
    return [rng.normal(size=(N, 2 if i % 4 == 0 else 1)) for i in range(count)]


def test_coloured_noise_alone_lets_hardly_any_condition_in():
    alarms = sum(
        bool(asked(rng, wander(rng), [*many(rng), np.arange(N, dtype=float)[:, None]]).entered)
        for rng in np.random.default_rng(1).spawn(60)
    )
    # Of 60 at 1 %: 3 or more with a chance of 2 %.
    assert alarms <= 2


def test_two_planted_conditions_come_strongest_first_with_their_slopes():
    rng = np.random.default_rng(2)
    conditions = many(rng)
    slope = {3: np.array([0, 0, 1.2, 0, 0, 0]), 7: np.array([0, 0.6, 0, 0, 0, 0])}
    residual = wander(rng) + sum(conditions[which] * each for which, each in slope.items())
    found = asked(rng, residual, conditions).entered
    assert [each.which for each in found] == [3, 7]
    for each in found:
        sigma = np.sqrt(np.diag(each.covariance))
        assert np.abs(each.slope[0] - slope[each.which]).max() < 4 * sigma.max()


def test_stated_uncertainty_is_the_scatter_over_repetitions():
    conditions = [np.random.default_rng(3).normal(size=(N, 1))]
    pulls = []
    for rng in np.random.default_rng(4).spawn(80):
        (found,) = asked(rng, wander(rng) + 1.5 * conditions[0], conditions).entered
        pulls.append((found.slope[0] - 1.5) / np.sqrt(np.diag(found.covariance)))
    # 480 pulls: their mean square is known to 6.5 %; 16 blocks make it a little larger than 1.
    assert 0.8 < np.mean(np.square(pulls)) < 1.4


def test_what_is_known_already_is_not_told_again():
    rng = np.random.default_rng(5)
    strong = rng.normal(size=(N, 1))
    twin = strong + 0.2 * rng.normal(size=(N, 1))
    found = asked(rng, wander(rng) + 2 * strong, [twin, strong]).entered
    assert [each.which for each in found] == [1]


def test_what_hardly_differs_from_what_is_known_is_not_asked():
    rng = np.random.default_rng(9)
    strong, other = rng.normal(size=(2, N, 1))
    near = strong + 0.2 * other
    # The small difference between both would explain a lot, but as a huge slope.
    found = asked(rng, wander(rng) + 4 * strong + other, [near, strong]).entered
    assert len(found) == 1


def test_a_condition_inside_the_base_says_nothing():
    rng = np.random.default_rng(6)
    answer = asked(rng, wander(rng), [np.full((N, 1), 3.0), rng.normal(size=(N, 1))])
    assert np.isnan(answer.p_values[0])
    assert np.isfinite(answer.p_values[1])


def test_blanks_and_a_component_never_measured_are_left_out():
    rng = np.random.default_rng(7)
    condition = rng.normal(size=(N, 1))
    residual = wander(rng) + condition
    residual[:, 5] = np.nan
    residual[::3, 0] = np.nan
    (found,) = asked(rng, residual, [condition]).entered
    sigma = np.sqrt(np.diag(found.covariance))
    assert found.slope[0, 5] == sigma[5] == 0.0
    assert np.abs(found.slope[0, :5] - 1).max() < 4 * sigma[:5].max()


def test_columns_of_other_units_are_refused():
    with pytest.raises(InputError, match="240 units"):
        asked(np.random.default_rng(8), np.zeros((N, M)), [np.zeros((N - 1, 1))])


def test_uncertainty_is_that_of_clustered_errors_and_of_the_blocks_that_columns_use_up():
    """The sandwich of least squares, times n / (n - k - 1) of n blocks for k columns."""
    rng = np.random.default_rng(3)
    conditions = rng.normal(size=(N, 3))
    residual = wander(rng) + 3.0 * conditions @ np.ones((3, M))
    found = asked(rng, residual, list(conditions.T[:, :, None]), blocks=12).entered
    assert len(found) == 3
    columns = np.column_stack([conditions, np.ones(N)])
    slopes = np.linalg.lstsq(columns, residual, rcond=None)[0]
    blocks = time_blocks(np.zeros(N, dtype=int), 12)
    inverse = np.linalg.inv(columns.T @ columns)
    for component, left in enumerate((residual - columns @ slopes).T):
        scores = np.array([left[blocks == b] @ columns[blocks == b] for b in range(12)])
        variance = np.diag(inverse @ scores.T @ scores @ inverse) * 12 / (12 - 3 - 1)
        for each in found:
            assert each.slope[0, component] == pytest.approx(slopes[each.which, component])
            own = each.covariance[component, component]
            assert own == pytest.approx(variance[each.which])
