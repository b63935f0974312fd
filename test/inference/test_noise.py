"""The scatter of what was repeated, whatever else changes between conditions."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference import Observations, Quantity
from wrist_stiffness.inference.noise import replicate_variance, rich_basis, scatter_of, unstated


def test_structure_between_conditions_does_not_reach_the_scatter_of_repeats(rng):
    condition = np.repeat(np.arange(40), 3)[rng.permutation(120)]
    values = rng.normal(0, 50, (40, 2))[condition] + rng.normal(0, 2.0, (120, 2))
    table = Observations(values, {}, replicate=condition)
    variance, freedom = replicate_variance(values, np.empty((120, 2, 0)), table)
    assert freedom == 80
    # The variance is known to 16 %.
    assert variance == pytest.approx(4.0, rel=0.5)


def test_what_repeats_have_in_common_is_no_scatter(rng):
    condition = np.repeat(np.arange(20), 6)
    structure = np.einsum("nk,ij->nikj", np.eye(20)[condition], np.eye(2)).reshape(120, 2, 40)
    values = rng.normal(0, 1e4, (20, 2))[condition] + rng.normal(0, 1.0, (120, 2))
    table = Observations(values, {}, replicate=condition)
    variance, _ = replicate_variance(values, structure, table)
    assert variance == pytest.approx(1.0, rel=0.5)


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


def test_a_component_that_was_never_measured_does_not_change_the_scatter_of_repeats(rng):
    """What candidates take of the differences is taken from those that were measured."""
    values, columns = rng.normal(size=(60, 2)), rng.normal(size=(60, 2, 12))
    label = np.repeat(np.arange(20), 3)
    expected = replicate_variance(values, columns, Observations(values, {}, replicate=label))
    blank = np.concatenate([values, np.full((60, 4), np.nan)], axis=1)
    more = Observations(blank, {}, replicate=label)
    beside = np.concatenate([columns, np.zeros((60, 4, 12))], axis=1)
    found = replicate_variance(np.nan_to_num(blank), beside, more)
    assert found[1] == pytest.approx(expected[1])
    assert found[0][:2] == pytest.approx(expected[0])


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


def test_all_of_a_weak_base_is_in_the_rich_model_beside_strong_structure(rng):
    base, structure = rng.normal(size=(100, 3)), 1e3 * rng.normal(size=(100, 60))
    basis = rich_basis(base, structure, 100)
    assert basis.shape == (100, 30)
    np.testing.assert_allclose(basis.T @ basis, np.eye(30), atol=1e-9)
    np.testing.assert_allclose(basis @ (basis.T @ base), base, atol=1e-9)


def test_each_component_has_the_scatter_that_nothing_smooth_explains(rng):
    n, sigma = 400, np.array([1.0, 0.2, 5.0])
    x = np.linspace(-1.0, 1.0, n)
    values = 30.0 * np.sin(3.0 * x)[:, None] + x[:, None] + sigma * rng.normal(size=(n, 3))
    table = Observations(
        values,
        {"x": x},
        quantities=tuple(Quantity(name, "um", (place,)) for place, name in enumerate("abc")),
    )
    spread = np.eye(3)[:, None, :]
    base = (x[:, None, None, None] * spread.swapaxes(0, 1)).reshape(n, 3, -1)
    waves = np.stack([np.sin((k + 1.0) * x) for k in range(6)], axis=1)
    structure = (waves[:, None, :, None] * spread).reshape(n, 3, -1)
    found, repeats = scatter_of(table, base, structure)
    assert np.allclose(np.sqrt(found), sigma, rtol=0.1)
    assert repeats == 0.0


def test_a_base_that_moves_one_component_uses_up_the_freedom_of_that_one(rng):
    base = np.zeros((60, 2, 30))
    base[:, 0] = rng.normal(size=(60, 30))
    found = [
        scatter_of(Observations(rng.normal(size=(60, 2)), {}), base, np.zeros((60, 2, 0)))[0]
        for _ in range(200)
    ]
    # Drawn to each other by ten degrees of freedom, as ever; the mean of 200 is known to 2 %.
    assert np.mean(found, axis=0) == pytest.approx([1.0, 1.0], abs=0.05)


@pytest.mark.parametrize("alike", [1, 3])
def test_what_units_share_is_not_taken_for_their_own_scatter(rng, alike):
    """Stands of so many units; one number in four of each is a hidden count."""
    n, count = 240, 2.0
    stand = np.repeat(np.arange(n // alike), alike)
    shared = np.full((n, 1, 1), count)
    values = (count * rng.normal(size=n // alike)[stand] + 0.5 * rng.normal(size=n))[:, None]
    stand = stand if alike > 1 else np.full(n, -1)
    table = Observations(values, {}, stand=stand, shared=shared)
    nothing = np.zeros((n, 1, 0))
    units, variance, _ = unstated(table, nothing, nothing)
    assert units.shared is not None
    assert np.sqrt(variance) == pytest.approx(0.5, abs=0.1 if alike > 1 else 0.5)
    units, variance, _ = unstated(replace(table, values=0.25 * values), nothing, nothing)
    assert units.shared is None
    assert np.sqrt(variance) == pytest.approx(0.25 * np.hypot(count, 0.5), rel=0.2)


def test_what_rounding_leaves_of_too_few_numbers_is_no_noise(rng):
    """Twelve positions do not tell the noise beside forty parameters; repeats would."""
    values, base = rng.normal(size=(12, 3)), rng.normal(size=(12, 3, 40))
    with pytest.raises(InputError, match="36 measured numbers are no more than what is fitted"):
        scatter_of(Observations(values, {}), base, base[:, :, :0])
    more, columns = np.tile(values, (2, 1)), np.tile(base, (2, 1, 1))
    more[12:] += rng.normal(size=(12, 3))
    repeated = Observations(more, {}, replicate=np.tile(np.arange(12), 2))
    assert scatter_of(repeated, columns, columns[:, :, :0])[1] > 0.0
