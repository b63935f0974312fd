"""A load sensor that does not read zero without load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import FORCE, MOMENT, symmetric_vector, vector


class LoadBias(Law):
    """The sensor says the true wrench plus a constant in F."""

    id = "load_bias"
    stage = "load"
    places = ("load_sensor",)
    sentence = "the load sensor does not read zero without load"
    check = "tare the sensor; read it with the platform free"
    excited_by = "loads of several directions, and none"
    constant = True
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return what the sensor reads without load."""
        return (*symmetric_vector(FORCE, 5.0, 0.1), *symmetric_vector(MOMENT, 100.0, 2.0))

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return true minus said."""
        bias = np.concatenate([vector(values, FORCE), vector(values, MOMENT)])
        return Contribution(wrench=np.tile(-bias, (len(at.block), 1))), None
