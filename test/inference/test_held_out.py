"""What held-out units say of a set: their densities given the others, and their errors."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.held_out import HeldOut, bought, refuted, speak_for
from wrist_stiffness.inference.observations import Quantity
from wrist_stiffness.inference.point import Background, Group, Point

N, HELD = 40, 12

LENGTH = Quantity("s", "um", (0, 1, 2), 1e6)


def point(left, columns):
    empty = np.zeros((N, 0))
    z, weight = np.zeros(columns.shape[1]), np.ones(columns.shape[1])
    return Point(left, -columns, z, weight, {}, empty, linear=True)


def taken(rows):
    return rows[: N - HELD]


def foretold(covariance, left):
    """Log density of the held-out numbers given the others."""
    part = covariance[: N - HELD, : N - HELD]
    whole = multivariate_normal(cov=covariance).logpdf(left)
    return whole - multivariate_normal(cov=part).logpdf(left[: N - HELD])


@pytest.mark.parametrize("seed", range(4))
def test_odds_are_those_of_the_densities_given_what_was_seen(seed):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(N, 3)) * [10.0, 10.0, 2.0]
    wander = np.linalg.cholesky(np.exp(-np.abs(np.subtract.outer(range(N), range(N))) / 10.0))
    left = columns @ rng.normal(size=3) + 1.5 * wander @ rng.normal(size=N) + rng.normal(size=N)
    ground = Background((Group("drift", "s", wander, 0.5),), 0.2)
    found, without = point(left, columns), point(left, columns[:, :2])
    groups = (Group("drift", "s", taken(wander), 0.5),)
    part = point(left, columns)
    part = Point(
        *(taken(a) for a in (part.left, part.columns)),
        part.z,
        part.weight,
        {},
        taken(part.inexact),
        linear=True,
    )
    seen = evidence(part, Background(groups, 0.2))
    beside = seen.excess * np.eye(N) + seen.amplitude[0] ** 2 * wander @ wander.T
    exact = [foretold(beside + own @ own.T, left) for own in (columns, columns[:, :2])]
    odds = speak_for(found, without, ground, taken)
    assert odds == pytest.approx(exact[0] - exact[1], abs=1e-6)


@pytest.mark.parametrize("moved", [slice(None), slice(20, 40), slice(0, 80, 7)])
def test_the_uncertainty_of_what_was_bought_is_that_of_chance_wherever_it_moves(moved):
    """Loads that come and go make the fall uneven in time, but neither surer nor less sure."""
    rng, off = np.random.default_rng(3), []
    change = np.zeros((80, 6))
    change[moved] = 3.0 * rng.normal(size=change[moved].shape)
    true = np.sum(change[:, :3] ** 2) / len(change)
    for _ in range(300):
        noise = rng.normal(size=(80, 6))
        before, after = (HeldOut(left, left.ravel()) for left in (noise + change, noise))
        fall, error = bought(before, after, LENGTH)
        level = before.rmse(LENGTH) + after.rmse(LENGTH)
        off.append((fall - true * LENGTH.per_si**2 / level) / error)
    # Student's t of seven degrees of freedom has a spread of 1.18.
    assert 0.9 < np.std(off) < 1.5


def test_a_change_of_next_to_nothing_is_refuted_by_nothing_that_wanders():
    wander = 3.0 * np.sin(np.arange(N) / 5.0)
    none = np.zeros((N, 0))
    verdicts = [
        refuted(HeldOut(none, wander), HeldOut(none, (1.0 + share) * wander))
        for share in (1e-9, 1e-3, 0.5)
    ]
    assert verdicts == [False, False, True]
