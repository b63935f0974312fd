"""A zero of an encoder that is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.situation import Situation


class EncoderOffset(Law):
    """The motor stands at the encoder's angle plus a constant."""

    id = "encoder_offset"
    stage = "geometry"
    places = MOTORS
    sentence = "the zero of {place}'s encoder is off"
    check = "drive to the reference mark or a gauge block and compare"
    excited_by = "poses all over the workspace"
    constant = True
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the true angle minus the encoder's."""
        return (symmetric("offset_mdeg", 5000.0, 100.0),)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the turn."""
        return at.motor_turn(place, np.full(len(at.block), values["offset_mdeg"])), None
