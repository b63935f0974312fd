"""A polymer bushing that softens as it warms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.mechanism.components import JOINTS
from wrist_stiffness.model.columns import Recipe, tangents
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.scaled_part import extra
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.warmth import WARMTH, unused, warmth


class ThermalSoftening(Law):
    """Flexibility grows with the temperature above reference."""

    id = "thermal_softening"
    stage = "reaction"
    places = JOINTS
    sentence = "the bushing of {place} softens as it warms"
    check = "repeat one loaded pose cold and warm"
    signals = ("temperature of the joint, or ambient, or its motor",)
    excited_by = "the same loads at temperatures at least 5 K apart"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the growth of flexibility by the temperature, and how the part warms."""
        return (Parameter("softening_percent_per_K", -5.0, 100.0, 1.0), *WARMTH)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return tangents, on a grid of how the part warms where no thermometer says it."""
        return tangents(self.parameters(place), unused(place, signals))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the further screw."""
        warm, state = warmth(at, place, values, state)
        return extra(at, place, values["softening_percent_per_K"] * warm), state
