"""Pose sensors and targets that are not where they are believed."""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.parameters import symmetric_vector, vector

SHIFT, TURN = "shift_{}_um", "turn_{}_mdeg"

TWIST = (*symmetric_vector(SHIFT, 1e5, 1000.0), *symmetric_vector(TURN, 2e4, 200.0))
"""Six parameters of a small screw: where something was set up by hand."""


class MeasurementFrame(Law):
    """Constant screw X at O in F: T_measured = exp(X) T_true."""

    id = "measurement_frame"
    stage = "sensor"
    places = ("pose_sensor",)
    sentence = "the tracker is registered wrongly to the base"
    check = "register again on the base's datum points"
    excited_by = "poses all over the workspace"
    constant = True
    inexactness = 0.0
    own = TWIST

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the screw at every sample."""
        return Contribution(sensor_left=np.tile(vector(values, SHIFT, TURN), (len(at.block), 1)))


class TargetMounting(Law):
    """Constant screw Y at O in U: T_measured = T_true exp(Y)."""

    id = "target_mounting"
    stage = "sensor"
    places = ("pose_sensor",)
    sentence = "the target sits on the platform otherwise than believed"
    check = "measure the target against the platform's datum; look whether it is loose"
    excited_by = "poses all over the workspace"
    constant = True
    inexactness = 0.0
    own = TWIST

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the screw, turned with the platform."""
        return Contribution(sensor_right=at.in_base("platform", vector(values, SHIFT, TURN)))


DRIFT_SHIFT, DRIFT_TURN = "shift_{}_um_per_h", "turn_{}_mdeg_per_h"


class Drift(Law):
    """Screw at O in F that grows with the time since the first sample."""

    id = "drift"
    stage = "sensor"
    places = ("pose_sensor",)
    sentence = "the tracker wanders with time"
    check = "measure a target on the frame before, between and after"
    excited_by = "the same pose again and again over the whole session, or a target on the frame"
    own = (*symmetric_vector(DRIFT_SHIFT, 1e4, 10.0), *symmetric_vector(DRIFT_TURN, 1e4, 5.0))

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the screw; the state is the time of the first sample."""
        start = at.block.time[0] if state is None else state
        rate = vector(values, DRIFT_SHIFT, DRIFT_TURN)
        return Contribution(sensor_left=np.outer(at.block.time - start, rate)), start
