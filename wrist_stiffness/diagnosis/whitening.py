"""Make the scatter white: independent, of unit size, over components and over time.

The random part of a unit is white between units plus a slow wander (first-order Gauss-Markov,
Ornstein-Uhlenbeck).  Its Cholesky factor is applied by a Kalman filter, at a cost linear in the
number of units (Brockwell and Davis, Time Series, chapter 12: innovations).
"""

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.observations import Array, Labels, Mask, Observations


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Scatter of one unit.

    Parameters
    ----------
    reference : (m, m) array
        Covariance of a unit of which the table states none.
    scatter : (m, m) array
        Covariance that remains after the stated (or reference) one was divided out.
    colour_share : float
        Part of the variance that wanders slowly, in [0, 1).
    colour_time : float
        Correlation time of that part, in the unit of the times.
    dof : float
        On how many independent numbers the size of the scatter rests; infinite = as told.
    source : str
        Where the size comes from: ``replicates``, ``given`` or ``residual``.
    """

    reference: Array
    scatter: Array
    colour_share: float
    colour_time: float
    dof: float
    source: str

    def factors(self, observations: Observations) -> Array:
        """Inverse factors that bring each unit's components to unit scatter, (n, m, m)."""
        n, m = observations.values.shape
        stated = self.reference if observations.covariance is None else observations.covariance
        measured = observations.measured
        inner = component_factors(np.broadcast_to(stated, (n, m, m)), measured)
        return component_factors(np.broadcast_to(self.scatter, (n, m, m)), measured) @ inner

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
        white = self._filter(observations, self.factors(observations) @ filled, measured)
        return white.reshape(measured.size, columns.shape[2])

    def filtered(self, observations: Observations, columns: Array) -> Array:
        """Columns (n, q) filtered in time only, like a component that was always measured."""
        always = np.ones((len(columns), 1), dtype=bool)
        return self._filter(observations, columns[:, None, :], always)[:, 0]

    def _filter(self, observations: Observations, columns: Array, measured: Mask) -> Array:
        white, _ = innovations(
            columns,
            measured,
            observations.times,
            observations.sessions,
            self.colour_share,
            self.colour_time,
        )
        return white


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
    share: float,
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
    share, time_constant : float
        Share of the wander in the variance and its correlation time.

    Returns
    -------
    (n, m, k) array
        Innovations divided by their standard deviation; zero where not measured.
    float
        Sum of the logarithms of the innovation variances.
    """
    if share == 0:
        return np.where(measured[:, :, None], columns, 0.0), 0.0
    gap = np.diff(times, prepend=times[0])
    fresh = np.diff(sessions, prepend=sessions[0] - 1) != 0
    memory = np.where(fresh, 0.0, np.exp(-gap / time_constant))
    n, m, k = columns.shape
    state, variance = np.zeros((m, k)), np.zeros(m)
    result, log_sum = np.zeros((n, m, k)), 0.0
    for i, a in enumerate(memory):
        seen = measured[i]
        state = a * state
        variance = a**2 * variance + share * (1 - a**2)
        total = variance + (1 - share)
        surprise = np.where(seen[:, None], columns[i] - state, 0.0)
        result[i] = surprise / np.sqrt(total)[:, None]
        log_sum += float(np.log(total) @ seen)
        gain = np.where(seen, variance / total, 0.0)
        state = state + gain[:, None] * surprise
        variance = variance * (1 - gain)
    return result, log_sum
