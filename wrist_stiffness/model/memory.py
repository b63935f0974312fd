"""Sums over the past that laws with memory share, whole blocks at once.

Both are compositions of maps (clamps, affine maps), which are associative: a block of n samples
takes log2(n) passes of NumPy instead of n steps of Python.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import Array


def play(values: Array, half_width: Array | float, start: Array | None) -> Array:
    """Follow a value with lost motion: y_i = clip(y_{i-1}, u_i - h, u_i + h).

    `values` (n, ...): u, the driving value; `half_width` float or (n, ...): h, not negative;
    `start` (...): y before the first sample, None for u there.  Gives (n, ...): y, exact to the bit
    in any split of the samples.
    """
    low, high = values - half_width, values + half_width
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
    """Follow a value with a first-order lag, exact for the mean of neighbouring samples held.

    `values` (n, k): u, the driving value.  `interval` (n,): time since the sample before [s]; the
    first one since the block before.  `time_constant` [s], above 0.  `before`, `start` (k,): u and
    x of the sample before the block.  Gives (n, k): x with x' = (u - x) / time_constant.
    """
    decay = np.exp(-interval / time_constant)[:, None]
    earlier = np.concatenate([before[None], values[:-1]])
    sum_ = -np.expm1(-interval / time_constant)[:, None] * (0.5 * (earlier + values))
    step = 1
    while step < len(values):
        sum_[step:] = sum_[step:] + decay[step:] * sum_[:-step]
        decay[step:] = decay[step:] * decay[:-step]
        step *= 2
    return decay * start + sum_


def lagged(time: Array, values: Array, time_constant: float, state: Any) -> tuple[Array, Any]:
    """Return values (n, k) behind a first-order lag, settled at the first sample, and the state."""
    if time_constant <= 0.0:
        return values, None
    before_time, before, start = state if state else (time[0], values[0], values[0])
    interval = np.diff(time, prepend=before_time)
    slow = lag(values, interval, time_constant, before, start)
    return slow, (time[-1], values[-1], slow[-1])
