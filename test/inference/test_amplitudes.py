"""Amplitudes of what has no name are those of the largest evidence, wherever the search begins."""

import numpy as np
import pytest
from scipy.optimize import minimize

from wrist_stiffness.inference.amplitudes import ENOUGH, settled
from wrist_stiffness.inference.evidence import OFF, Evidence
from wrist_stiffness.inference.point import Background, Group, Point

ROWS = 150


def crowded(rng):
    """Groups of which each can do much of what another one can; one of them is not there."""
    time = np.linspace(0.0, 1.0, ROWS)[:, None]
    waves = [
        np.cos(np.pi * np.arange(1, count + 1) * (time + at))
        for count, at in ((12, 0), (8, 0.03), (8, 0.1))
    ]
    known = rng.normal(size=(ROWS, 3))
    left = 20.0 * waves[1] @ rng.normal(size=8) + waves[0] @ rng.normal(size=12)
    left += known @ [5.0, -3.0, 1.0] + 1.3 * rng.normal(size=ROWS)
    point = Point(left, known, np.zeros(3), np.full(3, 1e-3), {}, np.zeros((ROWS, 0)), linear=True)
    names = ("drift", "the load", "the pose")
    groups = [
        Group(n, "s", own, 1.0 if n == "drift" else 0.0)
        for n, own in zip(names, waves, strict=True)
    ]
    return point, Background(tuple(groups), 0.2)


def best_of(point, ground):
    """Largest log evidence that a general search finds from many beginnings."""

    def cost(x):
        return -Evidence(point, ground, np.maximum(np.exp(x[:-1]), OFF), float(np.exp(x[-1]))).log

    starts = [
        (np.log(a), np.log(b), np.log(c), 0.5)
        for a in (0.3, 10)
        for b in (0.3, 30)
        for c in (0.3, 30)
    ]
    found = [
        minimize(cost, start, method="Nelder-Mead", options={"maxiter": 600, "fatol": 1e-3})
        for start in starts
    ]
    return -min(each.fun for each in found)


@pytest.fixture(scope="module")
def asked():
    """A table, and the largest log evidence that it has."""
    point, ground = crowded(np.random.default_rng(20150601))
    return point, ground, best_of(point, ground)


@pytest.mark.parametrize("start", [(1.0, 1.0, 1.0), (0.02, 50.0, 0.02), (30.0, 30.0, 30.0)])
def test_the_search_ends_at_the_largest_evidence(asked, start):
    point, ground, best = asked
    found = settled(Evidence(point, ground, np.array(start), 1.0))
    assert found.log > best - ENOUGH
