"""A polymer bushing that goes on giving under a held load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.mechanism.components import ELASTIC, JOINTS
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.warmth import lagged

TIMES_S = (2.0, 8.0, 25.0, 90.0, 400.0)
"""Time constants that are tried first."""


class Creep(Law):
    """Standard linear solid: a delayed part of the flexibility follows the wrench with a lag."""

    id = "creep"
    stage = "reaction"
    places = JOINTS
    sentence = "the bushing of {place} goes on giving while a load is held"
    check = "hold a load for two minutes and watch the pose; unload and watch it come back"
    excited_by = "load steps held for a minute or more, and the recovery after them"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the delayed part of the flexibility and its time constant."""
        return (
            Parameter("delayed_percent", 0.0, 500.0, 20.0),
            Parameter("time_constant_s", 0.1, 1e5, 60.0, 60.0, linear=False, grid=TIMES_S),
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the delayed screw; it turns with the bushing."""
        wrench = at.at_home(place, at.through_place(place))
        slow, state = lagged(at.block.time, wrench, values["time_constant_s"], state)
        flexibility = at.parts.flexibility[ELASTIC.index(place)]
        return at.screw(place, values["delayed_percent"] * slow @ flexibility.T), state
