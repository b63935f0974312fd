"""A pose sensor whose frame is not where it is believed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import twist, twist_parameters


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

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the screw."""
        return twist_parameters((1e5, 1000.0), (2e4, 200.0))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw at every sample."""
        return Contribution(sensor_left=np.tile(twist(values), (len(at.block), 1))), None
