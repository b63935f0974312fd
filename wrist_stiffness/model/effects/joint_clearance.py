"""Play between pin and sleeve of a bushing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import JOINTS, Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.at_point import bushing_centre, screw_from, wrench_at
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation, lengths

SMALL_FORCE = 1e-2
"""An end that carries less radial force than this is not pressed to its wall altogether [N]."""


class JointClearance(Law):
    """Each end of the sleeve is pressed to its wall by the radial force that it carries.

    Force and moment of the bearing are two end forces, half a sleeve's length off its centre; each
    end moves by half the diametral clearance along its own.  Equal end forces shift the pin,
    opposite ones tilt it.
    """

    id = "joint_clearance"
    stage = "reaction"
    places = JOINTS
    sentence = "{place} has play: the pin lies on the side of its bearing force"
    check = "push and pull the joint across its axis with a dial gauge; swap the bushing"
    excited_by = "loads of opposite directions, so that the bearing force changes sides"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the diametral clearance."""
        return (Parameter("clearance_um", 0.0, 500.0, 20.0),)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw of the play."""
        geometry = at.table.geometry
        axis, length = geometry.axes[place], geometry.bushings[place].length
        centre = bushing_centre(geometry, place)
        local = wrench_at(centre, at.at_home(place, at.through_place(place)))
        home = play_screw(local, axis, length, 0.5 * values["clearance_um"])
        return at.screw(place, screw_from(centre, home)), None


def play_screw(wrench: Array, axis: Array, length: float, radial: float) -> Array:
    """Return the screw of a pin in its play.

    Parameters
    ----------
    wrench : (n, 6) float
        At the sleeve's centre, on the moving side [N, N m].
    axis : (3,) float
        Of the sleeve, unit vector.
    length : float
        Of the sleeve [m].
    radial : float
        Half the diametral clearance [m].

    Returns
    -------
    (n, 6) float
        At the sleeve's centre [m, rad].
    """
    force = wrench[:, :3] - (wrench[:, :3] @ axis)[:, None] * axis
    couple = cross(wrench[:, 3:], axis) / length
    ends = (0.5 * force + couple, 0.5 * force - couple)
    upper, lower = (
        radial * end / np.sqrt(lengths(end) ** 2 + SMALL_FORCE**2)[:, None] for end in ends
    )
    return np.concatenate([0.5 * (upper + lower), cross(axis, upper - lower) / length], axis=1)
