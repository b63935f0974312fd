"""Lost beams: single measurements far from their neighbours in time."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wrist_stiffness.diagnosis.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import Array

WINDOW = 5
"""Neighbours, itself included, whose median a measurement is held against; steps pass it."""

LIMIT = 15.0
"""Robust standard deviations from the median of its neighbours that make a spike."""


def spikes(values: Array, least: Array) -> NDArray[np.bool_]:
    """Find the rows that stand out from their neighbours and from what neighbours usually do.

    What the wrist itself does lasts longer than two samples, or is as large everywhere.

    Parameters
    ----------
    values : (n, m) float
        In the order of time; NaN = not measured.
    least : (n, m) float
        Smaller spikes are none.

    Returns
    -------
    (n,) bool
        True = spike.
    """
    found = np.zeros(len(values), dtype=bool)
    for column, floor in zip(values.T, least.T, strict=True):
        known = np.flatnonzero(np.isfinite(column))
        if len(known) < WINDOW:
            continue
        windows = sliding_window_view(np.pad(column[known], WINDOW // 2, mode="edge"), WINDOW)
        apart = np.abs(column[known] - np.median(windows, axis=1))
        moving = apart[apart > 0.0]
        scale = MAD_TO_SIGMA * float(np.median(moving)) if moving.size else 0.0
        found[known[apart > np.maximum(LIMIT * scale, floor[known])]] = True
    return found
