"""The contact solver against non-negative least squares and the conditions that define contact."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.contact import solve_contact

ROUNDING = 1e-9
"""Relative; times the condition number of the problem where that is large."""


def problem(seed, m, spread):
    """A random flexibility with condition number 10**spread, and gaps of both signs."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(m, m)))[0]
    approach = 1e-7 * (turn * np.logspace(0.0, -spread, m)) @ turn.T
    return (approach + approach.T) / 2.0, 1e-6 * rng.normal(size=m)


def by_least_squares(approach, gap):
    """Contact forces as the minimum of the potential energy: |L'f + L^-1 gap| over f >= 0."""
    lower = np.linalg.cholesky(approach)
    return nnls(lower.T, -np.linalg.solve(lower, gap), maxiter=100 * len(gap))[0]


problems = st.tuples(st.integers(0, 10**6), st.integers(1, 30), st.sampled_from([0, 2, 4]))


@given(problems)
def test_equals_non_negative_least_squares(case):
    approach, gap = problem(*case)
    force, active = solve_contact(approach, gap)
    wanted = by_least_squares(approach, gap)
    scale = np.max(np.abs(gap)) / np.max(np.diagonal(approach))
    tolerance = ROUNDING * 10.0 ** case[2] * max(np.max(wanted), scale)
    np.testing.assert_allclose(force, wanted, atol=tolerance)
    assert np.array_equal(active, force > 0.0)


@given(problems)
def test_no_overlap_no_pull_and_force_only_where_closed(case):
    approach, gap = problem(*case)
    force, _ = solve_contact(approach, gap)
    opening = gap + approach @ force
    scale = np.max(np.abs(gap))
    assert np.all(force >= 0.0)
    assert np.all(opening >= -ROUNDING * scale)
    assert np.all(np.abs(opening[force > 0.0]) <= ROUNDING * scale)


@given(problems, st.integers(0, 2**30 - 1))
def test_any_guess_leads_to_the_same_contact(case, bits):
    approach, gap = problem(*case)
    guess = (bits >> np.arange(len(gap))) % 2 == 1
    kept = guess.copy()
    force, active = solve_contact(approach, gap)
    from_guess, active_from_guess = solve_contact(approach, gap, guess)
    assert np.array_equal(active, active_from_guess)
    np.testing.assert_allclose(from_guess, force, rtol=0.0, atol=1e-14 * max(np.max(force), 1.0))
    assert np.array_equal(guess, kept)


@given(problems)
def test_contact_stores_least_energy(case):
    """E = f'Af/2 + gap'f is least, and at the solution it is minus the energy in the flanges."""
    approach, gap = problem(*case)
    force, _ = solve_contact(approach, gap)
    energy = 0.5 * force @ approach @ force + gap @ force
    stored = 0.5 * force @ approach @ force
    assert energy == pytest.approx(-stored, rel=1e-7, abs=1e-20)
    rng = np.random.default_rng(case[0])
    for _ in range(20):
        other = np.abs(force + rng.normal(size=len(gap)) * np.max(force + 1.0))
        assert 0.5 * other @ approach @ other + gap @ other >= energy - 1e-9 * abs(energy)


@given(st.integers(0, 10**6), st.integers(2, 12))
def test_nearly_degenerate_flanges_keep_the_conditions(seed, m):
    """Pairs of sectors that feel nearly the same; gaps that nearly all just touch."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(m, m)) @ np.diag(np.logspace(0, -2, m))
    twin = np.concatenate([half, half + 1e-5 * rng.normal(size=(m, m))])
    approach = 1e-7 * (twin @ twin.T + 1e-9 * np.eye(2 * m))
    true_force = rng.uniform(0.0, 1.0, 2 * m) * rng.integers(0, 2, 2 * m)
    gap = -approach @ true_force + 1e-15 * rng.integers(0, 2, 2 * m)
    force, _ = solve_contact(approach, gap)
    opening = gap + approach @ force
    scale = np.max(np.abs(gap)) + 1e-30
    assert np.all(force >= 0.0)
    assert np.all(opening >= -1e-8 * scale)
    work = np.abs(force * opening)
    assert np.all(work <= 1e-8 * scale * (np.max(force) + 1e-30))


def test_open_gaps_carry_nothing():
    approach, gap = problem(1, 8, 2)
    force, active = solve_contact(approach, np.abs(gap))
    assert not np.any(force)
    assert not np.any(active)
    assert not np.any(solve_contact(approach, np.abs(gap), np.ones(8, dtype=bool))[0])


def test_one_closed_gap_is_pushed_open_by_its_flexibility():
    force, active = solve_contact(np.array([[2e-7]]), np.array([-3e-6]))
    assert force == pytest.approx([15.0])
    assert active.tolist() == [True]


def test_twice_the_overlap_gives_twice_the_force():
    approach, gap = problem(3, 12, 2)
    once, twice = (solve_contact(approach, n * gap)[0] for n in (1.0, 2.0))
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-9, atol=1e-12)


def test_joint_without_flanges_has_an_empty_problem():
    force, active = solve_contact(np.zeros((0, 0)), np.zeros(0))
    assert force.shape == active.shape == (0,)


@pytest.mark.parametrize(
    ("approach", "gap", "active", "message"),
    [
        (np.eye(2), np.array([-1.0, np.nan]), None, "not finite"),
        (np.array([[1.0, np.inf], [np.inf, 1.0]]), -np.ones(2), None, "not finite"),
        (np.ones((2, 2)), np.array([-1.0, -2.0]), np.ones(2, dtype=bool), "singular"),
        (-np.eye(2), -np.ones(2), None, "positive definite"),
        (np.array([[1.0, -2.0], [-2.0, 1.0]]), -np.ones(2), None, "positive definite"),
    ],
    ids=["NaN", "infinite", "singular", "negative", "indefinite"],
)
def test_input_that_makes_no_sense_is_refused(approach, gap, active, message):
    with pytest.raises(InputError, match=message):
        solve_contact(approach, gap, active)
