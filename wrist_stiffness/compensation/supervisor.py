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

A weight that stays the same for `SETTLE_S` becomes the payload, and its correction comes in slowly.
That is the experiment that tells it from a contact: a weight does not mind a correction, the load
of a contact changes with it.  Then it is a contact, and no payload.  Which part of the correction
is applied says `AppliedShare`: less where a contact works against it, and all of it only as far
as the model is trusted (`SupervisorSettings.trust`).

For the nodes: `declare_payload(Payload | None)` is what a gripper tells, `forget()` begins anew,
`supervision` is what is believed, to be shown and stored, `restore(payload)` expects a stored
payload: it counts once the load agrees.
"""

from __future__ import annotations

from copy import copy

from wrist_stiffness.compensation.belief import (
    CALM,
    CHANGES,
    JUDGE_S,
    LATE_S,
    LONGEST_STEP_S,
    NEW_WEIGHT,
    NO_LOAD,
    NO_WEIGHT,
    OPEN,
    RAMP_S,
    SETTLE_S,
    Belief,
    State,
    Supervision,
    SupervisorSettings,
    apart,
)
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.payload import Payload, PayloadEstimate, Reading, Thresholds
from wrist_stiffness.compensation.scales import Held, Scales
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.block import Load

COMING_IN = "the correction is coming in"
YIELDED = "the correction yielded to a contact, and comes back when the command leaves this place"

TRUSTED = (State.FREE, State.HOLDING)
UNKNOWN = (State.UNSURE, State.IN_CONTACT)

TEXT_OF = {State.UNSURE: NEW_WEIGHT, State.IN_CONTACT: NO_WEIGHT}


class Supervisor(Belief):
    """The state machine of one corrector.  Blocks of commands go through its compiled twin."""

    def declare_payload(self, payload: Payload | None) -> None:
        """Take over what the gripper tells.

        `payload`: counts as soon as the load agrees; None where the gripper holds nothing.
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
        self._expect()
        if self._state is not State.UNSURE:
            self._enter(State.UNSURE)
        self._text = NO_LOAD

    def overloaded(self, stamp_ns: int, theta: list[float]) -> None:
        """Hear of a load beyond the table at a command (2,) [rad]: a contact that all yields to."""
        self._begin(stamp_ns)
        self._expect()
        if self._state is not State.IN_CONTACT:
            self._enter(State.IN_CONTACT)
        self._payload, self._weight = None, 1.0
        self._seen, self._seen_s = State.IN_CONTACT, 0.0
        share = self._share
        share.value, share.sure, share.place, share.against = 0.0, False, theta, None

    def _expect(self) -> None:
        """Let the payload count again once the load agrees."""
        if self._payload is not None and self._scales is not None:
            self._expected = self._scales.payload(self._payload)

    @property
    def supervision(self) -> Supervision:
        """What is believed at present."""
        payload, text = None, self._text
        if self._payload is not None and self._scales is not None:
            payload = self._scales.payload(self._payload)
        if self._state not in UNKNOWN:
            coming = self._weight < 1.0 or self._share.value < 1.0
            text = YIELDED if self._share.place else COMING_IN if coming else ""
        return Supervision(
            self._state,
            text,
            payload,
            self._told and payload is not None,
            self._share.value,
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
        """Whether the load is known and corrected for, all that the model is trusted with."""
        return self._state not in UNKNOWN and self._share.value == 1.0 and self._weight == 1.0

    def scales(self, geometry: Geometry) -> Scales:
        """Return what weighs on a wrist."""
        if self._scales is None or self._scales.geometry is not geometry:
            self._scales = Scales(geometry)
        return self._scales

    def follow(self, stamp_ns: int, measured: Load) -> None:
        """Take a load as it is measured for the payload."""
        self._begin(stamp_ns)
        self._trust, self.followed = 1.0, measured
        self._state, self._share.against, self._share.sure = State.FREE, None, True

    def judge(
        self,
        stamp_ns: int,
        theta: list[float],
        reading: Reading,
        settings: SupervisorSettings,
        reach: float,
    ) -> tuple[float, ...] | None:
        """Return the load to correct for.

        `stamp_ns`: of the command [ns]; `theta`: commanded motor angles [rad]; `reading`: of the
        tared load, from `scales`; `settings`: thresholds, and how far the model is trusted;
        `reach`: a command that has moved by this has left the place of a contact: the largest
        correction [rad].  Gives (6,): at O in F [N, N m]; None for no load.
        """
        self._begin(stamp_ns)
        self._trust = settings.trust
        self._share.leave(theta, reach)
        self._rest(theta)
        limit = self.limit(settings)
        known = limit.wider(reading, self._turned(theta))
        # What a motion turns is turned by the same all along it: so much less it says anew.
        self._counts = self._step_s / LATE_S * limit.moment / known.moment
        self._look(reading, known)
        if self._seen is State.IN_CONTACT:
            self._feel(theta, reading, known)
        elif self._seen is State.UNSURE and self._state is State.UNSURE:
            self._weigh(reading, known)
        elif self._seen is State.HOLDING and self._state is State.HOLDING:
            self._weight = min(1.0, self._weight + self._step_s / RAMP_S)
        if self._payload is None or self._scales is None:
            return None
        return self._scales.load(self._payload, reading.rows, self._weight)

    def _begin(self, stamp_ns: int) -> None:
        last_ns, self._stamp_ns = self._stamp_ns or stamp_ns, stamp_ns
        self._step_s = min(max(stamp_ns - last_ns, 0) / NANOSECONDS, LONGEST_STEP_S)
        self.followed = None

    def held(self, settings: SupervisorSettings) -> Held:
        """Return what is held now, in full, for plans: it stays that, whatever is judged later."""
        return Held(
            self._scales,
            copy(self._payload),
            self.followed,
            self._trust * self._share.value,
            self.valid,
            self.limit(settings).moment,
        )

    @property
    def settled(self) -> float | None:
        """What `share` says whatever the correction, and goes on saying; else None."""
        return self._trust if self._share.settled else None

    def share(self, turn: list[float]) -> float:
        """Return the part of a correction to apply.

        Less where a contact works against it, and where it is not known what the platform carries.

        `turn` (list of 3 float): by which the correction turns the platform, in F [rad].
        """
        along = (0.0, 0.0, 0.0) if self._scales is None else self._scales.along(turn)
        return self._trust * self._share.after(self._step_s, along)

    def _rest(self, theta: list[float]) -> None:
        """Note for how long the command has stayed where it is, to an encoder step."""
        self._rest_s += self._step_s
        step = self._scales.geometry.limits.encoder_step if self._scales else 0.0
        if self._place is None or apart(theta, self._place) > step:
            self._place, self._rest_s = theta, 0.0

    def _turned(self, theta: list[float]) -> float:
        """Return by how much the command has turned within about `LATE_S` [rad]."""
        first, second = self._behind or theta
        share = self._step_s / (LATE_S + self._step_s)
        self._behind = [first + share * (theta[0] - first), second + share * (theta[1] - second)]
        return apart(theta, self._behind)

    def _look(self, reading: Reading, limit: Thresholds) -> None:
        """See what the load looks like, and believe it when it has looked like that for a while."""
        in_contact = self._state is State.IN_CONTACT
        seen = self._seeming(reading, limit.times(CALM) if in_contact else limit)
        self._seen_s = self._seen_s + self._step_s * self._departure if seen is self._seen else 0.0
        self._seen = seen
        patience = SETTLE_S if seen in TRUSTED else JUDGE_S
        if self._weight < 1.0 and seen is not State.HOLDING:
            # While its correction comes in, a payload that is none shows at once.
            patience = 0.0
        if seen is not self._state and self._seen_s >= patience:
            self._enter(seen)

    def _seeming(self, reading: Reading, limit: Thresholds) -> State:
        """Return what a load looks like, and by how many thresholds it is not what is believed."""
        self._share.against, self._departure = None, 1.0
        payload = self._payload
        if payload is not None and payload.explains(reading, limit, self._counts):
            return State.HOLDING
        nothing = reading.size(limit) <= 1.0
        if nothing and payload is None:
            return State.FREE
        rest = reading if payload is None else payload.rest(reading)
        if nothing or self._state not in UNKNOWN:
            self._departure = max(1.0, rest.size(limit))
        elif self._state is State.UNSURE:
            self._departure = max(1.0, reading.aside(limit))
        if nothing:
            return State.RELEASED
        if reading.is_weight(limit) and self._weight == 1.0:
            return State.UNSURE
        self._share.against = rest.moments
        return State.IN_CONTACT

    def _enter(self, state: State) -> None:
        if state is State.UNSURE or state is State.RELEASED:
            self._payload, self._weight = None, 1.0
        if state is State.RELEASED:
            self._expected = None
        if state is not State.IN_CONTACT:
            self._share.sure = state is not State.UNSURE
        elif self._payload is not None and self._rest_s > LATE_S:
            # A wall does not come by itself: something else than the motion changed.
            self._payload, self._weight, self._share.sure = None, 1.0, False
        self._candidate = None
        self._state, self._since_ns = state, self._stamp_ns
        self._text = TEXT_OF.get(state, "")

    def _feel(self, theta: list[float], reading: Reading, limit: Thresholds) -> None:
        """Look again at what is held: whether the contact is its own, and it is still there."""
        if self._share.value < 1.0 or self._weight < 1.0:
            self._share.place = theta
        if self._state is State.IN_CONTACT and self._payload is not None:
            if self._weight < 1.0:
                self._payload, self._weight, self._text = None, 1.0, CHANGES
            elif not self._stands(self._payload, reading, limit):
                self._payload = None
            self._share.sure = self._payload is not None

    @staticmethod
    def _stands(payload: PayloadEstimate, reading: Reading, limit: Thresholds) -> bool:
        """Tell whether a payload may stand in for the load of a contact.

        Only where the load is nearer to it than to nothing, and its moment at this pose is known.
        """
        known = payload.open_moment(reading.rows) <= OPEN * limit.moment
        return known and payload.rest(reading).size(limit) < reading.size(limit)

    def _weigh(self, reading: Reading, limit: Thresholds) -> None:
        """Make a weight that stays the payload, unless it was found to be a contact here."""
        scales = self._scales
        if scales is None:
            return
        if self._candidate is None or not self._candidate.explains(reading, limit, self._counts):
            self._candidate, self._candidate_s = scales.unknown(reading), 0.0
        self._candidate_s += self._step_s
        if self._candidate_s < SETTLE_S:
            return
        expected = None if self._expected is None else scales.estimate(self._expected)
        if expected is not None and not expected.explains(reading, limit, self._counts):
            expected = None
        if self._share.place is not None:
            self._text = CHANGES
        elif not reading.is_weight(limit.times(CALM)):
            self._text = NO_WEIGHT
        else:
            if expected is None:
                self._expected, self._told = None, False
            self._payload, self._weight = expected or self._candidate, 0.0
            self._enter(State.HOLDING)
