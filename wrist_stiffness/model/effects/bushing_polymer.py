"""What a polymer bushing does besides being elastic."""

from __future__ import annotations

from typing import Any

from wrist_stiffness.mechanism.components import ELASTIC, JOINTS
from wrist_stiffness.model.columns import Recipe, share_of_shape
from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.memory import lagged
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import lengths

HARDENINGS = (5.0, 50.0, 300.0)
TIMES_S = (2.0, 8.0, 25.0, 90.0, 400.0)
"""Hardenings and time constants that are tried first."""


class BushingHardening(Law):
    """Flexibility over (1 + hardening times force)."""

    id = "bushing_hardening"
    stage = "reaction"
    places = JOINTS
    sentence = "the bushing of {place} stiffens as its force grows"
    check = "load the joint in steps with a dial gauge; see whether equal steps are equally large"
    excited_by = "the same pose under loads of at least three sizes"
    own = (Parameter("hardening_percent_per_N", 0.0, 500.0, 10.0, linear=False, grid=HARDENINGS),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return what hardening of several sizes does, times a share of each."""
        return share_of_shape(self.own, "hardening_percent_per_N")

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the screw that is missing."""
        force = lengths(at.through_place(place)[:, :3])
        stiffened = values["hardening_percent_per_N"] * force
        return at.elastic_share(place, -stiffened / (1.0 + stiffened))


class Creep(Law):
    """Standard linear solid: a delayed part of the flexibility follows the wrench with a lag."""

    id = "creep"
    stage = "reaction"
    places = JOINTS
    sentence = "the bushing of {place} goes on giving while a load is held"
    check = "hold a load for two minutes and watch the pose; unload and watch it come back"
    excited_by = "load steps held for a minute or more, and the recovery after them"
    own = (
        Parameter("delayed_percent", 0.0, 500.0, 20.0),
        Parameter("time_constant_s", 0.1, 1e5, 60.0, 60.0, linear=False, grid=TIMES_S),
    )

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the delayed screw; it turns with the bushing."""
        wrench = at.at_home(place, at.through_place(place))
        slow, state = lagged(at.block.time, wrench, values["time_constant_s"], state)
        flexibility = at.parts.flexibility[ELASTIC.index(place)]
        return at.screw(place, values["delayed_percent"] * slow @ flexibility.T), state
