"""A six-dof spring at a point of a place: shared by three effects of the catalogue."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.at_point import screw_from, wrench_at
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation

KEYS = tuple(f"{axis}_um_per_N" for axis in "xyz") + tuple(
    f"turn_{axis}_mdeg_per_Nm" for axis in "xyz"
)


class Spring(Law):
    """Compliances along and about x, y and z of the place's body at home, through a point."""

    stage = "reaction"

    @abstractmethod
    def centre(self, geometry: Geometry, place: str) -> Array:
        """Return the point at home, (3,) [m]."""

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return six compliances."""
        shift = (Parameter(key, 0.0, 1e3, 1.0) for key in KEYS[:3])
        turn = (Parameter(key, 0.0, 1e5, 100.0) for key in KEYS[3:])
        return (*shift, *turn)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the deflection under the wrench through the place."""
        point = self.centre(at.table.geometry, place)
        compliance = np.array([values[key] for key in KEYS])
        local = wrench_at(point, at.at_home(place, at.through_place(place)))
        return at.screw(place, screw_from(point, compliance * local)), None
