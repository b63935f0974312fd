"""How much of the scatter wanders slowly, and how slowly: restricted likelihood.

Base and candidates are projected out inside the likelihood (REML), so slow effects in the
catalogue are not taken for wander, nor does fitting them make the wander look small.
"""

import numpy as np
from scipy.optimize import minimize_scalar

from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.whitening import Wander

SHARES = (0.1, 0.25, 0.5, 0.75, 0.95)
TIMES_IN_STEPS = (1.5, 4.0, 10.0, 30.0)
LARGEST_SHARE = 0.98

ROUNDING = 1e-12
"""Keeps the Gram matrix of exact data positive definite."""

EVIDENCE = 3.0
"""Gain of log likelihood that the two numbers of the wander must bring."""


def find_colour(
    reduced: Array, observations: Observations, wandering: Array
) -> tuple[float, float, float]:
    """Share and correlation time of the slow wander.

    Parameters
    ----------
    reduced : (n, m, p + 1) array
        Independent columns of base and candidates in components of equal scatter; the observations
        are the last column.
    observations : Observations
        Tells what was measured, and when.
    wandering : (n, m) array
        Part of each variance that may wander at all.

    Returns
    -------
    float, float, float
        Share of that part in [0, 1), time, and logarithm of the likelihood over that of white
        noise; share 0 if white noise does as well.
    """
    steps = np.diff(observations.times)[np.diff(observations.sessions) == 0]
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    if not wandering.any():
        return 0.0, step, 0.0

    def unlikely(share: float, time_constant: float) -> float:
        return -_restricted_likelihood(reduced, observations, share * wandering, time_constant)

    grid = [(share, step * factor) for share in SHARES for factor in TIMES_IN_STEPS]
    share, time_constant = min(grid, key=lambda model: unlikely(*model))
    finer = minimize_scalar(
        unlikely,
        bounds=(0.0, LARGEST_SHARE),
        args=(time_constant,),
        method="bounded",
        options={"maxiter": 10, "xatol": 0.01},
    )
    gain = unlikely(0.0, step) - float(finer.fun)
    if gain < EVIDENCE:
        return 0.0, step, 0.0
    return float(finer.x), time_constant, gain


def _restricted_likelihood(
    reduced: Array, observations: Observations, share: Array, time_constant: float
) -> float:
    measured = observations.measured
    times, sessions = observations.times, observations.sessions
    wander = Wander.of(measured, times, sessions, share, time_constant)
    p = reduced.shape[2] - 1
    flat = wander(reduced).reshape(-1, p + 1)
    # The columns are independent and far from parallel, so their Gram matrix is safe.
    factor = np.linalg.cholesky(flat.T @ flat + np.diag(np.full(p + 1, ROUNDING)))
    size = np.diagonal(factor)
    freedom = int(measured.sum()) - p
    log_information = 2 * np.log(size[:p]).sum()
    variance = size[p] ** 2 / freedom
    return -0.5 * float(wander.log_sum + log_information + freedom * np.log(variance))
