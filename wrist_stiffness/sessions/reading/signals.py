"""Signals at other stamps than their own: interpolated or held, never extrapolated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import Array

Stamps = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Signal:
    """Values by stamp."""

    time_ns: Stamps  # (n,) int64, stamps, rising [ns]
    values: Array  # (n, ...), finite

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.time_ns)

    def interpolated(self, time_ns: Stamps) -> Array:
        """Return values (m, ...) at stamps (m,) inside the range: linear, exact at its own."""
        # Differences of stamps are exact in double precision, stamps since 1970 are not.
        start = self.time_ns[0]
        at, own = (time_ns - start).astype(float), (self.time_ns - start).astype(float)
        columns = self.values.reshape(len(self), -1).T
        found = np.stack([np.interp(at, own, column) for column in columns], axis=-1)
        return found.reshape(len(time_ns), *self.values.shape[1:])

    def newest(self, time_ns: Stamps) -> NDArray[np.intp]:
        """Return the row of the newest value that is not younger, -1 where there is none, (m,)."""
        return np.searchsorted(self.time_ns, time_ns, side="right") - 1


def in_order(time_ns: Stamps, values: Array) -> Signal:
    """Return a signal of samples in any order.

    `time_ns` (n,) int64: stamps [ns]; `values` (n, ...): rows that are not finite are left out; of
    equal stamps the last one received counts, as in the nodes.
    """
    finite = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    time_ns, values = time_ns[finite], values[finite]
    rows = last_of_equal(time_ns)
    return Signal(time_ns[rows], values[rows])


def last_of_equal(time_ns: Stamps) -> NDArray[np.intp] | slice:
    """Return the rows in the order of their stamps; of equal stamps only the last one received."""
    if np.all(np.diff(time_ns) > 0):
        return slice(None)
    _, reverse = np.unique(time_ns[::-1], return_index=True)
    return len(time_ns) - 1 - reverse
