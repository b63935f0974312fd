"""Temperatures and covariates: slow signals, held from stamp to stamp."""

from __future__ import annotations

import bisect
import operator
from collections.abc import Sequence

import numpy as np

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError


class HeldSignals:
    """To a sample belongs, of every name, the newest value whose stamp is not younger.

    `age_limit_s`: oldest value that is still used [s]; may be changed.
    """

    CAPACITY = 1024

    def __init__(self, age_limit_s: float) -> None:
        self.age_limit_s = age_limit_s
        self.stale: tuple[str, ...] = ()  # names whose values were too old for the last sample
        self._stamps: dict[str, list[int]] = {}
        self._values: dict[str, list[float]] = {}

    def add(self, name: str, stamp_ns: int, value: float) -> None:
        """Keep a value; a stamp before others says that these are of another time.

        `name`: of the component or of the covariate; `stamp_ns` [ns].  Raises `InputError` if the
        value is not finite.
        """
        if not np.isfinite(value):
            raise InputError(f"{name}: {value} is not finite")
        stamps = self._stamps.setdefault(name, [])
        values = self._values.setdefault(name, [])
        place = bisect.bisect_left(stamps, stamp_ns)
        stamps[place:], values[place:] = [stamp_ns], [value]
        if len(stamps) > self.CAPACITY:
            del stamps[0], values[0]

    def rises_with(self, name: str, stamps: Sequence[int], first_ns: int) -> bool:
        """Tell whether further values of these stamps [ns] leave those of a first sample in place.

        They do where none is older than the one before, and none goes that the sample may need.
        """
        known = [*self._stamps.get(name, ()), *stamps]
        rises = all(map(operator.lt, known[:-1], known[1:]))
        surplus = len(known) - self.CAPACITY
        return rises and (surplus <= 0 or known[surplus] <= first_ns)

    def at(self, stamp_ns: int) -> dict[str, float]:
        """Return the values that belong to a stamp [ns] by name.

        A name without a value before the stamp, or with too old a one, is absent.
        """
        oldest_ns = stamp_ns - round(self.age_limit_s * NANOSECONDS)
        found, stale = {}, []
        for name, stamps in self._stamps.items():
            place = bisect.bisect_right(stamps, stamp_ns) - 1
            if place < 0:
                continue
            if stamps[place] < oldest_ns:
                stale.append(name)
            else:
                found[name] = self._values[name][place]
        self.stale = tuple(stale)
        return found
