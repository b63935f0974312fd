"""A load sensor that is mounted turned."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import symmetric_vector, vector

IN_BASE, IN_PLATFORM = "base_{}_mdeg", "platform_{}_mdeg"


class LoadMisalignment(Law):
    """The true wrench is the said one turned about O by a small angle, fixed in F and in U."""

    id = "load_misalignment"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load sensor's axes are turned against the wrist's"
    check = "hang a weight and compare the direction that the sensor says at several tilts"
    excited_by = "loads of several directions at several poses"
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the turns of a sensor in the base and of one on the platform."""
        return (
            *symmetric_vector(IN_BASE, 1e4, 500.0),
            *symmetric_vector(IN_PLATFORM, 1e4, 500.0),
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return true minus said."""
        turn = vector(values, IN_BASE) + at.body("platform") @ vector(values, IN_PLATFORM)
        halves = cross(turn, at.load[:, :3]), cross(turn, at.load[:, 3:])
        return Contribution(wrench=np.concatenate(halves, axis=1)), None
