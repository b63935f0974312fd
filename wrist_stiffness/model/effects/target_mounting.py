"""A tracker's target that is not where it is believed on the platform."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import twist, twist_parameters


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

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the screw."""
        return twist_parameters((1e5, 1000.0), (2e4, 200.0))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw, turned with the platform."""
        return Contribution(sensor_right=at.in_base("platform", twist(values))), None
