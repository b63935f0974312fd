"""A pose sensor that wanders with time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import symmetric_vector, vector

SHIFT, TURN = "shift_{}_um_per_h", "turn_{}_mdeg_per_h"


class Drift(Law):
    """Screw at O in F that grows with the time since the first sample."""

    id = "drift"
    stage = "sensor"
    places = ("pose_sensor",)
    sentence = "the tracker wanders with time"
    check = "measure a target on the frame before, between and after"
    excited_by = "the same pose again and again over the whole session, or a target on the frame"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the rates."""
        return (*symmetric_vector(SHIFT, 1e4, 10.0), *symmetric_vector(TURN, 1e4, 5.0))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw; the state is the time of the first sample."""
        start = at.block.time[0] if state is None else state
        rate = np.concatenate([vector(values, SHIFT), vector(values, TURN)])
        return Contribution(sensor_left=np.outer(at.block.time - start, rate)), start
