"""A frame that gives under both limbs."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.spring import Spring


class FrameCompliance(Spring):
    """Spring between F and both motors, through O."""

    id = "frame_compliance"
    places = ("frame",)
    sentence = "the frame under both motors gives"
    check = "tighten the frame's screws; measure a target on the frame while the wrist is loaded"
    excited_by = "loads of several directions and sizes; moments of both signs"

    def centre(self, geometry: Geometry, place: str) -> Array:
        """Return O."""
        return np.zeros(3)
