"""Where unknowns have bounds, what is found is the best of all that is possible."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize, nnls

from wrist_stiffness.inference import Candidate, Observations, Parameter
from wrist_stiffness.inference.evidence import Evidence, log_size_prior
from wrist_stiffness.inference.linear import LinearProblem, Term
from wrist_stiffness.inference.point import Background, Point
from wrist_stiffness.inference.possible import Possible

ROWS, UNKNOWNS = 60, 3


def correlated(seed):
    """Columns of which each can do much of what the others do, and what is seen of them."""
    rng = np.random.default_rng(seed)
    mix = np.eye(UNKNOWNS) + 0.9 * rng.normal(size=(UNKNOWNS, UNKNOWNS))
    columns = rng.normal(size=(ROWS, UNKNOWNS)) @ mix
    return columns, columns @ (3.0 * rng.normal(size=UNKNOWNS)) + rng.normal(size=ROWS)


def least(cost, columns, left):
    """Return the least cost that a general search finds where no unknown is below 0."""
    starts = nnls(columns, left)[0], np.ones(UNKNOWNS)
    limits = [(0.0, None)] * UNKNOWNS
    return min(minimize(cost, z, method="L-BFGS-B", bounds=limits).fun for z in starts)


@pytest.mark.parametrize("seed", range(40))
def test_a_fit_within_bounds_is_the_best_one(seed):
    columns, left = correlated(seed)
    sizes = tuple(Parameter(f"k{n}", 0.0, plausible=1.0) for n in range(UNKNOWNS))
    spring = Candidate("spring", "part", sizes, lambda table, shape: columns[:, None, :])
    table = Observations(left[:, None], {}, np.eye(1))
    problem = LinearProblem(table, (spring,), (), ordered=False)
    found = problem.fitted({spring.name: Term(spring, ())})
    assert (found.z >= 0.0).all()
    assert found.cost < least(lambda z: replace(found, z=z).cost, columns, left) + 0.01


@pytest.mark.parametrize("seed", range(40))
def test_what_an_effect_promises_within_bounds_is_by_its_best_unknowns(seed):
    columns, left = correlated(seed)
    empty = np.zeros((ROWS, 0))
    at = Evidence(
        Point(left, empty, np.zeros(0), np.zeros(0), {}, empty),
        Background((), 0.2),
        np.zeros(0),
        1.0,
    )
    above = Possible(np.zeros(UNKNOWNS), np.full(UNKNOWNS, np.inf))
    ((_, found),) = at.gains([-columns], [above])

    def cost(z):
        left_over = left - columns @ z
        return float(left_over @ left_over - 2.0 * log_size_prior(z @ z, UNKNOWNS))

    assert (found >= 0.0).all()
    # The prior is then that of the free unknowns alone.
    assert cost(found) < least(cost, columns, left) + 0.1
