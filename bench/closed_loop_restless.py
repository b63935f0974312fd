"""How restless a correction is where a motor turns round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOW_S = 0.5
"""A motor that turns round is watched for so long."""


@dataclass(frozen=True)
class Restless:
    """What a correction does at the reversals of its motor.

    Parameters
    ----------
    reversals : int
        Of both motors.
    turns : float
        How often the correction changes its direction within a window, on average.
    most : int
        The same in the worst window.  One that only follows or crosses needs one at most.
    rate_share : float
        Fastest change of the correction, over the fastest motion that is commanded.
    """

    reversals: int
    turns: float
    most: int
    rate_share: float


def restless(time_s: Array, wanted: Array, correction: Array, least: float) -> Restless:
    """Watch a correction at the reversals.

    Parameters
    ----------
    time_s : (n,) float
        [s].
    wanted, correction : (n, 2) float
        Commanded angles, and what is added to them [rad].
    least : float
        A correction that comes back by as much has changed its direction [rad].
    """
    counts = []
    for angle, added in zip(wanted.T, correction.T, strict=True):
        for start in reversals(angle):
            window = (time_s >= time_s[start - 1]) & (time_s <= time_s[start] + WINDOW_S)
            counts.append(turning_points(added[window], least))
    step = np.diff(time_s)[:, None]
    fastest = float(np.abs(np.diff(wanted, axis=0) / step).max())
    rate = float(np.abs(np.diff(correction, axis=0) / step).max())
    return Restless(len(counts), float(np.mean(counts)), max(counts), rate / fastest)


def reversals(angle: Array) -> list[int]:
    """Return the samples at which an angle (n,) first moves against its last motion."""
    found, sense = [], 0.0
    for number, step in enumerate(np.sign(np.diff(angle)).tolist(), start=1):
        if step and step == -sense:
            found.append(number)
        sense = step or sense
    return found


def turning_points(values: Array, least: float) -> int:
    """Return how often (n,) values turn round by at least so much."""
    count, sense, extreme = 0, 0, values[0]
    for value in values.tolist():
        if sense * (value - extreme) >= 0.0 and sense:
            extreme = value
        elif abs(value - extreme) >= least:
            count += sense != 0
            sense, extreme = (1 if value > extreme else -1), value
    return count
