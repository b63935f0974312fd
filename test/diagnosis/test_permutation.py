"""Rearrangements move short stretches inside their group, and turn their signs."""

import numpy as np
import pytest

from wrist_stiffness.diagnosis.permutation import rearranged_residuals
from wrist_stiffness.diagnosis.projection import Base

IN_A_GROUP = 30
GROUPS = np.arange(2 * IN_A_GROUP) % 2
"""Units of two groups in turn."""

REPEATS = 40


@pytest.fixture
def moved(rng):
    """Rearrange units whose residual is their number, counted from one, (REPEATS, units)."""
    base = Base(np.empty((len(GROUPS), 0)), np.arange(1.0, len(GROUPS) + 1.0), len(GROUPS), 0)
    return rearranged_residuals(base, GROUPS, REPEATS, rng).T


def order(moved):
    return np.abs(moved).astype(int) - 1


def stretches(of_units, group):
    """Return three by three what stands at the places of a group, (REPEATS, stretches, 3)."""
    return of_units[:, group == GROUPS].reshape(REPEATS, -1, 3)


def test_every_unit_comes_to_one_place_of_its_group(moved):
    assert (np.sort(order(moved), axis=1) == np.arange(len(GROUPS))).all()
    assert (GROUPS[order(moved)] == GROUPS).all()
    assert len(np.unique(order(moved), axis=0)) == REPEATS


@pytest.mark.parametrize("group", [0, 1])
def test_three_neighbours_stay_neighbours(moved, group):
    number = stretches(order(moved) // 2, group)
    assert (np.diff(number, axis=2) % IN_A_GROUP == 1).all()
    # Stretches begin anywhere: else the same units would be neighbours every time.
    assert set(np.unique(number[:, :, 0] % 3)) == {0, 1, 2}


@pytest.mark.parametrize("group", [0, 1])
def test_a_stretch_has_one_sign_and_half_of_them_turn(moved, group):
    sign = stretches(np.sign(moved), group)
    assert (sign == sign[:, :, :1]).all()
    # 400 stretches.
    assert np.mean(sign < 0) == pytest.approx(0.5, abs=3.0 * 0.5 / np.sqrt(400))


def test_components_of_a_unit_move_together_and_priors_stay(rng):
    units = np.stack([np.arange(1.0, 10.0), np.arange(101.0, 110.0)], axis=1)
    base = Base(np.empty((20, 0)), np.append(units.ravel(), [1e3, 1e3]), 20, 2)
    moved = rearranged_residuals(base, np.zeros(9, dtype=int), 500, rng)
    first, second = np.moveaxis(moved[:18].reshape(9, 2, 500), 1, 0)
    assert (second - first == 100.0 * np.sign(first)).all()
    # How far chance strains a prior is told by its own width.
    assert np.std(moved[18:]) == pytest.approx(1.0, abs=0.1)
