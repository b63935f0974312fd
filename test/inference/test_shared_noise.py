"""The noise of a table whose units share scatter, beside a base far above it."""

import numpy as np
import pytest

from wrist_stiffness.inference.noise import estimate_noise, rich_basis
from wrist_stiffness.inference.observations import Observations, Quantity

STANDS, IN_A_STAND, COMPONENTS = 40, 6, 3
UNITS = STANDS * IN_A_STAND
STAND = np.repeat(np.arange(STANDS), IN_A_STAND)
SHARED = 9.0
"""Variance that the units of a stand have in common; their own is 1."""

NO_STRUCTURE = np.empty((UNITS, COMPONENTS, 0))
CONSTANT = np.broadcast_to(np.eye(COMPONENTS), (UNITS, COMPONENTS, COMPONENTS))


def table(rng, more=0.0):
    """Units as they are stated, but for `more` variance of their own."""
    shared = np.broadcast_to(np.sqrt(SHARED) * np.eye(COMPONENTS), CONSTANT.shape)
    values = np.sqrt(1.0 + more) * rng.normal(size=(UNITS, COMPONENTS))
    values += np.sqrt(SHARED) * rng.normal(size=(STANDS, COMPONENTS))[STAND]
    return Observations(
        values,
        {},
        (1.0 + SHARED) * np.eye(COMPONENTS),
        quantities=(Quantity("value", "si", (0, 1, 2)),),
        stand=STAND,
        shared=shared,
    )


def test_what_units_share_is_no_wander_and_no_more_than_was_stated(rng):
    noise = estimate_noise(table(rng), CONSTANT, NO_STRUCTURE)
    assert noise.colour_share == 0.0
    # 720 numbers: a variance is known to 5 %.
    assert np.diag(noise.beyond) == pytest.approx(0.0, abs=0.15)


def test_scatter_beyond_is_measured_by_what_each_unit_has_of_its_own(rng):
    noise = estimate_noise(table(rng, more=0.6), CONSTANT, NO_STRUCTURE)
    assert np.diag(noise.beyond) == pytest.approx(0.6, abs=0.2)


def test_components_of_a_quantity_scatter_alike_beyond_what_is_stated(rng):
    beyond = np.diag(estimate_noise(table(rng, more=0.6), CONSTANT, NO_STRUCTURE).beyond)
    assert beyond == pytest.approx(beyond[0], rel=1e-9)


def test_all_of_a_weak_base_is_in_the_rich_model_beside_strong_structure(rng):
    base, structure = rng.normal(size=(100, 3)), 1e3 * rng.normal(size=(100, 60))
    basis = rich_basis(base, structure, 100)
    assert basis.shape == (100, 30)
    np.testing.assert_allclose(basis.T @ basis, np.eye(30), atol=1e-9)
    np.testing.assert_allclose(basis @ (basis.T @ base), base, atol=1e-9)
