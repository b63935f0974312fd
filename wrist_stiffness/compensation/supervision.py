"""What is believed of the load, and what counts as another load."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from wrist_stiffness.compensation.payload import Payload, Thresholds


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
