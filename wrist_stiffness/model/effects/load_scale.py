"""A load sensor with a wrong gain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation


class LoadScale(Law):
    """The sensor says (1 + scale) times the true wrench."""

    id = "load_scale"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load sensor reads too much (or too little) by a constant factor"
    check = "hang a reference weight on the platform: does the sensor say newtons, not kg or kN?"
    excited_by = "loads of several sizes beside a known weight"
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the excess."""
        return (Parameter("scale_percent", -50.0, 3000.0, 3.0, linear=False),)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return true minus said."""
        return Contribution(wrench=self.load_share(values) * at.load), None

    def load_share(self, values: Mapping[str, float]) -> float:
        """Return the same as a share of what is said."""
        return 1.0 / (1.0 + values["scale_percent"]) - 1.0
