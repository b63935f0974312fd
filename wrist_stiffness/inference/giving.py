"""Laws that give: an effect of which a catalogue law has the shape, but not quite.

It may be larger one way than the other, as a worn screw or a bracket that rests on one side, or
grow faster or slower than its law says, as what softens or saturates.  Both are columns made of the
effect's own change, so any law that is not exact may give, a user's own as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WAYS = ("asymmetry", "growth")
"""Half of the difference between the sides, as a share of their mean; power of the law's size by
which the effect grows beyond it, 0 where the law is right."""

SPREAD = 0.3
"""Standard deviation of either where a law gives (assumed)."""

ONE_WAY = 0.9
"""Asymmetry from which the ratio of the sides says no more than that one is far larger."""

GIVES = 0.2
"""Prior probability that an effect of the catalogue gives in one of these ways (assumed)."""


@dataclass(frozen=True)
class Give:
    """In which way the law of an effect gives."""

    name: str  # of the effect
    way: str  # one of `WAYS`


def told(way: str, value: float, sigma: float) -> str:
    """Return a sentence for a technician."""
    if way == "asymmetry":
        share = min(abs(value), ONE_WAY)
        ratio, error = (1.0 + share) / (1.0 - share), 2.0 * sigma / (1.0 - share) ** 2
        return f"One way it is {ratio:.2f} +- {error:.2f} times as large as the other."
    faster = "faster than its law, as what softens" if value > 0.0 else "slower, as what saturates"
    return f"It grows {faster}: with the power {1.0 + value:.2f} +- {sigma:.2f} of it."


def given(change: Array, scale: Array) -> Array:
    """Return what an effect does in addition for each way of giving, of 1 standard deviation.

    `change` (u, m): what it does to each unit by its law; `scale` (m,): size of each component, to
    compare them.
    Returns (u, m, 2) in the order of `WAYS`.
    """
    told = np.nan_to_num(change) / scale
    side = np.sign(told @ np.linalg.svd(told, full_matrices=False)[2][0])
    size = np.linalg.norm(told, axis=1)
    usual = float(np.sqrt(np.mean(size**2))) or 1.0
    power = np.log(np.maximum(size / usual, np.finfo(float).tiny))
    ways = np.column_stack([side, np.where(size > 0.0, power, 0.0)])
    return np.asarray(SPREAD * change[:, :, None] * ways[:, None, :])
