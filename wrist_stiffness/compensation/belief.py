"""What a supervisor believes of the load.

The compiled rules (`mechanism/native/supervisor.c`) are those of `supervisor.py`, to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import Structure, c_double
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from wrist_stiffness.compensation.payload import (
    ENOUGH,
    SIGMAS,
    Payload,
    PayloadEstimate,
    Thresholds,
)
from wrist_stiffness.compensation.scales import Scales
from wrist_stiffness.mechanism.compiled import CompiledSupervisor, Flags
from wrist_stiffness.model.block import Load


class State(Enum):
    """What is believed of the load, by the operators' names."""

    UNSURE = "unsure"
    FREE = "free"
    HOLDING = "holding"
    IN_CONTACT = "in contact"
    RELEASED = "released"
    FOLLOWED = "followed"


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
    """What the supervisor believes, to be shown."""

    state: State  # by the operators' names
    text: str  # why the correction is restricted; empty where it is not
    payload: Payload | None  # what is corrected for
    told: bool  # whether the gripper told that payload
    # part of the correction that is applied, of what the model is trusted with; below 1 where it
    # yielded to a contact or is not certain [-]
    share: float
    valid: bool  # whether the load is known and corrected for, so that the residual holds


RAMP_S = 1.0
"""A correction comes in over this time, and goes where nobody knows what is carried [s]."""

YIELD_S = 0.1
"""A correction that a contact works against is gone after this time, in which the default
slew limit takes back 50 mdeg [s]."""


def apart(theta: Sequence[float], other: Sequence[float]) -> float:
    """Return how far two commands (2,) are apart, the larger of both motors [rad]."""
    return max(abs(theta[0] - other[0]), abs(theta[1] - other[1]))


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
TOUCHED_HERE = (
    "there was a contact at this place: the load is judged again once the command has moved by "
    "correction_limit_deg"
)

TEXTS = ("", NO_LOAD, NEW_WEIGHT, NO_WEIGHT, TOUCHED_HERE)

STATES = tuple(State)
UNSURE, FREE, HOLDING, IN_CONTACT, RELEASED, FOLLOWED = range(len(STATES))


def _numbers(names: str) -> list[tuple[str, type[c_double]]]:
    return [(name, c_double) for name in names.split()]


class Belief(Structure):
    """What is kept from command to command, `Supervisor` of `wrist.h`: Python and C go on from it.

    `followed`: the last load that was followed as it was measured.
    """

    _fields_: ClassVar[Sequence[Any]] = [
        *[("rules", c_double * 17), ("axes", c_double * 10)],  # see `compiled`
        # `state`, `seen`: places in `STATES`; `text`: in `TEXTS`
        *_numbers("state seen text told seen_s step_s candidate_s rest_s counts"),
        *_numbers("weight departure trust"),
        # Which part of a correction is applied [-], and whether it is known what is carried.
        *_numbers("part sure"),
        # Moment of a contact, along u, v and down [N m]; whether there is one stands before it.
        *[("is_against", c_double), ("against", c_double * 3)],
        # Commands, likewise: where the correction yielded, one that comes after with a delay, and
        # where the command has stayed [rad].
        *[("yielded", c_double), ("place", c_double * 2)],
        *[("moves", c_double), ("behind", c_double * 2)],
        *[("stands", c_double), ("stand", c_double * 2)],
        *[(name, PayloadEstimate) for name in ("payload", "candidate", "expected")],
        ("judged", c_double),  # whether the command at which the compiled loop ended was judged
    ]
    told: float
    rest_s: float
    moves: float
    behind: Sequence[float]
    stands: float
    stand: Sequence[float]
    payload: PayloadEstimate
    candidate: PayloadEstimate

    def __init__(self) -> None:
        super().__init__()
        self._row = np.frombuffer(self)  # type: ignore[call-overload]
        self.stamps = np.zeros(2, dtype=np.int64)  # of last command and state [ns]
        self.scatter = Thresholds(0.0, 0.0)  # the least thresholds, from the noise of the load
        self._scales: Scales | None = None
        self._expected: Payload | None = None
        self.forget()

    def forget(self) -> None:
        """Judge anew; what the gripper told still stands."""
        told = self.told
        self._row[:] = 0.0
        self.stamps[:] = 0
        self.told, self.text = told, TEXTS.index(NO_LOAD)
        self.weight = self.departure = self.trust = self.part = 1.0
        self.followed: Load | None = None

    def limit(self, settings: SupervisorSettings) -> Thresholds:
        """Return by how much another load departs at least, at rest."""
        force = max(settings.limit.force, self.scatter.force)
        return Thresholds(force, max(settings.limit.moment, self.scatter.moment))

    def compiled(
        self, scales: Scales, settings: SupervisorSettings, reach: float, valid: Flags
    ) -> CompiledSupervisor:
        """Return itself for the compiled rules, which change it.

        `settings`, `reach`: as of `Supervisor.judge`; `valid` (n,): see `CompiledSupervisor`.
        """
        of_wrist = scales.geometry.limits
        self.rules = (
            *(JUDGE_S, SETTLE_S, LATE_S, LONGEST_STEP_S, RAMP_S, YIELD_S),
            *(CALM, OPEN, SIGMAS, ENOUGH, settings.follow, settings.trust),
            *(*self.limit(settings), reach, of_wrist.encoder_step, of_wrist.moment),
        )
        self.axes = tuple(scales.constants)
        expected = self._expected
        self.expected = PayloadEstimate() if expected is None else scales.estimate(expected)
        return CompiledSupervisor(self._row, self.stamps, valid)

    def go_on(self) -> bool:
        """Go on from what compiled rules left, and tell whether they judged the last command."""
        self.followed = None
        if not self.expected.known:
            self._expected = None
        return bool(self.judged)
