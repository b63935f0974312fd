"""How sure one can be of a rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Z = 1.96
"""Of a two-sided 95 % interval."""


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (Wilson 1927)."""
    if trials == 0:
        return 0.0, 1.0
    rate = hits / trials
    centre = rate + Z * Z / (2 * trials)
    half = Z * np.sqrt(rate * (1 - rate) / trials + Z * Z / (4 * trials * trials))
    scale = 1 + Z * Z / trials
    return max(0.0, float((centre - half) / scale)), min(1.0, float((centre + half) / scale))


def newcombe(one: NDArray[np.bool_], two: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the 95 % interval of the difference of two rates on the same n cases.

    Newcombe 1998, method 10, for paired rates.
    """
    n = len(one)
    p, q = float(one.mean()), float(two.mean())
    (p_low, p_high), (q_low, q_high) = wilson(int(one.sum()), n), wilson(int(two.sum()), n)
    both, neither = float(np.mean(one & two)), float(np.mean(~one & ~two))
    product = p * (1 - p) * q * (1 - q)
    phi = (both * neither - (p - both) * (q - both)) / np.sqrt(product) if product > 0.0 else 0.0
    low = (p - p_low) ** 2 - 2 * phi * (p - p_low) * (q_high - q) + (q_high - q) ** 2
    high = (p_high - p) ** 2 - 2 * phi * (p_high - p) * (q - q_low) + (q - q_low) ** 2
    return p - q - float(np.sqrt(max(low, 0.0))), p - q + float(np.sqrt(max(high, 0.0)))
