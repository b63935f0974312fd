"""The play of a joint: between pin and sleeve, and between flange and hub."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, PASSIVE_JOINTS
from wrist_stiffness.model.columns import Recipe, at_usual_size, share_of_shape
from wrist_stiffness.model.law import NOTHING, Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.pin_rest import Pins

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
    own = (Parameter("gap_um", -1000.0, 1000.0, 30.0, linear=False, grid=GAPS_UM),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return what gaps of several sizes do, times a share of each."""
        return share_of_shape(self.own, "gap_um")

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the opening of the joint's sectors."""
        own = at.parts.sectors.component == ELASTIC.index(place)
        gap = np.where(own, values["gap_um"], 0.0)
        return Contribution(gap=np.tile(gap, (len(at.block), 1)))


class JointClearance(Law):
    """Each end of the sleeve is pressed to its wall by the radial force that it carries.

    Force and moment of the bearing are two end forces, half a sleeve's length off its centre; each
    end moves by half the diametral clearance along its own.  Equal end forces shift the pin,
    opposite ones tilt it.  A flange that touches pushes the pin back within its play, and pins of
    other joints with it; a joint that rubs holds it.
    """

    id = "joint_clearance"
    stage = "reaction"
    places = JOINTS
    state_is_a_guess = True
    rests_together = True
    sentence = "{place} has play: the pin lies on the side of its bearing force"
    check = "push and pull the joint across its axis with a dial gauge; swap the bushing"
    excited_by = "loads of opposite directions, so that the bearing force changes sides"
    smooth = False
    own = (Parameter("clearance_um", 0.0, 2000.0, 20.0),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return the column of a small clearance, in which no flange stands in the way."""
        return at_usual_size(self.own[0], 5.0)

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the screw of the play."""
        (found,) = self.together(at, [place], [values], [state])
        return found

    def together(
        self,
        at: Situation,
        places: Sequence[str],
        values: Sequence[SIValues],
        states: Sequence[Any],
    ) -> list[Outcome]:
        """Return the screws of all pins, which rest together among the flanges."""
        radial = np.array([0.5 * each["clearance_um"] for each in values])
        loose = np.flatnonzero(radial).tolist()
        found: list[Outcome] = [(NOTHING, None)] * len(places)
        if loose:
            pins = Pins(at, [places[n] for n in loose], radial[loose])
            for n, each in zip(loose, pins.rest([states[n] for n in loose]), strict=True):
                found[n] = each
        return found
