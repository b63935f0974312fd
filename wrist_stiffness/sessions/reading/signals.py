"""Signals at other stamps than their own: interpolated or held, never extrapolated.

Samples come in the order in which they were recorded.  Where a clock was set back meanwhile, two
motions have the same stamps: in the order of the stamps they would be one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import Array

Stamps = NDArray[np.int64]

SET_BACK_NS = 200_000_000
"""Stamps that go back by less are late messages, or a delay that a model can have [ns]."""

STAYS_BACK = 20
"""So many samples go on from there, one after the other, after a clock was set; fewer came late."""

CATCHES_UP = 0.5
"""Share of the way back that none of them makes good at once."""

MOST_SET_BACK = 10
"""Nobody sets a clock more often: then samples are in no order at all."""


@dataclass(frozen=True)
class Twice:
    """A time that has passed twice by the stamps, as a clock was set back at its end."""

    # `begin_ns`, `end_ns`: first and last stamp [ns]; the end is before where nothing has the same
    begin_ns: int
    end_ns: int
    back_ns: int  # by how much it was set back [ns]

    def of(self, time_ns: Stamps) -> NDArray[np.bool_]:
        """Tell which stamps (n,) are in it."""
        return (time_ns >= self.begin_ns) & (time_ns <= self.end_ns)

    def told(self, start_ns: int) -> str:
        """Say when and by how much, from the start of a recording on [ns]."""
        said = f"a clock was set back by about {self.back_ns * 1e-9:.2f} s"
        if self.end_ns < self.begin_ns:
            return f"{said}: what came after it is taken for what came before"
        began, ended = ((each - start_ns) * 1e-9 for each in (self.begin_ns, self.end_ns))
        return (
            f"{said}: what is stamped {began:.2f} to {ended:.2f} s after the start was measured at "
            "two times, and is not used"
        )


def set_back(time_ns: Stamps) -> tuple[Twice, ...]:
    """Find where stamps (n,) [ns], in the order in which they were recorded, go back and stay."""
    latest = np.maximum.accumulate(time_ns)
    found = []
    for row in np.flatnonzero(np.diff(time_ns) < -SET_BACK_NS):
        after = time_ns[row + 1 : row + 2 + STAYS_BACK]
        on, back = np.diff(after), latest[row] - after[0]
        if len(on) == STAYS_BACK and (on > 0).all() and (on < CATCHES_UP * back).all():
            begin = max(int(after[0]), int(time_ns[: row + 1].min()))
            end = min(int(latest[row]), int(time_ns[row + 1 :].max()))
            found.append(Twice(begin, end, int(back)))
    return tuple(found) if len(found) <= MOST_SET_BACK else ()


def in_any(spans: Sequence[Twice], time_ns: Stamps) -> NDArray[np.bool_]:
    """Tell which stamps (n,) [ns] are in any of these times."""
    return np.any([np.zeros(len(time_ns), dtype=bool), *(each.of(time_ns) for each in spans)], 0)


@dataclass(frozen=True, eq=False)
class Signal:
    """Values by stamp."""

    time_ns: Stamps  # (n,) int64, stamps, rising [ns]
    values: Array  # (n, ...), finite

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.time_ns)

    def take(self, rows: NDArray[np.bool_]) -> Signal:
        """Return some of the values, in their order."""
        return Signal(self.time_ns[rows], self.values[rows])

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
