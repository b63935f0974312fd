"""Make the scatter white: independent, of unit size, over components and over time.

The random part of a unit is white between units plus a slow wander (first-order Gauss-Markov,
Ornstein-Uhlenbeck).  Its Cholesky factor is applied by a Kalman filter, at a cost linear in the
number of units (Brockwell and Davis, Time Series, chapter 12: innovations).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.inference.observations import Array, Labels, Mask, Observations
from wrist_stiffness.inference.shared import Apart, own_covariance


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
        return Whitener(self, observations)(columns)

    def wander(self, observations: Observations, measured: Mask, share: Array) -> "Wander":
        """Return the filter of the wander: a `share` (n, m) of each unit's variance."""
        times, sessions = observations.times, observations.sessions
        return Wander.of(measured, times, sessions, share, self.colour_time)


@dataclass(frozen=True, eq=False)
class Whitener:
    """Whitens columns of one table again and again: all but the columns is worked out once.

    Parameters
    ----------
    noise : NoiseModel
        Scatter of its units.
    observations : Observations
        Tells which entries were measured, and when.
    """

    noise: NoiseModel
    observations: Observations

    def __call__(self, columns: Array) -> Array:
        """Return `NoiseModel.whiten` of columns (n, m, k), (n m, k)."""
        measured = self.observations.measured
        weighted = self._apart(np.where(measured[:, :, None], columns, 0.0))
        weighted /= np.sqrt(self.noise.scale)
        return self._wander(weighted).reshape(measured.size, columns.shape[2])

    @cached_property
    def _apart(self) -> Apart:
        stated = stated_covariance(self.observations)
        own = own_covariance(self.observations, stated) + self.noise.beyond
        return Apart(self.observations, component_factors(own, self.observations.measured))

    @cached_property
    def _wander(self) -> "Wander":
        share = self.noise.wandering(self.observations)
        return self.noise.wander(self.observations, self.observations.measured, share)


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


@dataclass(frozen=True, eq=False)
class Wander:
    """Filter that leaves standardised innovations of white noise plus slow wander.

    Its gains follow from when was measured what, not from what is filtered.

    Parameters
    ----------
    measured : (n, m) array of bool
        Entries that take part.
    memory : (n,) array
        Share of the wander that is left from one unit to the next.
    slow : (n, m) array
        Size of the wander in each unit; zero where not measured.
    gain : (n, m) array
        Part of each innovation that moves the wander.
    variance : (n, m) array
        Of the innovations.
    """

    measured: Mask
    memory: Array
    slow: Array
    gain: Array
    variance: Array

    @classmethod
    def of(
        cls, measured: Mask, times: Array, sessions: Labels, share: Array, time_constant: float
    ) -> "Wander":
        """Work the gains out, for white noise and wander of unit variance together.

        Parameters
        ----------
        measured : (n, m) array of bool
            Entries that take part.
        times, sessions : (n,) arrays
            The wander starts afresh in every session.
        share : (n, m) array
            Of the wander in the variance of each unit.
        time_constant : float
            Correlation time of the wander.
        """
        gap = np.diff(times, prepend=times[0])
        fresh = np.diff(sessions, prepend=sessions[0] - 1) != 0
        # Clocks of sessions may begin anew, long before the end of the last one.
        memory = np.exp(-np.where(fresh, np.inf, gap) / time_constant)
        slow = np.where(measured, np.sqrt(share), 0.0)
        total, gain = np.ones_like(slow), np.zeros_like(slow)
        if slow.any():
            variance = np.zeros(slow.shape[1])
            for i, a in enumerate(memory):
                variance = a**2 * variance + (1 - a**2)
                total[i] = slow[i] ** 2 * variance + (1 - share[i])
                gain[i] = slow[i] * variance / total[i]
                variance = variance * (1 - gain[i] * slow[i])
        return cls(measured, memory, slow, gain, total)

    @property
    def log_sum(self) -> float:
        """Sum of the logarithms of the innovation variances."""
        return float(np.sum(np.log(self.variance), where=self.measured))

    def __call__(self, columns: Array) -> Array:
        """Return the innovations of columns (n, m, k), divided by their standard deviation.

        Every component and column is filtered by itself; zero where not measured.
        """
        result = np.where(self.measured[:, :, None], columns, 0.0)
        if not self.gain.any():
            return result
        state = np.zeros(columns.shape[1:])
        for i, a in enumerate(self.memory):
            state *= a
            surprise = result[i]
            surprise -= self.slow[i, :, None] * state
            state += self.gain[i, :, None] * surprise
        result /= np.sqrt(self.variance)[:, :, None]
        return result
