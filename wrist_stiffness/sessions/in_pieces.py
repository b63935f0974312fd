"""Long arrays a piece at a time: what is done to each row stays in the processor's memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array

ROWS = 20_000
"""Rows of a piece: some rotation matrices of each fit into a processor's cache."""


def in_pieces(function: Callable[..., NDArray[Any]], *arrays: NDArray[Any]) -> NDArray[Any]:
    """Return what a function makes of arrays (n, ...) row by row, as if of all rows at once."""
    starts = range(0, max(len(arrays[0]), 1), ROWS)
    return np.concatenate(
        [function(*(each[start : start + ROWS] for each in arrays)) for start in starts]
    )


def rigid_rotation(table: Table, theta: Array) -> Array:
    """Return the rotation U -> F of the rigid platform, (n, 3, 3), at reachable angles (n, 2)."""
    return in_pieces(table.mechanism.platform_rotation, theta)
