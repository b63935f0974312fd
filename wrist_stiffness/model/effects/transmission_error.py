"""A gear that does not run evenly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.situation import Situation


class TransmissionError(Law):
    """Output minus motor: one wave of an order found from the data."""

    id = "transmission_error"
    stage = "geometry"
    places = MOTORS
    sentence = "the gear of {place} runs unevenly: a wave many times per turn"
    check = "count the teeth: does the order fit a tooth mesh or a strain-wave generator?"
    excited_by = "slow sweeps of the motor, several samples within a wave"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return amplitudes and the order."""
        return (
            symmetric("cos_mdeg", 1000.0, 10.0),
            symmetric("sin_mdeg", 1000.0, 10.0),
            Parameter("order", 3.0, 500.0, 50.0, mean=10.0, linear=False),
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the turn."""
        phase = values["order"] * at.block.theta[:, MOTORS.index(place)]
        turn = values["cos_mdeg"] * np.cos(phase) + values["sin_mdeg"] * np.sin(phase)
        return at.motor_turn(place, turn), None
