"""What a supervisor believes of the load; for blocks of commands it goes in and out as one row.

The compiled rules (`mechanism/native/supervisor.c`) are those of `supervisor.py`, to the bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.applied_share import RAMP_S, YIELD_S, AppliedShare
from wrist_stiffness.compensation.payload import (
    ENOUGH,
    SIGMAS,
    Payload,
    PayloadEstimate,
    Thresholds,
)
from wrist_stiffness.compensation.scales import Scales
from wrist_stiffness.compensation.supervision import State, SupervisorSettings
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Load

JUDGE_S = 0.1
"""A contact, a release or a new weight that departs by one threshold is believed after this time,
one that departs by more sooner in proportion, by two readings at least [s] ..."""

SETTLE_S = 0.5
"""... and what allows more correction after this: no part swings or is being lifted then [s]."""

LATE_S = 0.2
"""So late a load may be, and the motors behind their command: as much as the platform turns in this
time, a load may seem turned, and readings within it may all be wrong by the same [s]."""

CALM = 0.5
"""A contact ends and a weight becomes the payload within this part of the thresholds, so that noise
does not undo it."""

OPEN = 10.0
"""In contact a payload stands in only where its moment is known to this many thresholds."""

LONGEST_STEP_S = 0.1
"""A pause between commands counts as this much."""

NO_LOAD = "no load is known"
NEW_WEIGHT = "a weight that was not there before is being judged"
NO_WEIGHT = "the load is no weight: a contact, or the sensor is not tared"
CHANGES = "the load changes with the correction: a contact"

STATES = tuple(State)
TEXTS = ("", NO_LOAD, NEW_WEIGHT, NO_WEIGHT, CHANGES)


class Belief:
    """What is kept from command to command.

    `followed`: the last load that was followed as it was measured.
    """

    def __init__(self) -> None:
        self.scatter = Thresholds(0.0, 0.0)  # the least thresholds, from the noise of the load
        self._scales: Scales | None = None
        self._expected: Payload | None = None
        self._told = False
        self.forget()

    def forget(self) -> None:
        """Judge anew; what the gripper told still stands."""
        self._stamp_ns = self._since_ns = 0
        self._state = self._seen = State.UNSURE
        self._text = NO_LOAD
        self._seen_s = self._step_s = self._candidate_s = 0.0
        self._payload: PayloadEstimate | None = None
        self._candidate: PayloadEstimate | None = None
        self._weight = self._departure = self._trust = 1.0
        self._share = AppliedShare()
        self._behind: list[float] | None = None
        self._place: list[float] | None = None
        self._rest_s = self._counts = 0.0
        self.followed: Load | None = None

    def limit(self, settings: SupervisorSettings) -> Thresholds:
        """Return by how much another load departs at least, at rest."""
        force = max(settings.limit.force, self.scatter.force)
        return Thresholds(force, max(settings.limit.moment, self.scatter.moment))

    def rows(
        self, scales: Scales, settings: SupervisorSettings, reach: float
    ) -> tuple[Array, NDArray[np.int64]]:
        """Return what compiled rules need, and the stamps of last command and state (2,) [ns].

        `settings`: as of `Supervisor.judge`; `reach`: as there [rad].
        """
        expected = None if self._expected is None else scales.estimate(self._expected)
        share, of_wrist = self._share, scales.geometry.limits
        row = [
            *(JUDGE_S, SETTLE_S, LATE_S, LONGEST_STEP_S, RAMP_S, YIELD_S),
            *(CALM, OPEN, SIGMAS, ENOUGH, settings.follow, settings.trust),
            *(
                *self.limit(settings),
                reach,
                of_wrist.encoder_step,
                of_wrist.moment,
                *scales.constants,
            ),
            *(STATES.index(self._state), STATES.index(self._seen), TEXTS.index(self._text)),
            *(self._told, self._seen_s, self._step_s, self._candidate_s, self._rest_s),
            *(self._counts, self._weight, self._departure, self._trust, share.value, share.sure),
            *(*_known(share.against, 3), *_known(share.place, 2)),
            *(*_known(self._behind, 2), *_known(self._place, 2)),
        ]
        for payload in (self._payload, self._candidate, expected):
            row += _known(None if payload is None else payload.row, 11)
        return np.array([*row, 0.0]), np.array([self._stamp_ns, self._since_ns], dtype=np.int64)

    def take_over(self, row: Array, stamps: NDArray[np.int64]) -> bool:
        """Believe what compiled rules left, and tell whether they judged the last command.

        `row`, `stamps` (SUPERVISOR,) float, (2,) int: from `rows`.
        """
        self._stamp_ns, self._since_ns = stamps.tolist()
        values = iter(row[RULES:].tolist())
        state, seen, text, told = (int(next(values)) for _ in range(4))
        self._state, self._seen, self._text = STATES[state], STATES[seen], TEXTS[text]
        self._told = bool(told)
        self._seen_s, self._step_s, self._candidate_s, self._rest_s = _take(values, 4)
        self._counts, self._weight, self._departure, self._trust = _take(values, 4)
        share = self._share
        share.value, share.sure = next(values), bool(next(values))
        against, share.place = _found(values, 3), _found(values, 2)
        share.against = None if against is None else (against[0], against[1], against[2])
        self._behind, self._place = _found(values, 2), _found(values, 2)
        payload, candidate, expected = (_found(values, 11) for _ in range(3))
        self._payload = None if payload is None else PayloadEstimate.of_row(payload)
        self._candidate = None if candidate is None else PayloadEstimate.of_row(candidate)
        if expected is None:
            self._expected = None
        self.followed = None
        return bool(next(values))


RULES = 17 + 10
"""Numbers of `Belief.rows` before what is believed: settings and scales."""


def _known(numbers: Sequence[float] | None, count: int) -> list[float]:
    """Return numbers behind whether they are there."""
    return [0.0] * (1 + count) if numbers is None else [1.0, *numbers]


def _take(values: Iterator[float], count: int) -> list[float]:
    return [next(values) for _ in range(count)]


def _found(values: Iterator[float], count: int) -> list[float] | None:
    known, *numbers = _take(values, 1 + count)
    return numbers if known else None
