"""What all parts of the benchmark share: the table, the length of a session, its rate."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.shipped import shipped_file

Array = NDArray[np.float64]

RATE_HZ = 10.0
SECONDS = 120.0
"""Of one session."""


@cache
def wrist() -> Table:
    """Return the shipped table."""
    return load_table(shipped_file("precomputed/palmieri2015.npz"))
