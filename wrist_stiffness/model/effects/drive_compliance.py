"""Windup of a drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.mechanism.components import MOTORS
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.places import MOTOR_JOINT
from wrist_stiffness.model.situation import Situation


class DriveCompliance(Law):
    """The output turns by compliance times the torque about the motor's axis."""

    id = "drive_compliance"
    stage = "reaction"
    places = MOTORS
    sentence = "the gearbox of {place} winds up under torque"
    check = "lock the motor, load the link with a weight and a dial gauge, compare both directions"
    excited_by = "loads with a torque about the motor axis, of both signs"
    inexactness = 0.03

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the compliance."""
        return (Parameter("compliance_mdeg_per_Nm", 0.0, 1e6, 500.0),)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the turn."""
        axis = at.table.geometry.axes[MOTOR_JOINT[place]]
        torque = at.through_place(place)[:, 3:] @ axis
        return at.motor_turn(place, values["compliance_mdeg_per_Nm"] * torque), None
