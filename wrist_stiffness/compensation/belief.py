"""What a supervisor believes of the load; for blocks of commands it goes in and out as one row.

The compiled rules (`mechanism/native/supervisor.c`) are those of `supervisor.py`, to the bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.payload import (
    ENOUGH,
    SIGMAS,
    Payload,
    PayloadEstimate,
    Row,
    Thresholds,
)
from wrist_stiffness.compensation.scales import Scales
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Load


class State(Enum):
    """What is believed of the load, by the operators' names."""

    UNSURE = "unsure"
    FREE = "free"
    HOLDING = "holding"
    IN_CONTACT = "in contact"
    RELEASED = "released"


@dataclass(frozen=True)
class SupervisorSettings:
    """What counts as another load, and how far the model is trusted beside obstacles."""

    # a load that departs by less is the same load.  Never below five times the scatter that the
    # tare found
    limit: Thresholds = Thresholds(0.05, 0.002)
    # the wrist may be so many times stiffer or softer than the model, 1 or more [-]
    model_doubt: float = 2.0
    # correct for every load as it is measured, and in full.  Only where it cannot be a contact
    follow: bool = False

    @property
    def trust(self) -> float:
        """Part of the predicted correction that never goes past the aim [-].

        Of an error e a model that is r times too soft predicts r e, and a part c of that leaves
        (1 - c r) e.  With c = 1/q that stays between 0 and e for all r from 1/q to q: the platform
        comes nearer to its aim and never gets past it.  Past the aim it could leave an obstacle
        that bears a part of the error without correction, and would be farther off than that; no
        sensor would see it, for nothing touches any more.
        """
        return 1.0 if self.follow else 1.0 / self.model_doubt


@dataclass(frozen=True)
class Supervision:
    """What the supervisor believed at a moment."""

    state: State  # by the operators' names
    text: str  # why the correction is restricted; empty where it is not
    payload: Payload | None  # what is corrected for
    told: bool  # whether the gripper told that payload
    # part of the correction that is applied, of what the model is trusted with; below 1 where it
    # yielded to a contact or is not certain [-]
    share: float
    valid: bool  # whether the load is known and corrected for, so that the residual holds
    # `stamp_ns`, `since_ns`: of the last command, and of the one at which the state began [ns]
    stamp_ns: int
    since_ns: int


RAMP_S = 1.0
"""A correction comes in over this time, and goes where nobody knows what is carried [s]."""

YIELD_S = 0.1
"""A correction that a contact works against is gone after this time, in which the default
slew limit takes back 50 mdeg [s]."""


class AppliedShare:
    """Part of a correction that is applied.

    While the moment of a contact works against the correction's turn, the part falls towards none.
    It comes back when the command has left that place, never before, so that nothing can oscillate.
    """

    def __init__(self) -> None:
        self.value = 1.0  # [-]
        # whether it is known what is carried; where it is not, the correction fades
        self.sure = False
        # (3,), moment of a contact, along u, v and down; None where there is none [N m]
        self.against: Row | None = None
        self.place: list[float] | None = None  # (2,), command at which the correction yielded [rad]

    @property
    def settled(self) -> bool:
        """Whether all is applied whatever the correction, and goes on to be."""
        return self.against is None and self.sure and self.value == 1.0

    def leave(self, theta: list[float], reach: float) -> None:
        """Hear of a command (2,) [rad]; one farther than `reach` [rad] has left the place."""
        if self.place is not None and apart(theta, self.place) > reach:
            self.place = None

    def after(self, seconds: float, turn: Row) -> float:
        """Let time [s] pass with a correction that turns the platform by (3,), along u, v, down."""
        if self.against is not None and _dot(self.against, turn) < 0.0:
            self.value = max(0.0, self.value - seconds / YIELD_S)
        elif not self.sure:
            self.value = max(0.0, self.value - seconds / RAMP_S)
        elif self.against is None and self.place is None:
            self.value = min(1.0, self.value + seconds / RAMP_S)
        return self.value


def apart(theta: list[float], other: list[float]) -> float:
    """Return how far two commands (2,) are apart, the larger of both motors [rad]."""
    return max(abs(theta[0] - other[0]), abs(theta[1] - other[1]))


def _dot(a: Row, b: Row) -> float:
    # Not `sum`, which rounds otherwise from Python 3.12 on.
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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
