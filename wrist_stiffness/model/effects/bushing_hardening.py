"""A polymer bushing that stiffens under force."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.mechanism.components import JOINTS
from wrist_stiffness.model.columns import Recipe, share_of_shape
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.scaled_part import extra
from wrist_stiffness.model.situation import Situation, lengths


class BushingHardening(Law):
    """Flexibility over (1 + hardening times force)."""

    id = "bushing_hardening"
    stage = "reaction"
    places = JOINTS
    sentence = "the bushing of {place} stiffens as its force grows"
    check = "load the joint in steps with a dial gauge: are equal steps equally large?"
    excited_by = "the same pose under loads of at least three sizes"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the loss of flexibility by the force."""
        grid = (5.0, 50.0, 300.0)
        return (Parameter("hardening_percent_per_N", 0.0, 500.0, 10.0, linear=False, grid=grid),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return what hardening of several sizes does, times a share of each."""
        return share_of_shape(self.parameters(place), "hardening_percent_per_N")

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw that is missing."""
        force = lengths(at.through_place(place)[:, :3])
        stiffened = values["hardening_percent_per_N"] * force
        return extra(at, place, -stiffened / (1.0 + stiffened)), None
