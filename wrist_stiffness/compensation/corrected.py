"""What a corrector answers: angles for the motors, and the residual that they leave."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wrist_stiffness.compensation.correction import Correction
from wrist_stiffness.compensation.measured_pose import NOT_MEASURED
from wrist_stiffness.compensation.trajectory_plan import PlannedPoint
from wrist_stiffness.errors import WristError
from wrist_stiffness.mechanism.compiled import Flags
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import screws_to_origin


class CorrectedCommand(NamedTuple):
    """What to send to the motors for one command."""

    frame_id: str  # for the header: `wrist_corrected` where correction is on or still fades out
    positions: Array  # (n,), all joints of the command, the motors corrected [rad]
    theta: Array  # (2,), corrected motor angles [rad]
    # as it is applied, with the residual that remains; None while none can be had
    correction: Correction | None
    # why none can be had although correction is on (what was applied before then fades out), or why
    # the model could not remember the command
    fault: WristError | None
    # whether the residual holds: the load is known and corrected for in full (`Supervisor.valid`)
    valid: bool = False

    def residuals(self, tool_point: Array) -> list[tuple[Array, Array]]:
        """Return what a correction leaves: actual minus desired pose.

        `tool_point` (3,): of the geometry, in U [m].  Gives list of ((6,), (6, 6)): twist in F at O
        and its covariance, and the same at the tool point where that is not O; empty without a
        correction.  Where the residual does not hold, the covariance says so as that of a pose does
        that is not measured.
        """
        if self.correction is None:
            return []
        prediction = self.correction.prediction
        platform = prediction.configuration.platform
        return _left(self.correction.after, prediction.covariance, platform, self.valid, tool_point)


@dataclass(frozen=True)
class CorrectedTrajectory:
    """What to send for a whole trajectory."""

    frame_id: str  # for the header: `wrist_corrected` where correction is on
    points: tuple[PlannedPoint, ...]  # the motors' angles, speeds and accelerations corrected
    fault: WristError | None  # why it passes unchanged although correction is on
    valid: bool = False  # as of a command, at its start


@dataclass(frozen=True)
class CorrectedBlock:
    """What to send to the motors for n commands."""

    theta: Array  # (n, 2), corrected motor angles [rad]
    # (n,), which of them have a correction; residual and covariance of the others are undefined
    corrected: Flags
    after: Array  # (n, 6), residual with the correction as it is applied, at O in F [m, rad]
    covariance: Array  # (n, 6, 6), of the prediction behind it
    faults: dict[int, WristError]  # why a command has none
    platform: Array  # (n, 3, 3), U -> F of the rigid platform at the corrected angles
    valid: Flags  # (n,), as `CorrectedCommand.valid`

    @classmethod
    def of(cls, answers: Iterable[CorrectedCommand], n: int) -> CorrectedBlock:
        """Return n single answers as a block."""
        theta, after, covariance = np.empty((n, 2)), np.empty((n, 6)), np.empty((n, 6, 6))
        flags, platform = np.zeros((2, n), dtype=bool), np.empty((n, 3, 3))
        found = cls(theta, flags[0], after, covariance, {}, platform, flags[1])
        for place, one in enumerate(answers):
            found.theta[place], found.valid[place] = one.theta, one.valid
            if one.fault is not None:
                found.faults[place] = one.fault
            if one.correction is not None:
                prediction = one.correction.prediction
                found.corrected[place], found.after[place] = True, one.correction.after
                found.covariance[place] = prediction.covariance
                found.platform[place] = prediction.configuration.platform
        return found

    def residuals(self, tool_point: Array) -> list[tuple[Array, Array]]:
        """Return the same as `CorrectedCommand` of the k commands that have a correction.

        Gives list of ((k, 6) float, (k, 6, 6) float): twists and covariances.
        """
        own = np.flatnonzero(self.corrected)
        rows = self.after[own], self.covariance[own], self.platform[own], self.valid[own]
        if not tool_point.any():
            doubt = np.where(rows[3], 0.0, NOT_MEASURED)[:, None, None] * np.eye(6)
            return [(rows[0], rows[1] + doubt)]
        # One by one: a stack of products may round otherwise.
        twists, covariances = np.empty((2, len(own), 6)), np.empty((2, len(own), 6, 6))
        for i, row in enumerate(zip(*rows, strict=True)):
            for place, left in enumerate(_left(*row, tool_point)):
                twists[place, i], covariances[place, i] = left
        return list(zip(twists, covariances, strict=True))


def _left(
    twist: Array, covariance: Array, platform: Array, valid: bool, tool_point: Array
) -> list[tuple[Array, Array]]:
    doubt = (0.0 if valid else NOT_MEASURED) * np.eye(6)
    found = [(twist, covariance + doubt)]
    if tool_point.any():
        there = screws_to_origin(-platform @ tool_point)
        found.append((there @ twist, there @ covariance @ there.T + doubt))
    return found
