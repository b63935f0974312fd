"""An encoder disc that runs out of true."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.situation import Situation


class EncoderEccentricity(Law):
    """True angle minus the encoder's: waves once and twice per turn."""

    id = "encoder_eccentricity"
    stage = "geometry"
    places = MOTORS
    sentence = "the encoder disc of {place} runs out of true: an error once (twice) per turn"
    check = "compare the encoder over a full turn with a polygon or an autocollimator"
    excited_by = "the whole travel of the motor"
    inexactness = 0.03

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return cosine and sine amplitudes of both orders."""
        return tuple(
            symmetric(f"{wave}_{order}_mdeg", 5000.0, 50.0)
            for order in (1, 2)
            for wave in ("cos", "sin")
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the turn."""
        angle = at.block.theta[:, MOTORS.index(place)]
        turn = np.zeros_like(angle)
        for order in (1, 2):
            turn += values[f"cos_{order}_mdeg"] * np.cos(order * angle)
            turn += values[f"sin_{order}_mdeg"] * np.sin(order * angle)
        return at.motor_turn(place, turn), None
