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
    followed    `load_policy` follow: nothing is judged, corrected for every load as it is measured

A weight that stays the same for `SETTLE_S` becomes the payload, and its correction comes in slowly.
That is the experiment that tells it from a contact: a weight does not mind a correction, the load
of a contact changes with it.  Then it is a contact, and no payload.  Which part of the correction
is applied says `share`: less where a contact works against it, and all of it only as far as the
model is trusted (`SupervisorSettings.trust`).

For the nodes: `declare_payload(Payload | None)` is what a gripper tells, `forget()` begins anew,
`supervision` is what is believed.
"""

from __future__ import annotations

from collections.abc import Sequence

from wrist_stiffness.compensation.belief import (
    CALM,
    FOLLOWED,
    FREE,
    HOLDING,
    IN_CONTACT,
    JUDGE_S,
    LATE_S,
    LONGEST_STEP_S,
    NEW_WEIGHT,
    NO_LOAD,
    NO_WEIGHT,
    OPEN,
    RAMP_S,
    RELEASED,
    SETTLE_S,
    STATES,
    TEXTS,
    TOUCHED_HERE,
    UNSURE,
    YIELD_S,
    Belief,
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
YIELDED = (
    "the correction yielded to a contact, and comes back once the command has moved by "
    "correction_limit_deg"
)

TRUSTED = (FREE, HOLDING)
UNKNOWN = (UNSURE, IN_CONTACT)

TEXT_OF = {UNSURE: NEW_WEIGHT, IN_CONTACT: NO_WEIGHT}


class Supervisor(Belief):
    """The state machine of one corrector.  Blocks of commands go through its compiled twin."""

    def declare_payload(self, payload: Payload | None) -> None:
        """Take over what the gripper tells.

        `payload`: counts as soon as the load agrees; None where the gripper holds nothing.
        """
        if self.payload.known:
            self._enter(RELEASED if payload is None else UNSURE)
        self._expected, self.told = payload, payload is not None

    def lost(self) -> None:
        """Hear that no load is known: the payload must be seen again."""
        self._expect()
        if self.state != UNSURE:
            self._enter(UNSURE)
        self.text = TEXTS.index(NO_LOAD)

    def overloaded(self, stamp_ns: int, theta: Sequence[float]) -> None:
        """Hear of a load beyond the table at a command (2,) [rad]: a contact that all yields to."""
        self._begin(stamp_ns)
        self._expect()
        if self.state != IN_CONTACT:
            self._enter(IN_CONTACT)
        self._drop_payload()
        self.seen, self.seen_s = IN_CONTACT, 0.0
        self.part, self.sure, self.is_against = 0.0, False, False
        self.yielded, self.place = True, tuple(theta)

    def _expect(self) -> None:
        """Let the payload count again once the load agrees."""
        if self.payload.known and self._scales is not None:
            self._expected = self._scales.payload(self.payload)

    def _drop_payload(self) -> None:
        self.payload.known, self.weight = False, 1.0

    @property
    def supervision(self) -> Supervision:
        """What is believed at present."""
        payload, text = None, TEXTS[int(self.text)]
        if self.payload.known and self._scales is not None:
            payload = self._scales.payload(self.payload)
        if self.state not in UNKNOWN:
            coming = self.weight < 1.0 or self.part < 1.0
            text = YIELDED if self.yielded else COMING_IN if coming else ""
        return Supervision(
            STATES[int(self.state)],
            text,
            payload,
            bool(self.told) and payload is not None,
            self.part,
            self.valid,
        )

    @property
    def valid(self) -> bool:
        """Whether the load is known and corrected for, all that the model is trusted with."""
        return self.state not in UNKNOWN and self.part == 1.0 and bool(self.weight == 1.0)

    def scales(self, geometry: Geometry) -> Scales:
        """Return what weighs on a wrist."""
        if self._scales is None or self._scales.geometry is not geometry:
            self._scales = Scales(geometry)
        return self._scales

    def follow(self, stamp_ns: int, measured: Load) -> None:
        """Take a load as it is measured for the payload."""
        self._begin(stamp_ns)
        self.trust, self.followed = 1.0, measured
        self.state, self.is_against, self.sure = FOLLOWED, False, True

    def judge(
        self,
        stamp_ns: int,
        theta: Sequence[float],
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
        self.trust = settings.trust
        if self.yielded and apart(theta, self.place) > reach:
            self.yielded = False
        self._rest(theta)
        limit = self.limit(settings)
        known = limit.wider(reading, self._turned(theta))
        # What a motion turns is turned by the same all along it: so much less it says anew.
        self.counts = self.step_s / LATE_S * limit.moment / known.moment
        self._look(reading, known)
        if self.seen == IN_CONTACT:
            self._feel(theta, reading, known)
        elif self.seen == self.state == UNSURE:
            self._weigh(reading, known)
        elif self.seen == self.state == HOLDING:
            self.weight = min(1.0, self.weight + self.step_s / RAMP_S)
        if not self.payload.known or self._scales is None:
            return None
        return self._scales.load(self.payload, reading.rows, self.weight)

    def _begin(self, stamp_ns: int) -> None:
        last_ns = int(self.stamps[0]) or stamp_ns
        self.stamps[0] = stamp_ns
        self.step_s = min(max(stamp_ns - last_ns, 0) / NANOSECONDS, LONGEST_STEP_S)
        self.followed = None

    def held(self, settings: SupervisorSettings) -> Held:
        """Return what is held now, in full, for plans: it stays that, whatever is judged later."""
        return Held(
            self._scales,
            PayloadEstimate.from_buffer_copy(self.payload) if self.payload.known else None,
            self.followed,
            self.trust * self.part,
            self.valid,
            self.limit(settings).moment,
        )

    def share(self, turn: list[float]) -> float:
        """Return the part of a correction to apply.

        While the moment of a contact works against the correction's turn, the part falls towards
        none; so it does where it is not known what the platform carries.  It comes back when the
        command has left that place, never before, so that nothing can oscillate.

        `turn` (list of 3 float): by which the correction turns the platform, in F [rad].
        """
        x, y, z = (0.0, 0.0, 0.0) if self._scales is None else self._scales.along(turn)
        a, b, c = self.against
        # Not `sum`, which rounds otherwise from Python 3.12 on.
        if self.is_against and a * x + b * y + c * z < 0.0:
            self.part = max(0.0, self.part - self.step_s / YIELD_S)
        elif not self.sure:
            self.part = max(0.0, self.part - self.step_s / RAMP_S)
        elif not self.is_against and not self.yielded:
            self.part = min(1.0, self.part + self.step_s / RAMP_S)
        return float(self.trust * self.part)

    def _rest(self, theta: Sequence[float]) -> None:
        """Note for how long the command has stayed where it is, to an encoder step."""
        self.rest_s += self.step_s
        step = self._scales.geometry.limits.encoder_step if self._scales else 0.0
        if not self.stands or apart(theta, self.stand) > step:
            self.stands, self.stand, self.rest_s = True, tuple(theta), 0.0

    def _turned(self, theta: Sequence[float]) -> float:
        """Return by how much the command has turned within about `LATE_S` [rad]."""
        first, second = self.behind if self.moves else theta
        share = self.step_s / (LATE_S + self.step_s)
        self.behind = (first + share * (theta[0] - first), second + share * (theta[1] - second))
        self.moves = True
        return apart(theta, self.behind)

    def _look(self, reading: Reading, limit: Thresholds) -> None:
        """See what the load looks like, and believe it when it has looked like that for a while."""
        in_contact = self.state == IN_CONTACT
        seen = self._seeming(reading, limit.times(CALM) if in_contact else limit)
        self.seen_s = self.seen_s + self.step_s * self.departure if seen == self.seen else 0.0
        self.seen = seen
        patience = SETTLE_S if seen in TRUSTED else JUDGE_S
        if self.weight < 1.0 and seen != HOLDING:
            # While its correction comes in, a payload that is none shows at once.
            patience = 0.0
        if seen != self.state and self.seen_s >= patience:
            self._enter(seen)

    def _seeming(self, reading: Reading, limit: Thresholds) -> int:
        """Return what a load looks like, and by how many thresholds it is not what is believed."""
        self.is_against, self.departure = False, 1.0
        payload = self.payload
        if payload.known and payload.explains(reading, limit, self.counts):
            return HOLDING
        nothing = reading.size(limit) <= 1.0
        if nothing and not payload.known:
            return FREE
        rest = payload.rest(reading) if payload.known else reading
        if nothing or self.state not in UNKNOWN:
            self.departure = max(1.0, rest.size(limit))
        elif self.state == UNSURE:
            self.departure = max(1.0, reading.aside(limit))
        if nothing:
            return RELEASED
        if reading.is_weight(limit) and self.weight == 1.0:
            return UNSURE
        self.is_against, self.against = True, rest.moments
        return IN_CONTACT

    def _enter(self, state: int) -> None:
        if state in (UNSURE, RELEASED):
            self._drop_payload()
        if state == RELEASED:
            self._expected = None
        if state != IN_CONTACT:
            self.sure = state != UNSURE
        elif self.payload.known and self.rest_s > LATE_S:
            # A wall does not come by itself: something else than the motion changed.
            self._drop_payload()
            self.sure = False
        self.candidate.known = False
        self.state, self.stamps[1] = state, self.stamps[0]
        self.text = TEXTS.index(TEXT_OF.get(state, ""))

    def _feel(self, theta: Sequence[float], reading: Reading, limit: Thresholds) -> None:
        """Look again at what is held: whether the contact is its own, and it is still there."""
        if self.part < 1.0 or self.weight < 1.0:
            self.yielded, self.place = True, tuple(theta)
        if self.state == IN_CONTACT and self.payload.known:
            if self.weight < 1.0:
                self._drop_payload()
                self.text = TEXTS.index(TOUCHED_HERE)
            elif not self._stands_in(reading, limit):
                self.payload.known = False
            self.sure = self.payload.known

    def _stands_in(self, reading: Reading, limit: Thresholds) -> bool:
        """Tell whether the payload may stand in for the load of a contact.

        Only where the load is nearer to it than to nothing, and its moment at this pose is known.
        """
        known = self.payload.open_moment(reading.rows) <= OPEN * limit.moment
        return known and self.payload.rest(reading).size(limit) < reading.size(limit)

    def _weigh(self, reading: Reading, limit: Thresholds) -> None:
        """Make a weight that stays the payload, unless it was found to be a contact here."""
        scales = self._scales
        if scales is None:
            return
        candidate = self.candidate
        if not (candidate.known and candidate.explains(reading, limit, self.counts)):
            self.candidate, self.candidate_s = scales.unknown(reading), 0.0
        self.candidate_s += self.step_s
        if self.candidate_s < SETTLE_S:
            return
        expected = None if self._expected is None else scales.estimate(self._expected)
        if expected is not None and not expected.explains(reading, limit, self.counts):
            expected = None
        if self.yielded:
            self.text = TEXTS.index(TOUCHED_HERE)
        elif not reading.is_weight(limit.times(CALM)):
            self.text = TEXTS.index(NO_WEIGHT)
        else:
            if expected is None:
                self._expected, self.told = None, False
            self.payload, self.weight = expected or self.candidate, 0.0
            self._enter(HOLDING)
