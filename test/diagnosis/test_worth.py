"""What columns are worth, against the marginal likelihoods of the definition."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wrist_stiffness.diagnosis.worth import WIDTHS, worth


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.mark.parametrize("variance", [1.0, 7.0])
def test_worth_is_twice_the_log_ratio_of_marginal_likelihoods(rng, variance):
    columns, scales = rng.normal(size=(40, 3)), np.array([0.01, 2.0, 0.3])
    residual = columns @ [0.02, 1.0, -0.5] + np.sqrt(variance) * rng.normal(size=40)
    noise = variance * np.eye(40)
    none = multivariate_normal(np.zeros(40), noise).logpdf(residual)
    spread = columns * scales
    some = [
        multivariate_normal(np.zeros(40), noise + w**2 * spread @ spread.T).logpdf(residual)
        for w in WIDTHS
    ]
    assert worth(columns, residual, scales, variance) == pytest.approx(2 * (max(some) - none))


def test_directions_that_no_plausible_size_would_show_are_free(rng):
    shown = rng.normal(size=(60, 2))
    residual = shown @ [3.0, -4.0] + rng.normal(size=60)
    idle = 1e-4 * rng.normal(size=(60, 15))
    alone = worth(shown, residual, np.full(2, 3.0))
    together = worth(np.hstack([shown, idle]), residual, np.full(17, 3.0))
    assert together == pytest.approx(alone, abs=0.01)
    # Not so if their usual size were ten thousand times as large: then they pay.
    paid = worth(np.hstack([shown, idle]), residual, np.r_[np.full(2, 3.0), np.full(15, 3e4)])
    assert paid < alone - 15.0
