"""Flange contact of many samples at once against non-negative least squares, one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism import contact
from wrist_stiffness.mechanism.contact import forces_of, solve_contact, solve_contacts

ROUNDING = 1e-9
"""Relative; times the condition number of the flexibilities, 100."""

COUNTS = (1, 5, 39)
SECTORS = (1, 7, 8, 19)

stacks = st.tuples(st.integers(0, 10**6), st.sampled_from(COUNTS), st.sampled_from(SECTORS))


def problems(seed, n, m):
    """Return flexibilities, gaps that hold from none to all sectors, and random contact states."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(n, m, m)))[0]
    approach = 1e-7 * (turn * np.logspace(0.0, -2.0, m)) @ np.swapaxes(turn, 1, 2)
    gap = 1e-6 * (rng.normal(size=(n, m)) + rng.uniform(-3.0, 3.0, size=(n, 1)))
    return approach, gap, rng.random((n, m)) < rng.random((n, 1))


def by_least_squares(approach, gap):
    """Return the minimum of the potential energy: |L'f + L^-1 gap| over f >= 0."""
    lower = np.linalg.cholesky(approach)
    return nnls(lower.T, -np.linalg.solve(lower, gap), maxiter=100 * len(gap))[0]


def scale(approach, gap):
    """Return a force to measure errors of each sample against, (n, 1)."""
    stiffest = np.diagonal(approach, axis1=1, axis2=2).max(axis=1, keepdims=True)
    return np.abs(gap).max(axis=1, keepdims=True) / stiffest


@settings(max_examples=60)
@given(stacks)
def test_every_guess_leads_to_the_least_energy(case):
    approach, gap, state = problems(*case)
    wanted = np.array([by_least_squares(a, g) for a, g in zip(approach, gap, strict=True)])
    for guess in (None, state[0], state):
        force, active = solve_contacts(approach, gap, guess)
        tolerance = 100.0 * ROUNDING * np.maximum(scale(approach, gap), wanted)
        assert np.all(np.abs(force - wanted) <= tolerance)
        assert np.array_equal(active, force > 0.0)


@settings(max_examples=30)
@given(stacks, st.sampled_from([1, 4]))
def test_problems_with_the_same_flexibility_are_solved_beside_each_other(case, problems_each):
    approach, gap, state = problems(*case)
    gaps = np.stack([gap * size for size in np.linspace(1.0, -1.0, problems_each)], axis=1)
    force, active = solve_contacts(approach, gaps, state[:, None])
    for number in range(problems_each):
        each = gaps[:, number]
        wanted = np.array([by_least_squares(a, g) for a, g in zip(approach, each, strict=True)])
        tolerance = 100.0 * ROUNDING * np.maximum(scale(approach, gap), wanted)
        assert np.all(np.abs(force[:, number] - wanted) <= tolerance)
        assert np.array_equal(active[:, number], force[:, number] > 0.0)


@settings(max_examples=60)
@given(stacks)
def test_forces_close_what_is_held_and_nothing_else(case):
    approach, gap, state = problems(*case)
    force = forces_of(approach, gap, state)
    opening = gap + (approach @ force[..., None])[..., 0]
    assert np.all(force[~state] == 0.0)
    assert np.all(np.abs(opening[state]) <= ROUNDING * np.abs(gap).max())


@settings(max_examples=30)
@given(stacks)
def test_compiled_and_plain_agree(case):
    approach, gap, state = problems(*case)
    gaps = np.stack([gap, -gap], axis=1)
    with pytest.MonkeyPatch.context() as plain:
        compiled = solve_contacts(approach, gaps), forces_of(approach, gaps, state)
        plain.setattr(contact, "native", None)
        (force, active), held = solve_contacts(approach, gaps), forces_of(approach, gaps, state)
    size = scale(approach, gap)[:, None]
    assert np.all(np.abs(compiled[0][0] - force) <= 100.0 * ROUNDING * size)
    assert np.array_equal(compiled[0][1], active)
    assert np.all(np.abs(compiled[1] - held) <= 100.0 * ROUNDING * size)


def test_no_flange_no_force():
    force, active = solve_contacts(np.zeros((9, 0, 0)), np.zeros((9, 0)))
    assert force.shape == active.shape == (9, 0)


@pytest.mark.parametrize("n", [1, 7])
def test_all_open_is_no_work(n):
    approach = np.tile(1e-7 * np.eye(3), (n, 1, 1))
    force, active = solve_contacts(approach, np.ones((n, 3)))
    assert not force.any()
    assert not active.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_bad_samples_among_many_are_refused(bad):
    approach, gap, _ = problems(5, 4, 3)
    gap[1, 2] = bad
    with pytest.raises(InputError, match="not finite"):
        solve_contacts(approach, gap)
    with pytest.raises(InputError, match="positive definite"):
        solve_contacts(np.zeros((1, 4, 4)), -np.ones((1, 4)))
    with pytest.raises(InputError, match="positive definite"):
        forces_of(np.zeros((1, 4, 4)), -np.ones((1, 4)), np.ones((1, 4), dtype=bool))


def test_more_sectors_than_the_compiled_formulas_take_are_solved_all_the_same():
    approach, gap, _ = problems(3, 2, 200)
    force, active = solve_contacts(approach, gap)
    for row in range(2):
        wanted, closed = solve_contact(approach[row], gap[row])
        assert np.array_equal(force[row], wanted)
        assert np.array_equal(active[row], closed)
