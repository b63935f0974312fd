"""Judges the load: what of it is a payload, to be corrected for, and what is a contact.

A correction that follows a contact is feedback, with the loop gain (assumed compliance) / (true
compliance + 1/K_env).  So no measured load is followed.  What is corrected for is a payload, a
weight at a fixed point of the platform (`payload.py`), recognised or told, and nothing else:
it does not change with the motion, so there is no loop.

    unsure      no load yet, or a weight that is still being judged: the correction fades out
    free        no load: corrected for the wrist itself
    holding     the load is that of the payload: corrected for it
    in contact  a force or couple besides, that is no weight: corrected for the payload alone;
                where that is not known any more the correction fades out
    released    the payload's load is gone: corrected for no load

A weight that stays the same for `SETTLE_S` becomes the payload, and its correction comes in over
`RAMP_S`.  That is the experiment that tells it from a contact: a weight does not mind a correction,
the load of a contact changes with it.  Then it is a contact, and no payload.

In contact the correction yields: while the contact's moment works against the correction's turn,
its share falls towards none.  It comes back when the command has left that place, never before, so
that nothing can oscillate.

For the nodes, on `CorrectionStream`: `declare_payload(Payload | None)` is what a gripper tells,
`forget()` begins anew, `tare()` makes the present load zero, `supervision` is a `Supervision` to be
shown and stored, `restore(payload)` expects a stored payload: it counts once the load agrees.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from enum import Enum
from operator import mul

import numpy as np

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.payload import (
    Held,
    Payload,
    PayloadEstimate,
    Reading,
    Row,
    Scales,
    Thresholds,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.error_model import Load

JUDGE_S = 0.1
"""A contact, a release or a new weight is believed after this time [s] ..."""

SETTLE_S = 0.5
"""... and what allows more correction after this: no part swings or is being lifted then [s]."""

RAMP_S = 1.0
"""A correction comes in over this time, and goes where nobody knows what is carried [s]."""

LATE_S = 0.2
"""So late a load may be, and the motors behind their command: as much as the platform turns in this
time, a load may seem turned [s]."""

YIELD_S = 0.1
"""A correction that a contact works against is gone after this time, in which the default
slew limit takes back 50 mdeg [s]."""

CALM = 0.5
"""A contact ends and a weight becomes the payload within this part of the thresholds, so that noise
does not undo it."""

OPEN = 10.0
"""In contact a payload stands in only where its moment is known to this many thresholds."""

LONGEST_STEP_S = 0.1
"""A pause between commands counts as this much."""

NO_LOAD = "no load is known"
NO_WEIGHT = "the load is no weight: a contact, or the sensor is not tared"
CHANGES = "the load changes with the correction: a contact"
NEW_WEIGHT = "a weight that was not there before is being judged"
COMING_IN = "the correction is coming in"
YIELDED = "the correction yielded to a contact, and comes back when the command leaves this place"


class State(Enum):
    """What is believed of the load, by the operators' names."""

    UNSURE = "unsure"
    FREE = "free"
    HOLDING = "holding"
    IN_CONTACT = "in contact"
    RELEASED = "released"


TRUSTED = (State.FREE, State.HOLDING)

TEXTS = {State.UNSURE: NEW_WEIGHT, State.IN_CONTACT: NO_WEIGHT}


@dataclass(frozen=True)
class SupervisorSettings:
    """What counts as another load.

    Parameters
    ----------
    limit : Thresholds
        A load that departs by less is the same load.  Never below five times the scatter that the
        tare found.
    follow : bool
        Correct for every load as it is measured.  Only where it cannot be a contact.
    """

    limit: Thresholds = Thresholds(0.05, 0.002)
    follow: bool = False


@dataclass(frozen=True)
class Supervision:
    """What the supervisor believed at a moment.

    Parameters
    ----------
    state : State
        By the operators' names.
    text : str
        Why the correction is restricted; empty where it is not.
    payload : Payload or None
        What is corrected for.
    told : bool
        Whether the gripper told that payload.
    share : float
        Part of the correction that is applied; below 1 where it yielded to a contact [-].
    valid : bool
        Whether the load is known and corrected for in full, so that the residual holds.
    stamp_ns, since_ns : int
        Of the last command, and of the one at which the state began [ns].
    """

    state: State
    text: str
    payload: Payload | None
    told: bool
    share: float
    valid: bool
    stamp_ns: int
    since_ns: int


class Supervisor:
    """The state machine of one corrector.

    Attributes
    ----------
    scatter : Thresholds
        The least thresholds, from the noise of the load.
    """

    def __init__(self) -> None:
        self.scatter = Thresholds(0.0, 0.0)
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
        self._weight = self._share = 1.0
        self._sure = False
        self._touched: list[float] | None = None
        self._behind: list[float] | None = None
        self._against: Row | None = None
        self._followed: Load | None = None

    def declare_payload(self, payload: Payload | None) -> None:
        """Take over what the gripper tells.

        Parameters
        ----------
        payload : Payload or None
            Counts as soon as the load agrees; None where the gripper holds nothing.
        """
        if self._payload is not None:
            self._enter(State.RELEASED if payload is None else State.UNSURE)
        self._expected, self._told = payload, payload is not None

    def restore(self, payload: Payload | None) -> None:
        """Begin anew and expect a payload that was stored: it counts as soon as the load agrees."""
        self.forget()
        self._expected, self._told = payload, False

    def lost(self) -> None:
        """Hear that no load is known: the payload must be seen again."""
        if self._payload is not None and self._scales is not None:
            self._expected = self._scales.payload(self._payload)
        if self._state is not State.UNSURE:
            self._enter(State.UNSURE)
        self._text = NO_LOAD

    @property
    def supervision(self) -> Supervision:
        """What is believed at present."""
        payload, text = None, self._text
        if self._payload is not None and self._scales is not None:
            payload = self._scales.payload(self._payload)
        if self._known:
            coming = self._weight < 1.0 or self._share < 1.0
            text = YIELDED if self._touched else COMING_IN if coming else ""
        return Supervision(
            self._state,
            text,
            payload,
            self._told and payload is not None,
            self._share,
            self.valid,
            self._stamp_ns,
            self._since_ns,
        )

    @property
    def since_ns(self) -> int:
        """Stamp of the command at which the state began [ns]."""
        return self._since_ns

    @property
    def valid(self) -> bool:
        """Whether the load is known and corrected for in full."""
        return self._known and self._share == 1.0 and self._weight == 1.0

    @property
    def _known(self) -> bool:
        return self._state is not State.UNSURE and self._state is not State.IN_CONTACT

    def judge(
        self,
        stamp_ns: int,
        theta: list[float],
        measured: Load,
        rotation: Array,
        geometry: Geometry,
        settings: SupervisorSettings,
        reach: float,
    ) -> Load:
        """Return the load to correct for.

        Parameters
        ----------
        stamp_ns : int
            Of the command [ns].
        theta : list of 2 float
            Commanded motor angles [rad].
        measured : Load
            Tared.
        rotation : (3, 3) float
            U -> F of the platform at the command.
        geometry : Geometry
            Of the wrist.
        settings : SupervisorSettings
            Thresholds.
        reach : float
            A command that has moved by this has left the place of a contact: the largest
            correction [rad].

        Returns
        -------
        Load
            In F, or as measured where every load is followed.
        """
        last_ns, self._stamp_ns = self._stamp_ns or stamp_ns, stamp_ns
        self._step_s = min(max(stamp_ns - last_ns, 0) / NANOSECONDS, LONGEST_STEP_S)
        self._followed = measured if settings.follow else None
        if self._followed is not None:
            self._state, self._against, self._sure = State.FREE, None, True
            return self._followed
        scales = self._scales
        if scales is None or scales.geometry is not geometry:
            scales = self._scales = Scales(geometry)
        wrench = measured.wrench
        if measured.on_platform:
            wrench = np.concatenate([rotation.dot(wrench[:3]), rotation.dot(wrench[3:])])
        reading = scales.read(wrench.tolist(), rotation.tolist())
        limit = Thresholds(
            max(settings.limit.force, self.scatter.force),
            max(settings.limit.moment, self.scatter.moment),
        )
        if self._touched is not None and _apart(theta, self._touched) > reach:
            self._touched = None
        known = limit.wider(reading, self._turned(theta))
        self._look(reading, known)
        if self._seen is State.IN_CONTACT:
            self._feel(theta, reading, known)
        elif self._seen is State.UNSURE and self._state is State.UNSURE:
            self._weigh(reading, known, scales)
        elif self._seen is State.HOLDING and self._state is State.HOLDING:
            self._weight = min(1.0, self._weight + self._step_s / RAMP_S)
        if self._payload is None:
            return Load(np.zeros(6))
        return scales.load(self._payload, reading.rows, self._weight)

    def held(self) -> Held:
        """Return what is held now, in full, for plans: it stays that, whatever is judged later."""
        return Held(self._scales, copy(self._payload), self._followed, self._share, self.valid)

    @property
    def undisturbed(self) -> bool:
        """Whether `share` is 1 whatever the correction, and stays so."""
        return self._against is None and self._share == 1.0

    def share(self, turn: Array) -> float:
        """Return the part of a correction to apply.

        Less where a contact works against it, and where it is not known what the platform carries.

        Parameters
        ----------
        turn : (3,) float
            By which the correction turns the platform, in F [rad].
        """
        if self._against is not None and self._scales is not None:
            if sum(map(mul, self._against, self._scales.along(turn.tolist()))) < 0.0:
                self._share = max(0.0, self._share - self._step_s / YIELD_S)
        elif not self._sure:
            self._share = max(0.0, self._share - self._step_s / RAMP_S)
        elif self._touched is None:
            self._share = min(1.0, self._share + self._step_s / RAMP_S)
        return self._share

    def _turned(self, theta: list[float]) -> float:
        """Return by how much the command has turned within about `LATE_S` [rad]."""
        first, second = self._behind or theta
        share = self._step_s / (LATE_S + self._step_s)
        self._behind = [first + share * (theta[0] - first), second + share * (theta[1] - second)]
        return _apart(theta, self._behind)

    def _look(self, reading: Reading, limit: Thresholds) -> None:
        """See what the load looks like, and believe it when it has looked like that for a while."""
        in_contact = self._state is State.IN_CONTACT
        seen = self._seeming(reading, limit.times(CALM) if in_contact else limit)
        self._seen_s = self._seen_s + self._step_s if seen is self._seen else 0.0
        self._seen = seen
        patience = SETTLE_S if seen in TRUSTED else JUDGE_S
        if self._weight < 1.0 and seen is not State.HOLDING:
            # While its correction comes in, a payload that is none shows at once.
            patience = 0.0
        if seen is not self._state and self._seen_s >= patience:
            self._enter(seen)

    def _seeming(self, reading: Reading, limit: Thresholds) -> State:
        self._against = None
        payload = self._payload
        if payload is not None and payload.explains(reading, limit):
            return State.HOLDING
        if reading.size(limit) <= 1.0:
            return State.FREE if payload is None else State.RELEASED
        if reading.is_weight(limit) and self._weight == 1.0:
            return State.UNSURE
        self._against = (reading if payload is None else payload.rest(reading)).moments
        return State.IN_CONTACT

    def _enter(self, state: State) -> None:
        if state is State.UNSURE or state is State.RELEASED:
            self._payload, self._weight = None, 1.0
        if state is State.RELEASED:
            self._expected = None
        if state is not State.IN_CONTACT:
            self._sure = state is not State.UNSURE
        self._candidate = None
        self._state, self._since_ns = state, self._stamp_ns
        self._text = TEXTS.get(state, "")

    def _feel(self, theta: list[float], reading: Reading, limit: Thresholds) -> None:
        """Look again at what is held: whether the contact is its own, and it is still there."""
        if self._share < 1.0 or self._weight < 1.0:
            self._touched = theta
        if self._state is State.IN_CONTACT and self._payload is not None:
            if self._weight < 1.0:
                self._payload, self._weight, self._text = None, 1.0, CHANGES
            elif not self._stands(self._payload, reading, limit):
                self._payload = None
            self._sure = self._payload is not None

    @staticmethod
    def _stands(payload: PayloadEstimate, reading: Reading, limit: Thresholds) -> bool:
        """Tell whether a payload may stand in for the load of a contact.

        Only where the load is nearer to it than to nothing, and its moment at this pose is known.
        """
        known = payload.open_moment(reading.rows) <= OPEN * limit.moment
        return known and payload.rest(reading).size(limit) < reading.size(limit)

    def _weigh(self, reading: Reading, limit: Thresholds, scales: Scales) -> None:
        """Make a weight that stays the payload, unless it was found to be a contact here."""
        if self._candidate is None or not self._candidate.explains(reading, limit):
            self._candidate, self._candidate_s = scales.unknown(reading), 0.0
        self._candidate_s += self._step_s
        if self._candidate_s < SETTLE_S:
            return
        expected = None if self._expected is None else scales.estimate(self._expected)
        if expected is not None and not expected.explains(reading, limit):
            expected = None
        if self._touched is not None:
            self._text = CHANGES
        elif not reading.is_weight(limit.times(CALM)):
            self._text = NO_WEIGHT
        else:
            if expected is None:
                self._expected, self._told = None, False
            self._payload, self._weight = expected or self._candidate, 0.0
            self._enter(State.HOLDING)


def _apart(theta: list[float], other: list[float]) -> float:
    return max(abs(theta[0] - other[0]), abs(theta[1] - other[1]))
