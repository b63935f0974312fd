"""Where the rigid wrist points: what every measured pose is held against."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array

CHUNK = 20_000
"""Poses whose rigid wrist is in memory at a time."""


def rigid_rotation(table: Table, theta: Array) -> Array:
    """Return the rotation U -> F of the rigid platform, (n, 3, 3), at reachable angles (n, 2)."""
    rotation = np.empty((len(theta), 3, 3))
    for start in range(0, len(theta), CHUNK):
        rows = slice(start, start + CHUNK)
        rotation[rows] = table.mechanism.forward(theta[rows]).platform
    return rotation
