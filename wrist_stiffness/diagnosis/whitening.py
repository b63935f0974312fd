"""Make the scatter white: independent, of unit size, over components and over time.

The random part of a unit is white between units plus a slow wander (first-order Gauss-Markov,
Ornstein-Uhlenbeck).  Its Cholesky factor is applied by a Kalman filter, at a cost linear in the
number of units (Brockwell and Davis, Time Series, chapter 12: innovations).
"""

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.observations import Array, Labels, Mask, Observations
from wrist_stiffness.diagnosis.shared import apart, own_covariance


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Scatter of one unit: what the table states of it, and what comes on top of that.

    A mean over a long rest states little scatter of its own, and wanders like any other.

    Parameters
    ----------
    beyond : (m, m) array
        Covariance beyond the stated one; all of it where the table states none.
    colour_share : float
        Part of the variance that wanders slowly, in [0, 1).
    colour_time : float
        Correlation time of that part, in the unit of the times.
    dof : float
        On how many independent numbers the size of the scatter rests; infinite = as told.
    source : str
        Where the size comes from: ``replicates``, ``given`` or ``residual``.
    all_wanders : bool
        Whether that part is of all variance, or only of what is beyond the stated one: some tables
        state the wander too, others the white scatter alone.
    scale : float
        Factor of all covariances.
    """

    beyond: Array
    colour_share: float
    colour_time: float
    dof: float
    source: str
    all_wanders: bool = True
    scale: float = 1.0

    def variance(self, observations: Observations) -> Array:
        """Variance of each component of each unit by itself, (n, m)."""
        covariance = self.scale * (stated_covariance(observations) + self.beyond)
        return np.diagonal(covariance, axis1=1, axis2=2)

    def wandering(self, observations: Observations) -> Array:
        """Part of each variance that wanders slowly, (n, m)."""
        if self.all_wanders:
            return np.full(observations.values.shape, self.colour_share)
        stated = np.diagonal(stated_covariance(observations), axis1=1, axis2=2)
        own = np.diagonal(self.beyond)
        return np.asarray(self.colour_share * own / (stated + own))

    def whiten(self, observations: Observations, columns: Array) -> Array:
        """Whitened columns of these units, (n m, k); rows that were not measured become zero.

        Parameters
        ----------
        observations : Observations
            Tells which entries were measured, and when.
        columns : (n, m, k) array
            Columns to whiten; NaN counts as not measured.
        """
        measured = observations.measured
        filled = np.where(measured[:, :, None], columns, 0.0)
        own = own_covariance(observations, stated_covariance(observations)) + self.beyond
        weighted = apart(observations, component_factors(own, measured), filled)
        weighted /= np.sqrt(self.scale)
        white = self._filter(observations, weighted, measured, self.wandering(observations))
        return white.reshape(measured.size, columns.shape[2])

    def filtered(self, observations: Observations, columns: Array) -> Array:
        """Columns (n, q) filtered in time only, like a component that was always measured."""
        always = np.ones((len(columns), 1), dtype=bool)
        share = self.wandering(observations).mean(axis=1, keepdims=True)
        return self._filter(observations, columns[:, None, :], always, share)[:, 0]

    def _filter(
        self, observations: Observations, columns: Array, measured: Mask, share: Array
    ) -> Array:
        white, _ = innovations(
            columns,
            measured,
            observations.times,
            observations.sessions,
            share,
            self.colour_time,
        )
        return white


def stated_covariance(observations: Observations) -> Array:
    """Return the covariance that a table states of each unit, (n, m, m); zero where none."""
    n, m = observations.values.shape
    if observations.covariance is None:
        return np.zeros((n, m, m))
    return np.broadcast_to(observations.covariance, (n, m, m))


def component_factors(covariance: Array, measured: Mask) -> Array:
    """Inverse Cholesky factors of each unit's covariance over its measured components.

    Parameters
    ----------
    covariance : (n, m, m) array
        Covariance of each unit.
    measured : (n, m) array of bool
        Unmeasured components get a unit diagonal and no coupling.

    Returns
    -------
    (n, m, m) array
        L^-1 with L L^T = covariance.
    """
    m = covariance.shape[1]
    both = measured[:, :, None] & measured[:, None, :]
    safe = np.where(both, covariance, np.eye(m))
    return np.linalg.inv(np.linalg.cholesky(safe)).astype(np.float64)


def innovations(
    columns: Array,
    measured: Mask,
    times: Array,
    sessions: Labels,
    share: Array,
    time_constant: float,
) -> tuple[Array, float]:
    """Standardised innovations of white noise plus slow wander of unit variance together.

    Parameters
    ----------
    columns : (n, m, k) array
        Series of unit scatter; every component and column is filtered by itself.
    measured : (n, m) array of bool
        Entries that take part.
    times, sessions : (n,) arrays
        The wander starts afresh in every session.
    share : (n, m) array
        Of the wander in the variance of each unit.
    time_constant : float
        Correlation time of the wander.

    Returns
    -------
    (n, m, k) array
        Innovations divided by their standard deviation; zero where not measured.
    float
        Sum of the logarithms of the innovation variances.
    """
    if not share.any():
        return np.where(measured[:, :, None], columns, 0.0), 0.0
    gap = np.diff(times, prepend=times[0])
    fresh = np.diff(sessions, prepend=sessions[0] - 1) != 0
    memory = np.where(fresh, 0.0, np.exp(-gap / time_constant))
    slow = np.where(measured, np.sqrt(share), 0.0)
    total, gain = np.empty_like(slow), np.empty_like(slow)
    variance = np.zeros(columns.shape[1])
    for i, a in enumerate(memory):
        variance = a**2 * variance + (1 - a**2)
        total[i] = slow[i] ** 2 * variance + (1 - share[i])
        gain[i] = slow[i] * variance / total[i]
        variance = variance * (1 - gain[i] * slow[i])
    # The gains do not depend on what is filtered: the long rows are left with three sums.
    result = np.where(measured[:, :, None], columns, 0.0)
    state = np.zeros(columns.shape[1:])
    for i, a in enumerate(memory):
        state *= a
        surprise = result[i]
        surprise -= slow[i, :, None] * state
        state += gain[i, :, None] * surprise
    result /= np.sqrt(total)[:, :, None]
    return result, float(np.sum(np.log(total), where=measured))
