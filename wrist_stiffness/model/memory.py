"""What laws with memory share, whole blocks at once instead of a step of Python for each sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg.lapack import dtbtrs

from wrist_stiffness.mechanism.components import Array


def play(values: Array, half_width: Array | float, start: Array | None) -> Array:
    """Follow a value with lost motion: y_i = clip(y_{i-1}, u_i - h, u_i + h).

    `values` (n, ...): u, the driving value; `half_width` float or (n, ...): h, not negative;
    `start` (...): y before the first sample, None for u there.  Gives (n, ...): y, exact to the bit
    in any split of the samples.
    """
    low, high = values - half_width, values + half_width
    # Clamps one after the other are associative: a block of n samples takes log2(n) passes.
    step = 1
    while step < len(values):
        # Clamp after clamp is a clamp: the earlier limits, clamped by the later ones.
        low[step:], high[step:] = (
            np.clip(low[:-step], low[step:], high[step:]),
            np.clip(high[:-step], low[step:], high[step:]),
        )
        step *= 2
    return np.clip(values[0] if start is None else start, low, high)


Before = tuple[float, Array]
"""Time [s] and values (k,) of the sample before a block."""


def slope(time: Array, values: Array, before: Before | None) -> tuple[Array, Before]:
    """Return how fast values (n, k) change from sample to sample, and what the next block gets.

    Zero where time (n,) [s] stands still, and at the very first sample.
    """
    last_s, last = before or (time[0], values[0])
    interval = (time - np.concatenate([[last_s], time[:-1]]))[:, None]
    step = values - np.concatenate([last[None], values[:-1]])
    found = np.divide(step, interval, out=np.zeros_like(step), where=interval > 0.0)
    return found, (time[-1], values[-1])


def lag(values: Array, interval: Array, time_constant: float, before: Array, start: Array) -> Array:
    """Follow a value with a first-order lag, exact where it is straight between the samples.

    `values` (n, k): u, the driving value.  `interval` (n,): time since the sample before [s]; the
    first one since the block before.  `time_constant` [s], above 0.  `before`, `start` (k,): u and
    x of the sample before the block.  Gives (n, k): x with x' = (u - x) / time_constant.
    """
    steps = (interval / time_constant)[:, None]
    earlier = np.concatenate([before[None], values[:-1]])
    # x' = u - x for a straight u: of a step of u within h time constants x lacks (1 - e^-h) / h.
    gone = -np.expm1(-steps)
    late, decay = np.divide(gone, steps, out=np.ones_like(steps), where=steps > 0.0), 1.0 - gone
    followed = (1.0 - late) * values + (late - decay) * earlier
    followed[0] += decay[0] * start
    # x_i - decay_i x_{i-1} = followed_i: a triangle of two diagonals.
    bands = np.vstack([np.ones(len(values)), np.append(-decay[1:, 0], 0.0)])
    return np.asarray(dtbtrs(bands, followed, uplo="L", diag="U")[0])


def lagged(time: Array, values: Array, time_constant: float, state: Any) -> tuple[Array, Any]:
    """Return values (n, k) behind a first-order lag, settled at the first sample, and the state."""
    if time_constant <= 0.0:
        return values, None
    before_time, before, start = state if state else (time[0], values[0], values[0])
    interval = np.diff(time, prepend=before_time)
    slow = lag(values, interval, time_constant, before, start)
    return slow, (time[-1], values[-1], slow[-1])
