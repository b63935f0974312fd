"""Where an effect may sit, and how a screw or a wrench there meets the rest of the wrist."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np

from wrist_stiffness.mechanism.components import CARRIER, ELASTIC, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.influence import LIMB_1
from wrist_stiffness.mechanism.vectors import cross, unit

Limb = Literal["limb_1", "limb_2", "both"]

LIMB: dict[str, Limb] = {
    **{name: "limb_1" if name in LIMB_1 else "limb_2" for name in ELASTIC},
    "motor_1": "limb_1",
    "motor_2": "limb_2",
    "frame": "both",
    "platform": "both",
}
"""The limb whose G carries a screw: a screw under or behind both limbs reaches the platform whole
and moves no slide."""

BODY = {**CARRIER, "motor_1": "frame", "motor_2": "frame", "frame": "frame", "platform": "platform"}
"""The body in which a place is at home and with which its directions turn."""

THERMOMETERS = (*BODY, "ambient")
"""Of what a temperature may be said."""

MOTOR_JOINT = {"motor_1": "joint_1", "motor_2": "joint_5"}
"""The joint that carries what a motor carries."""


NEIGHBOUR = {
    "joint_1": "joint_2",
    "joint_2": "joint_1",
    "joint_3": "joint_4",
    "joint_4": "joint_3",
    "joint_5": "joint_4",
}
"""The joint at the other end of the link that a joint's cross axes are laid by."""


def bushing_centre(geometry: Geometry, joint: str) -> Array:
    """Return the centre of a joint's bushing at home, (3,) [m]."""
    return geometry.bushings[joint].radius * geometry.axes[joint]


def cross_axes(geometry: Geometry, joint: str) -> Array:
    """Return the axes u, v, w of a joint at home as rows (3, 3).

    w is the joint's axis, u is perpendicular to it and to the other axis of its link, v = w x u.
    """
    w = geometry.axes[joint]
    u = unit(cross(w, geometry.axes[NEIGHBOUR[joint]]))
    return np.stack([u, cross(w, u), w])


@lru_cache(maxsize=32)
def end_screws(geometry: Geometry, joint: str) -> Array:
    """Return the screws for unit displacements of a sleeve's ends across its axis.

    Gives (4, 6): upper end along u and v, lower end along u and v; at O in the joint's home frame.
    """
    axis, length = geometry.axes[joint], geometry.bushings[joint].length
    across = cross_axes(geometry, joint)[:2]
    turn = cross(axis, across) / length
    turns = np.concatenate([turn, -turn])
    shifts = np.tile(0.5 * across, (2, 1)) + cross(bushing_centre(geometry, joint), turns)
    return np.concatenate([shifts, turns], axis=1)
