"""A flange whose axial gap is not the table's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS
from wrist_stiffness.model.columns import Recipe, share_of_shape
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation

GAPS_UM = (-40.0, -10.0, -2.0, 2.0, 10.0, 40.0)
"""Changes of a gap that are tried first, of both signs."""


class FlangeContact(Law):
    """All gaps of a joint's flanges are wider by the same amount."""

    id = "flange_contact"
    stage = "geometry"
    places = PASSIVE_JOINTS
    sentence = "the axial gap of {place} is not as modelled, so its flange touches later or sooner"
    check = "measure the axial play of the joint with a feeler gauge"
    excited_by = "axial forces of both signs at the joint"
    constant = True
    smooth = False
    inexactness = 0.03

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the change of the gap."""
        return (Parameter("gap_um", -1000.0, 1000.0, 30.0, linear=False, grid=GAPS_UM),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return what gaps of several sizes do, times a share of each."""
        return share_of_shape(self.parameters(place), "gap_um")

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the opening of the joint's sectors."""
        own = at.parts.sectors.component == ELASTIC.index(place)
        gap = np.where(own, values["gap_um"], 0.0)
        return Contribution(gap=np.tile(gap, (len(at.block), 1))), None
