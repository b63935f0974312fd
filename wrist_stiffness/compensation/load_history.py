"""Which load belongs to a joint state: by stamps, held up to an age limit, less the tare."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.payload import Thresholds
from wrist_stiffness.errors import InputError, StaleLoadError, WristError
from wrist_stiffness.mechanism.compiled import Flags
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Load

NANOSECONDS = 1_000_000_000

TARE_WINDOW_S = 1.0

PART_S = 0.2
"""A load whose means over this time differ within a tare is no noise: it swings or is moved [s]."""

SIGMAS = 3.0
"""By so many standard errors of its noise a mean may differ besides."""


@dataclass(frozen=True)
class Zero:
    """What a load sensor shows without a load."""

    load: Load  # in the frame in which loads come
    scatter: Array  # (6,), standard deviations of the loads that it is the mean of [N, N m]


class LoadHistory:
    """Loads at O by stamp: to a joint state belongs the newest load that is not younger.

    Stamps alone decide, never arrival, so live nodes and replay agree wherever the load had
    arrived.  Loads are held up to an age limit and never extrapolated.  They are kept as they come
    and given out less the tare.

    `age_limit_s`: oldest load that is still used [s]; `frames`: in which they arrive; both may be
    changed.
    """

    CAPACITY = 4096

    def __init__(self, age_limit_s: float, frames: Frames) -> None:
        self.age_limit_s = age_limit_s
        self.frames = frames
        # what is subtracted; may be set to one that was measured or stored
        self.zero: Zero | None = None
        # loads that arrived after a joint state had been served that they belonged to: where live
        # and replayed predictions may differ
        self.late = 0
        self._served_ns = (0, 0)
        self._stamps: list[int] = []
        # Rows of as many loads, the oldest first, behind others that are no longer wanted.
        self._first = 0
        self._wrench = np.empty((2 * self.CAPACITY, 6))
        self._on_platform = np.empty(2 * self.CAPACITY, dtype=bool)

    @property
    def _age_limit_ns(self) -> int:
        return round(self.age_limit_s * NANOSECONDS)

    @property
    def newest_ns(self) -> int | None:
        """Newest stamp [ns], None where no load has arrived."""
        return self._stamps[-1] if self._stamps else None

    def add(
        self, stamp_ns: int, frame_id: str, force: Sequence[float], moment: Sequence[float]
    ) -> None:
        """Take in a wrench message (see `Frames.load` for its errors)."""
        self.keep(stamp_ns, self.frames.load(frame_id, force, moment))

    def keep(self, stamp_ns: int, load: Load) -> None:
        """Keep a load; one with the same stamp is replaced, one out of order finds its place.

        A stamp that is older than the newest one by more than the age limit says that the clock
        jumped back: the history begins anew.
        """
        if self._stamps and stamp_ns < self._stamps[-1] - self._age_limit_ns:
            self._stamps, self._served_ns = [], (0, 0)
        load_served_ns, served_ns = self._served_ns
        if load_served_ns < stamp_ns <= served_ns:
            self.late += 1
        place = bisect.bisect_left(self._stamps, stamp_ns)
        if place == len(self._stamps) or self._stamps[place] != stamp_ns:
            end = self._room(1).stop
            if place < len(self._stamps):
                for column in (self._wrench, self._on_platform):
                    own = column[self._first + place : end]
                    own[1:] = own[:-1].copy()
            self._stamps.insert(place, stamp_ns)
        self._wrench[self._first + place] = load.wrench
        self._on_platform[self._first + place] = load.on_platform
        self._forget()

    def _room(self, count: int) -> slice:
        """Return where further loads go."""
        begin = self._first + len(self._stamps)
        if begin + count > len(self._wrench):
            for column in (self._wrench, self._on_platform):
                column[: len(self._stamps)] = column[self._first : begin].copy()
            self._first, begin = 0, len(self._stamps)
        return slice(begin, begin + count)

    def _forget(self) -> None:
        surplus = max(0, len(self._stamps) - self.CAPACITY)
        del self._stamps[:surplus]
        self._first += surplus

    def _load(self, place: int) -> Load:
        row = self._first + place
        wrench, on_platform = self._wrench[row], bool(self._on_platform[row])
        if self.zero is None:
            return Load(wrench.copy(), on_platform)
        if self.zero.load.on_platform != on_platform:
            raise InputError("load: the tare was taken in another frame than this load")
        return Load(wrench - self.zero.load.wrench, on_platform)

    def at(self, stamp_ns: int) -> tuple[int, Load]:
        """Return stamp and load that belong to a joint state.

        `stamp_ns`: stamp of the joint state [ns].  Gives stamp [ns] and load.  Raises
        `StaleLoadError` if there is none, or it is older than the age limit; `InputError` if the
        tare was taken in another frame.
        """
        if stamp_ns == 0:
            raise StaleLoadError("the sample has no stamp (zero), so no load belongs to it")
        place = bisect.bisect_right(self._stamps, stamp_ns) - 1
        if place < 0:
            raise StaleLoadError("no load estimate with a stamp before the joint state")
        age = stamp_ns - self._stamps[place]
        if age > self._age_limit_ns:
            raise StaleLoadError(
                f"newest load estimate is {age / NANOSECONDS:.3f} s older than the joint state "
                f"(limit {self.age_limit_s:g} s)"
            )
        self._served_ns = (self._stamps[place], max(stamp_ns, self._served_ns[1]))
        return self._stamps[place], self._load(place)

    def keeps(self, stamps: NDArray[np.int64], first_ns: int) -> bool:
        """Tell whether loads of further stamps (k,) [ns] leave that of a first sample in place."""
        surplus = len(self._stamps) + len(stamps) - self.CAPACITY
        if surplus <= 0:
            return True
        return surplus < len(self._stamps) and self._stamps[surplus] <= first_ns

    def rises_with(self, stamps: NDArray[np.int64]) -> bool:
        """Tell whether loads of these stamps (k,) [ns] would all be newer than the one before."""
        if not len(stamps):
            return True
        newest = self._stamps[-1] if self._stamps else stamps[0] - 1
        return bool(stamps[0] > newest and (np.diff(stamps) > 0).all())

    def block_at(self, stamps: NDArray[np.int64]) -> tuple[Array, Flags, Flags]:
        """Return the loads (n, 6) that belong to stamps (n,) [ns], which are in U, which are there.

        Those that `at` refuses are not there.
        """
        kept = np.array(self._stamps, dtype=np.int64)
        found = np.searchsorted(kept, stamps, side="right") - 1
        known = (found >= 0) & (stamps != 0)
        known[known] = stamps[known] - kept[found[known]] <= self._age_limit_ns
        wrench, on_platform = np.zeros((len(stamps), 6)), np.zeros(len(stamps), dtype=bool)
        if known.any():
            last = int(np.flatnonzero(known)[-1])
            newest = max(int(stamps[known].max()), self._served_ns[1])
            self._served_ns = int(kept[found[last]]), newest
            rows = self._first + found[known]
            wrench[known], on_platform[known] = self._wrench[rows], self._on_platform[rows]
        if self.zero is not None:
            known &= on_platform == self.zero.load.on_platform
            wrench[known] -= self.zero.load.wrench
        return wrench, on_platform, known

    def measured_zero(self, limit: Thresholds) -> Zero:
        """Return mean and scatter of the loads of the last second, for a tare.

        `limit`: by which another load departs.  Gives `Zero`: in the frame in which they came.
        Raises `StaleLoadError` if there is no load; `InputError` if loads in F and in U are mixed,
        or the load moves.
        """
        if not self._stamps:
            raise StaleLoadError("tare: no load estimate has arrived")
        last_ns = self._stamps[-1]
        start = bisect.bisect_left(self._stamps, last_ns - round(TARE_WINDOW_S * NANOSECONDS))
        rows = slice(self._first + start, self._first + len(self._stamps))
        wrenches, on_platform = self._wrench[rows], self._on_platform[rows]
        if on_platform.any() != on_platform.all():
            raise InputError("tare: loads in wrist_base and in wrist_platform are mixed")
        mean = wrenches.mean(axis=0)
        ages_s = (last_ns - np.array(self._stamps[start:])) / NANOSECONDS
        force, moment = _moved(wrenches - mean, (ages_s // PART_S).astype(int))
        if force > limit.force or moment > limit.moment:
            raise InputError(
                f"tare: the load moves by {force:.3g} N and {moment:.3g} N m within "
                f"{TARE_WINDOW_S:g} s (limits {limit.force:g} N, {limit.moment:g} N m); let it rest"
            )
        return Zero(Load(mean, bool(on_platform[0])), wrenches.std(axis=0))

    def since(self, start_ns: int, stamp_ns: int) -> list[tuple[int, Load]]:
        """Return stamps [ns] and loads after one stamp and up to another (errors as of `at`)."""
        first = bisect.bisect_right(self._stamps, start_ns)
        last = bisect.bisect_right(self._stamps, stamp_ns)
        return [(self._stamps[place], self._load(place)) for place in range(first, last)]

    def add_block(
        self, stamps: NDArray[np.int64], frame_id: str, wrenches: NDArray[np.float64]
    ) -> list[WristError]:
        """Take in wrench messages of one frame and return why some cannot be used.

        At once where nothing stands against it, else by `add` one after the other, with the same
        result.  `stamps` (k,) int [ns]; `wrenches` (k, 6): force and moment [N, N m].
        """
        faults: list[WristError] = []
        finite = bool(np.isfinite(wrenches).all())
        if not (finite and self.rises_with(stamps) and self.frames.is_at_origin(frame_id)):
            for stamp_ns, wrench in zip(stamps.tolist(), wrenches.tolist(), strict=True):
                try:
                    self.add(stamp_ns, frame_id, wrench[:3], wrench[3:])
                except WristError as error:
                    faults.append(error)
            return faults
        load_served_ns, served_ns = self._served_ns
        self.late += int(np.count_nonzero((load_served_ns < stamps) & (stamps <= served_ns)))
        for begin in range(0, len(stamps), self.CAPACITY):
            part = slice(begin, begin + self.CAPACITY)
            rows = self._room(len(stamps[part]))
            self._wrench[rows] = wrenches[part]
            self._on_platform[rows] = self.frames.turns(frame_id)
            self._stamps += stamps[part].tolist()
            self._forget()
        return faults


def _moved(departures: Array, part: NDArray[np.int_]) -> tuple[float, float]:
    """Return by how much means over parts of a time depart, above noise, force and moment [N, N m].

    The noise is that of one reading after the other, for a swing hardly changes between these.
    """
    counts = np.bincount(part)
    sums = np.array([np.bincount(part, column) for column in departures.T]).T
    counts, sums = counts[counts > 0, None], sums[counts > 0]
    variance = (
        0.5 * np.mean(np.diff(departures, axis=0) ** 2, axis=0) if len(departures) > 1 else 0.0
    )
    above = np.maximum(np.abs(sums / counts) - SIGMAS * np.sqrt(variance / counts), 0.0)
    force, moment = np.linalg.norm(above.reshape(-1, 2, 3), axis=2).max(axis=0).tolist()
    return force, moment
