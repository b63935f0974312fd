"""What scatter alone makes of the error: the floor below which no model can bring it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.noise import FEWEST_REPLICATE_DOF, replicate_variance
from wrist_stiffness.mechanism.components import Array

FEWEST_REPEATS = 6
"""Degrees of freedom from which a repeatability is told."""

SOURCES = {
    "replicates": "dwells that repeat a pose and load from the same side",
    "instrument": "the instrument's scatter within a dwell and the hidden encoder count; no slow "
    "wander is in it, for want of repeated dwells",
    "unpredictable": "the part that no smooth law of the conditions predicts, for want of anything "
    "better",
}
"""Where a floor may come from, in words."""

AT_THE_FLOOR = 1.15
"""An error up to so many times the noise floor is called noise."""

WITH_WANDER = 1.5
"""Where no dwell was repeated, an error up to so many times the floor may be slow wander: means of
many samples have little of the white scatter and all of the wander, which the floor then lacks."""


def over_floor(rms: Mapping[str, float], floor: Mapping[str, float]) -> float:
    """Return errors over their floor by the key of the quantity, the largest of them."""
    return max(rms[key] / floor[key] if floor[key] > 0.0 else np.inf for key in rms)


def against_floor(ratio: float, source: str) -> str:
    """Say what an error over the floor means, by where the floor is known from."""
    if source == "unpredictable":
        return f"{ratio:.1f} x what the conditions do not predict; the noise is not known"
    if ratio <= AT_THE_FLOOR:
        return "no more than the noise"
    if is_at_floor(ratio, source):
        return (
            f"{ratio:.1f} x the noise without slow wander of the instrument, which may be the rest"
        )
    if np.isinf(ratio):
        return "the instrument has no noise"
    lacks = " without slow wander of the instrument" if source == "instrument" else ""
    return f"{ratio:.1f} x the noise{lacks}"


def is_at_floor(ratio: float, source: str) -> bool:
    """Tell whether an error over the floor may be noise, by where the floor is known from."""
    return ratio <= (WITH_WANDER if source == "instrument" else AT_THE_FLOOR)


@dataclass(frozen=True, eq=False)
class NoiseFloor:
    """Scatter of each unit.

    Parameters
    ----------
    variance : (n, m) float
        Of each component of each unit [m^2, rad^2].
    source : str
        One of `SOURCES`.
    """

    variance: Array
    source: str

    def rms(self, observations: Observations) -> dict[str, float]:
        """Root mean square of each quantity, by its key, in the unit of its report."""
        return observations.rms(self.variance)


def noise_floor(observations: Observations) -> NoiseFloor:
    """Find the scatter of the units.

    Parameters
    ----------
    observations : Observations
        Values are what is left after everything that the conditions predict was taken out.
    """
    shape = observations.values.shape
    stated = np.zeros(shape)
    if observations.covariance is not None:
        stated = np.diagonal(
            np.broadcast_to(observations.covariance, (*shape, shape[1])), axis1=1, axis2=2
        )
    apart = by_side(observations)
    variance, freedom = scatter_of_repeats(apart)
    enough = FEWEST_REPEATS if observations.covariance is None else FEWEST_REPLICATE_DOF
    if freedom >= enough and apart.replicate is not None:
        known = stated[apart.replicate >= 0].mean(axis=0)
        return NoiseFloor(stated + np.maximum(variance - known, 0.0), "replicates")
    if observations.covariance is not None:
        return NoiseFloor(stated, "instrument")
    square = np.sum(np.nan_to_num(observations.values) ** 2, axis=0)
    mean = square / np.maximum(observations.measured.sum(axis=0), 1)
    return NoiseFloor(np.broadcast_to(mean, shape), "unpredictable")


def by_side(observations: Observations) -> Observations:
    """Return the table with replicates only of dwells that both motors approached alike."""
    if observations.replicate is None:
        return observations
    sides = [np.sign(observations.covariate(f"approach_{motor}")) for motor in (1, 2)]
    keys = np.column_stack([observations.replicate, *sides])
    _, label = np.unique(keys, axis=0, return_inverse=True)
    return replace(observations, replicate=np.where(observations.replicate >= 0, label, -1))


def scatter_of_repeats(observations: Observations) -> tuple[Array, float]:
    """Variance of a component inside groups of replicates, (m,), and its degrees of freedom."""
    values = np.where(observations.measured, observations.values, 0.0)
    return replicate_variance(values, np.empty((*values.shape, 0)), observations)


def repeatability(observations: Observations) -> dict[str, float]:
    """Scatter (RMS) of repeated dwells by the key of the quantity; empty with too few."""
    variance, freedom = scatter_of_repeats(observations)
    if freedom < FEWEST_REPEATS:
        return {}
    # Of a component that was never measured the variance is called 1, which is a metre.
    variance = np.where(observations.measured.any(axis=0), variance, 0.0)
    return {
        q.key: float(np.sqrt(variance[list(q.components)].sum())) * q.per_si
        for q in observations.reported
    }
