"""Play between pin and sleeve of a bushing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.at_point import bushing_centre, cross_axes, screw_from
from wrist_stiffness.model.law import NOTHING, Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.pin_play import Play
from wrist_stiffness.model.situation import Situation


class JointClearance(Law):
    """Each end of the sleeve is pressed to its wall by the radial force that it carries.

    Force and moment of the bearing are two end forces, half a sleeve's length off its centre; each
    end moves by half the diametral clearance along its own.  Equal end forces shift the pin,
    opposite ones tilt it.  A flange that touches pushes the pin back within its play.
    """

    id = "joint_clearance"
    stage = "reaction"
    places = JOINTS
    state_is_a_guess = True
    sentence = "{place} has play: the pin lies on the side of its bearing force"
    check = "push and pull the joint across its axis with a dial gauge; swap the bushing"
    excited_by = "loads of opposite directions, so that the bearing force changes sides"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the diametral clearance."""
        return (Parameter("clearance_um", 0.0, 2000.0, 20.0),)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw of the play."""
        radial = 0.5 * values["clearance_um"]
        if radial == 0.0:
            return NOTHING, None
        # In units of the play: with a little more of it the pin rests at its wall still.
        near = None if state is None or len(state) != len(at.block) else radial * state
        ends = end_screws(at.table.geometry, place)
        opening = np.stack([at.carried(at.screw(place, end))[1] for end in ends], axis=-1)
        carried = at.at_home(place, at.through_place(place)) @ ends.T
        flanges = (np.swapaxes(opening, -1, -2) @ at.contact_force[..., None])[..., 0]
        play = Play(radial, carried - flanges, at.free[1], opening, at.operators.approach)
        resting = play.resting(near)
        return at.screw(place, resting @ ends), resting / radial


def end_screws(geometry: Geometry, joint: str) -> Array:
    """Return the screws for unit displacements of a sleeve's ends across its axis.

    Parameters
    ----------
    geometry : Geometry
        Of the wrist.
    joint : str
        The joint.

    Returns
    -------
    (4, 6) float
        Upper end along u and v, lower end along u and v; at O in the joint's home frame.
    """
    axis, length = geometry.axes[joint], geometry.bushings[joint].length
    across = cross_axes(geometry, joint)[:2]
    turn = cross(axis, across) / length
    local = np.concatenate([np.tile(0.5 * across, (2, 1)), np.concatenate([turn, -turn])], axis=1)
    return screw_from(bushing_centre(geometry, joint), local)
