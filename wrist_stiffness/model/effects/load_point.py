"""A load that acts beside the point for which it is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import symmetric_vector, vector

IN_BASE, IN_PLATFORM = "base_{}_mm", "platform_{}_mm"


class LoadPoint(Law):
    """The force acts off O by a lever arm fixed in F and one fixed in U, beyond the told moment."""

    id = "load_point"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load acts beside the point for which it is given"
    check = "measure where the load touches; move it by a known distance and compare"
    excited_by = "forces of several directions at several poses"
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return both lever arms."""
        return (
            *symmetric_vector(IN_BASE, 1000.0, 2.0),
            *symmetric_vector(IN_PLATFORM, 1000.0, 2.0),
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the missing moment."""
        lever = vector(values, IN_BASE) + at.body("platform") @ vector(values, IN_PLATFORM)
        wrench = np.zeros_like(at.load)
        wrench[:, 3:] = cross(lever, at.load[:, :3])
        return Contribution(wrench=wrench), None
