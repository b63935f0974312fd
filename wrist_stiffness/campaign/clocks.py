"""How far the pose sensor's clock is from the joint states', told by the motion that both saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from wrist_stiffness.campaign.signals import Signal, Stamps
from wrist_stiffness.mechanism.components import Array

SEARCHED_S = 30.0
"""Largest offset that is looked for [s]."""

STEPS = 1200
"""Offsets tried on either side before the best one is refined."""

STAMPS_USED = 2000

LEAST_MOTION = np.radians(0.2)
"""Root mean square of the rotation below which there is no motion to compare [rad]."""

BLOCKS = 8
"""Parts of the session that estimate the offset each on its own; their scatter is its error."""

LEAST_IN_BLOCK = 4

LEAST_OVERLAP = 0.5
"""Share of the stamps that an offset must leave inside the range of the joint states."""


@dataclass(frozen=True)
class ClockOffset:
    """Stamps of the pose sensor minus stamps of the joint states for the same moment.

    Parameters
    ----------
    seconds, sigma : float
        Estimate and one standard uncertainty [s].
    gain : float
        Mean squared misfit of the rotation without the offset over that with it.
    """

    seconds: float
    sigma: float
    gain: float


def clock_offset(time_ns: Stamps, measured: Array, rigid: Signal) -> ClockOffset | None:
    """Estimate the offset of the clocks by the best agreement of measured and rigid rotation.

    Parameters
    ----------
    time_ns : (n,) int64
        Stamps of the measured rotations [ns].
    measured : (n, 3) float
        Rotation vectors, finite [rad].
    rigid : Signal
        Rotation vectors (m, 3) of the rigid wrist by the stamps of the joint states.

    Returns
    -------
    ClockOffset or None
        None where nothing moves, or too few stamps overlap.
    """
    used = np.unique(np.linspace(0, len(time_ns) - 1, STAMPS_USED).astype(int))
    at = 1e-9 * (time_ns[used] - rigid.time_ns[0])
    own = 1e-9 * (rigid.time_ns - rigid.time_ns[0])
    values = measured[used]
    if len(used) < BLOCKS * LEAST_IN_BLOCK or np.sqrt(values.var(axis=0).sum()) < LEAST_MOTION:
        return None

    def misfit(offset: float, rows: NDArray[np.intp] | slice = slice(None)) -> float:
        moment = at[rows] - offset
        inside = (moment >= 0.0) & (moment <= own[-1])
        if inside.sum() < LEAST_OVERLAP * len(moment):
            return np.inf
        rotation = np.stack([np.interp(moment[inside], own, axis) for axis in rigid.values.T], 1)
        # The mean is the registration of the instrument.
        return float(np.var(values[rows][inside] - rotation, axis=0).sum())

    tried = np.linspace(-SEARCHED_S, SEARCHED_S, 2 * STEPS + 1)
    best = float(tried[np.argmin([misfit(offset) for offset in tried])])
    if not np.isfinite(misfit(best)):
        return None
    step = SEARCHED_S / STEPS

    def refined(rows: NDArray[np.intp] | slice, near: float) -> float:
        bounds = (near - step, near + step)
        return float(minimize_scalar(misfit, bounds=bounds, args=(rows,), method="bounded").x)

    offset = refined(slice(None), best)
    # What the wrist bends has colour; the scatter between parts of the session tells the truth.
    each = [
        refined(rows, offset)
        for rows in np.array_split(np.arange(len(used)), BLOCKS)
        if np.sqrt(values[rows].var(axis=0).sum()) > LEAST_MOTION
    ]
    sigma = float(np.std(each, ddof=1) / np.sqrt(len(each))) if len(each) > 1 else step
    return ClockOffset(offset, sigma, misfit(0.0) / max(misfit(offset), np.finfo(float).tiny))
