"""How well dwells repeat each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.noise import replicate_variance

FEWEST_REPEATS = 6
"""Degrees of freedom from which a repeatability is told."""


def by_side(observations: Observations) -> Observations:
    """Return the table with replicates only of dwells that both motors approached alike."""
    if observations.replicate is None:
        return observations
    sides = [np.sign(observations.covariate(f"approach_{motor}")) for motor in (1, 2)]
    keys = np.column_stack([observations.replicate, *sides])
    _, label = np.unique(keys, axis=0, return_inverse=True)
    return replace(observations, replicate=np.where(observations.replicate >= 0, label, -1))


def repeatability(observations: Observations) -> dict[str, float]:
    """Scatter (RMS) of repeated dwells by the key of the quantity; empty with too few."""
    values = np.where(observations.measured, observations.values, 0.0)
    variance, freedom = replicate_variance(values, np.empty((*values.shape, 0)), observations)
    if freedom < FEWEST_REPEATS:
        return {}
    # Of a component that was never measured the variance is called 1, which is a metre.
    variance = np.where(observations.measured.any(axis=0), variance, 0.0)
    return {
        q.key: float(np.sqrt(variance[list(q.components)].sum())) * q.per_si
        for q in observations.reported
    }
