from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.noise import (
    MOST_BEYOND_STATED,
    estimate_noise,
    replicate_variance,
    share_inside_groups,
)

NOTHING = (60, 2, 0)


def wander(rng, n, time_constant):
    state = np.empty(n)
    state[0] = rng.normal()
    keep = np.exp(-1 / time_constant)
    for k in range(1, n):
        state[k] = keep * state[k - 1] + np.sqrt(1 - keep**2) * rng.normal()
    return state


def total_variance(noise, table):
    return noise.variance(table).mean(axis=0)


def test_white_noise_is_given_no_colour(rng):
    table = Observations(rng.normal(size=(200, 3)), {})
    constant = np.broadcast_to(np.eye(3), (200, 3, 3))
    noise = estimate_noise(table, constant, np.empty((200, 3, 0)))
    assert noise.colour_share == 0
    assert noise.source == "residual"
    # 200 numbers per component: standard deviation of a variance 10 %.
    np.testing.assert_allclose(total_variance(noise, table), 1, atol=0.35)


def test_wander_is_recognised_beside_white_noise(rng):
    n = 400
    values = np.column_stack([wander(rng, n, 10) for _ in range(3)]) * np.sqrt(0.6)
    values += rng.normal(0, np.sqrt(0.4), (n, 3))
    constant = np.broadcast_to(np.eye(3), (n, 3, 3))
    noise = estimate_noise(Observations(values, {}), constant, np.empty((n, 3, 0)))
    assert 0.4 <= noise.colour_share <= 0.8
    assert 4 <= noise.colour_time <= 30


def test_structure_between_conditions_does_not_reach_the_replicate_floor(rng):
    n = 120
    condition = np.repeat(np.arange(40), 3)
    order = rng.permutation(n)
    structure = rng.normal(0, 50, (40, 2))[condition[order]]
    values = structure + rng.normal(0, 2.0, (n, 2))
    table = Observations(values, {}, replicate=condition[order])
    constant = np.broadcast_to(np.eye(2), (n, 2, 2))
    noise = estimate_noise(table, constant, np.empty((n, 2, 0)))
    assert noise.source == "replicates"
    # 80 degrees of freedom: the variance is known to 16 %.
    np.testing.assert_allclose(total_variance(noise, table), 4.0, rtol=0.5)


def test_a_drift_in_the_catalogue_does_not_widen_the_replicate_floor(rng):
    n = 120
    table = Observations(
        np.zeros((n, 1)), {}, time_s=np.arange(float(n)), replicate=rng.integers(0, 30, n)
    )
    drift = np.arange(float(n))[:, None, None]
    values = 3 * drift[:, :, 0] + rng.normal(size=(n, 1))
    noise = estimate_noise(table.with_values(values), np.ones((n, 1, 1)), drift)
    np.testing.assert_allclose(total_variance(noise, table), 1.0, rtol=0.5)


def wandering_means(rng, stated):
    """A third of the rows are means over long rests: they state little, and wander like all."""
    return rng.normal(0, np.sqrt(stated + 1.0), stated.shape)


def test_a_wander_is_added_to_what_is_stated(rng):
    stated = np.where(np.arange(300)[:, None] % 3 == 0, 0.04, 4.0) * np.ones((300, 2))
    label = np.where(np.arange(300) % 3 == 0, np.arange(300) // 6, -1)
    covariance = stated[:, :, None] * np.eye(2)
    values = wandering_means(rng, stated)
    for replicate in (label, None):
        table = Observations(values, {}, covariance, replicate=replicate)
        noise = estimate_noise(table, np.empty((300, 2, 0)), np.empty((300, 2, 0)))
        # 50 repeats of two components: the variance is known to 20 %.
        np.testing.assert_allclose(noise.variance(table), stated + 1.0, rtol=0.4)


def test_what_repeats_have_in_common_is_no_scatter_however_they_are_weighted(rng):
    condition = np.repeat(np.arange(20), 6)
    far = rng.normal(0, 1e4, (20, 2))[condition]
    structure = np.einsum("nk,ij->nikj", np.eye(20)[condition], np.eye(2)).reshape(120, 2, 40)
    covariance = rng.uniform(0.5, 1.5, (120, 1, 1)) * np.eye(2)
    values = far + rng.normal(0, 1.0, (120, 2)) * np.sqrt(covariance[:, :1, 0])
    table = Observations(values, {}, covariance, replicate=condition)
    noise = estimate_noise(table, np.empty((120, 2, 0)), structure)
    assert noise.source == "replicates"
    assert total_variance(noise, table) == pytest.approx(1.0, rel=0.5)


def test_loads_that_hardly_repeat_do_not_use_up_what_the_side_of_approach_needs(rng):
    """Each row comes from one of two sides; a hundred columns differ by little of them."""
    condition = np.repeat(np.arange(12), 3)
    side = np.where(np.arange(36) % 3 == 0, 1.0, -1.0)[:, None]
    loads = rng.normal(size=(12, 100))[condition] + 3e-4 * rng.normal(size=(36, 100))
    loads = np.broadcast_to(loads[:, None], (36, 3, 100))
    backlash = (side * [1.0, 0.0, 0.0])[:, :, None]
    values = 30.0 * backlash[:, :, 0] + rng.normal(size=(36, 3))
    table = Observations(values, {}, replicate=condition)
    found, _ = replicate_variance(values, np.concatenate([loads, backlash], axis=2), table)
    # Of the 900 of the side hardly anything is left beside the noise of 1.
    assert found.max() < 4.0


def test_a_component_that_was_never_measured_does_not_change_the_replicate_floor(rng):
    """What candidates take of the differences is taken from those that were measured."""
    values = rng.normal(size=(60, 2))
    table = Observations(values, {}, replicate=np.repeat(np.arange(20), 3))
    base, structure = np.ones((60, 2, 1)), rng.normal(size=(60, 2, 12))
    expected = estimate_noise(table, base, structure)

    def beside_blanks(columns, blank=0.0):
        return np.concatenate([columns, np.full((60, 4, *columns.shape[2:]), blank)], axis=1)

    more = table.with_values(beside_blanks(values, np.nan))
    found = estimate_noise(
        replace(more, quantities=()), beside_blanks(base), beside_blanks(structure)
    )
    assert found.source == "replicates"
    assert found.dof == pytest.approx(expected.dof)
    assert np.diag(found.beyond)[:2] == pytest.approx(np.diag(expected.beyond))


@pytest.mark.parametrize(("scatter", "variance"), [(5.0, MOST_BEYOND_STATED), (0.2, 1.0)])
def test_stated_scatter_is_believed_but_for_some_wander(rng, scatter, variance):
    table = Observations(rng.normal(0, scatter, (60, 2)), {}, np.eye(2))
    noise = estimate_noise(table, np.empty(NOTHING), np.empty(NOTHING))
    assert noise.source == "given"
    np.testing.assert_allclose(total_variance(noise, table), variance, rtol=1e-12)


@pytest.mark.parametrize("spacing", [1, 20])
def test_replicates_close_in_time_are_corrected_for_the_wander_they_share(rng, spacing):
    n = 240
    ratios = []
    label = np.full(n, -1)
    starts = np.arange(0, n - spacing, 2 * spacing if spacing > 1 else 4)
    label[starts] = np.arange(len(starts))
    label[starts + spacing] = np.arange(len(starts))
    for _ in range(8):
        values = np.column_stack([wander(rng, n, 10) * 0.8 + rng.normal(0, 0.6, n)])
        table = Observations(values, {}, replicate=label)
        noise = estimate_noise(table, np.ones((n, 1, 1)), np.empty((n, 1, 0)))
        ratios.append(total_variance(noise, table)[0])
    # Without the correction neighbours show 0.42 of the variance.
    assert np.median(ratios) == pytest.approx(1.0, abs=0.25)


def test_of_a_wander_beside_what_is_stated_all_is_found_however_soon_replicates_follow():
    """Rows that repeat are long means: they state little, and differ by a part of the wander."""
    n, found = 240, []
    label = np.where(np.arange(n) % 4 < 2, np.arange(n) // 4, -1)
    stated = np.where(label >= 0, 0.02, 2.0)[:, None]
    for seed in range(8):
        rng = np.random.default_rng(seed)
        values = wander(rng, n, 4)[:, None] + rng.normal(0, np.sqrt(stated))
        table = Observations(values, {}, stated[:, :, None], replicate=label)
        noise = estimate_noise(table, np.ones((n, 1, 1)), np.empty((n, 1, 0)))
        if not noise.all_wanders:
            found.append(noise.beyond[0, 0])
    assert len(found) > 4
    # Without the correction neighbours show 0.22 of the variance.
    assert np.median(found) == pytest.approx(1.0, abs=0.3)


def test_a_floor_from_few_replicates_weighs_as_much_as_the_true_one_on_average():
    weights = []
    for seed in range(40):
        values = np.random.default_rng(seed).normal(size=(24, 6))
        table = Observations(values, {}, replicate=np.repeat(np.arange(12), 2))
        noise = estimate_noise(table, np.empty((24, 6, 0)), np.empty((24, 6, 0)))
        assert (noise.source, noise.dof) == ("replicates", 72)
        weights.append(1 / noise.variance(table)[0])
    # 12 degrees of freedom: 1/s^2 scatters by a half; uncorrected it is 1.2.
    assert np.mean(weights) == pytest.approx(1.0, abs=3 * 0.5 / np.sqrt(240))


def two_sessions(rng):
    """The same labels at the same times in two sessions, the second far off."""
    label, session = np.tile(np.repeat(np.arange(10), 3), 2), np.repeat([0, 1], 30)
    values = rng.normal(size=(60, 1)) + 1e3 * session[:, None]
    return Observations(
        values, {}, time_s=np.tile(np.arange(30.0), 2), session=session, replicate=label
    )


def test_replicates_of_two_sessions_are_not_compared(rng):
    table = two_sessions(rng)
    variance, freedom = replicate_variance(table.values, np.empty((60, 1, 0)), table)
    assert freedom == 40
    # 40 degrees of freedom: the variance is known to 22 %.
    assert variance == pytest.approx(1.0, abs=0.66)


def test_the_share_inside_groups_is_that_of_each_session(rng):
    table = two_sessions(rng)
    alone = share_inside_groups(table.take(table.sessions == 0), 0.8, 4.0)
    assert alone < 0.5
    assert share_inside_groups(table, 0.8, 4.0) == pytest.approx(alone)
