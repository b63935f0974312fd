"""Lost beams: single measurements far from their neighbours in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from wrist_stiffness.inference.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import Array

WINDOW = 5
"""Neighbours, itself included, whose median a measurement is held against; steps pass it."""

LIMIT = 15.0
"""Robust standard deviations from the median of its neighbours that make a spike."""

NOISE = 3.0
"""Robust standard deviations that are not yet due to the motion."""

MOVING_SHARE = 0.9
"""Share of the moving measurements that are taken for sound."""

MOVING_LIMIT = 4.0
"""Times what these keep to that a measurement in motion may be away."""

LEAST_MOVING = 30
"""Moving measurements that tell what motion does; of fewer all is put down to it that may be."""


def spikes(
    values: Array, least: float, swing: Array, moving: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Find the rows that stand out from their neighbours and from what neighbours usually do.

    What the wrist itself does lasts longer than two samples, or is as large everywhere.  What a
    stamp that is not quite right does grows with the motion, in all motions alike.

    `values` (n, m): in the order of time; NaN = not measured.  `least`: smaller spikes are none.
    `swing` (n,): largest difference from its neighbours that motion can make of a value.  `moving`
    (n,): rows whose swing tells how much of it motion does make.  Gives (n,): True = spike.
    """
    apart = np.stack([_apart(column) for column in values.T], axis=1)
    scale = np.array([_usual(column) for column in apart.T])
    limit = np.maximum(
        LIMIT * scale, least + (_share(apart, scale, swing, moving) * swing)[:, None]
    )
    return np.asarray((apart > limit).any(axis=1))


def _apart(column: Array) -> Array:
    """Return how far values (n,) are from the median of their neighbours, zero where too few."""
    apart = np.zeros(len(column))
    known = np.flatnonzero(np.isfinite(column))
    if len(known) >= WINDOW:
        apart[known] = np.abs(column[known] - median_filter(column[known], WINDOW, mode="nearest"))
    return apart


def _usual(apart: Array) -> float:
    differing = apart[apart > 0.0]
    return MAD_TO_SIGMA * float(np.median(differing)) if differing.size else 0.0


def _share(apart: Array, scale: Array, swing: Array, moving: NDArray[np.bool_]) -> float:
    """Return the share of the largest swing that motion makes of values at most."""
    moving = moving & (apart > 0.0).any(axis=1)
    if moving.sum() < LEAST_MOVING:
        return 1.0
    beyond = np.max(np.maximum(apart[moving] - NOISE * scale, 0.0), axis=1)
    return min(1.0, MOVING_LIMIT * float(np.quantile(beyond / swing[moving], MOVING_SHARE)))
