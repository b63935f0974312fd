"""A bracket that holds one motor and gives."""

from __future__ import annotations

from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.at_point import bushing_centre
from wrist_stiffness.model.places import MOTOR_JOINT
from wrist_stiffness.model.spring import Spring


class MountCompliance(Spring):
    """Spring between frame and motor, at the centre of the motor's bushing."""

    id = "mount_compliance"
    places = MOTORS
    sentence = "the bracket of {place} gives"
    check = (
        "tighten the bracket's screws; put a dial gauge on the motor housing and load the wrist; "
        "where it stands still, look for a crack at the root of the link"
    )
    excited_by = "loads of several directions at poses all over the workspace"

    def centre(self, geometry: Geometry, place: str) -> Array:
        """Return the centre of the motor's bushing."""
        return bushing_centre(geometry, MOTOR_JOINT[place])
