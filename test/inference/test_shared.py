"""Scatter that units of a stand share: against the dense covariance, and in fits."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.shared import (
    Apart,
    Whitened,
    as_they_stood,
    component_factors,
    own_covariance,
)

STAND = np.array([0, 0, -1, 1, 1, 1, -1])


@pytest.fixture
def table():
    rng = np.random.default_rng(4)
    shared = rng.normal(size=(7, 3, 2))
    covariance = shared @ np.swapaxes(shared, 1, 2) + np.diag([0.5, 1.0, 2.0])
    values = rng.normal(size=(7, 3))
    values[4, 1] = np.nan
    return Observations(values, {}, covariance, stand=STAND, shared=shared)


def whitened(table, columns):
    own = own_covariance(table, table.covariance)
    factors = component_factors(own, table.measured)
    return Apart(table, factors)(np.where(table.measured[:, :, None], columns, 0.0))


def dense(table):
    """Return the covariance of all numbers of the table, (21, 21)."""
    total = np.zeros((7, 3, 7, 3))
    for i in range(7):
        for j in range(7):
            alike = STAND[i] == STAND[j] >= 0
            if i == j:
                total[i, :, j] = table.covariance[i]
            elif alike:
                total[i, :, j] = table.shared[i] @ table.shared[j].T
    return total.reshape(21, 21)


def test_products_of_whitened_columns_are_those_by_the_dense_covariance(table):
    columns = np.random.default_rng(5).normal(size=(7, 3, 4))
    white = whitened(table, columns).reshape(21, 4)
    seen = table.measured.ravel()
    flat = columns.reshape(21, 4)[seen]
    exact = flat.T @ np.linalg.solve(dense(table)[np.ix_(seen, seen)], flat)
    assert white.T @ white == pytest.approx(exact, rel=1e-9)


def test_part_of_a_table_shares_what_is_left_of_it(table):
    rows = np.array([0, 2, 3, 5])
    part = table.take(rows)
    columns = np.random.default_rng(6).normal(size=(4, 3, 1))
    white = whitened(part, columns)
    seen = np.repeat(3 * rows, 3) + np.tile(np.arange(3), 4)
    flat = columns.reshape(-1)
    exact = flat @ np.linalg.solve(dense(table)[np.ix_(seen, seen)], flat)
    assert float(np.sum(white**2)) == pytest.approx(exact, rel=1e-9)


def test_unmeasured_components_are_left_out_of_the_coupling():
    covariance = np.array([[[4.0, 1.0], [1.0, 9.0]]])
    factor = component_factors(covariance, np.array([[True, False]]))
    np.testing.assert_allclose(factor[0], [[0.5, 0], [0, 1]])


def test_units_that_are_taken_out_leave_the_others_as_if_never_measured(table):
    common = np.random.default_rng(8).normal(size=(7, 3, 1))
    whole = replace(table, common=common)
    own = own_covariance(whole, whole.covariance)
    units = Whitened(whole, own, np.ones((7, 1)))
    aside = np.isin(np.arange(7), [1, 4])
    taken = units.without(aside)
    columns = np.random.default_rng(9).normal(size=(7, 3, 4))
    white = taken(units.whiten(columns))
    seen = (whole.measured & ~aside[:, None]).ravel()
    flat, more = columns.reshape(21, 4)[seen], common.reshape(21, 1)[seen]
    covariance = dense(table)[np.ix_(seen, seen)]
    # What all have in common is whitened beside the units that have it.
    alone = Whitened(
        replace(whole, values=np.where(aside[:, None], np.nan, whole.values)), own, np.ones((7, 1))
    )
    assert white == pytest.approx(alone.whiten(columns), abs=1e-9)
    exact = flat.T @ np.linalg.solve(covariance + more @ more.T, flat)
    assert white.T @ white == pytest.approx(exact, rel=1e-9)
    one = columns[:, :, 0]
    assert taken(units.whiten(one)) == pytest.approx(white[:, 0])


@pytest.mark.parametrize("moved", [0.0, 0.1, 1.0])
def test_how_much_motors_moved_within_a_count_is_told_by_what_units_of_a_stand_show(moved):
    """Forty stands of three units each, of which the load pushes the last, in two sessions."""
    rng = np.random.default_rng(7)
    stand, session = np.repeat(np.arange(40), 3), np.repeat([0, 1], 60)
    shared = np.broadcast_to(rng.normal(size=(3, 2)), (120, 3, 2))
    share = np.where(session == 1, moved, 0.0)[:, None]
    hidden = np.sqrt(1.0 - share) * rng.normal(size=(40, 2))[stand]
    hidden += np.sqrt(share) * rng.normal(size=(120, 2))
    load = np.tile([0.0, 0.0, 1.0], 40)[:, None, None] * np.eye(3)
    values = (shared @ hidden[:, :, None] + load @ [[9.0], [-5.0], [2.0]])[:, :, 0]
    values += rng.normal(0.0, 0.1, (120, 3))
    covariance = shared @ np.swapaxes(shared, 1, 2) + 0.01 * np.eye(3)
    table = Observations(values, {}, covariance, session=session, stand=stand, shared=shared)
    found = as_they_stood(table, np.zeros((120, 3, 0)), load).shared
    own = 1.0 - np.sum(found**2, axis=(1, 2)) / np.sum(shared**2, axis=(1, 2))
    assert own[:60] == pytest.approx(0.0)
    # To one step of the shares that are tried.
    assert own[60:].min() >= moved / 3.5
    assert own[60:].max() <= 3.5 * moved
