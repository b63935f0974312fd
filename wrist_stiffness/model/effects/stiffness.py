"""Parts that are more flexible than modelled, and springs in series, each at a point of a place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import (
    ELASTIC,
    JOINTS,
    LINKS,
    MOTORS,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.vectors import screws_to_origin
from wrist_stiffness.model.law import Contribution, Law, Situation, SIValues
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.places import MOTOR_JOINT, bushing_centre


class LinkStiffness(Law):
    """Flexibility of a link times (1 + fraction), exactly."""

    id = "link_stiffness"
    stage = "parts"
    places: tuple[str, ...] = LINKS
    sentence = "{place} bends more (or less) than modelled"
    check = "compare the link's section and material with the drawing; look for a crack"
    excited_by = "loads of several sizes and directions at poses all over the workspace"
    inexactness = 0.03
    own = (Parameter("flexibility_percent", -90.0, 10000.0, 30.0, linear=False),)

    def changed(self, parts: ElasticComponents, place: str, values: SIValues) -> ElasticComponents:
        """Return the parts with one of them scaled."""
        factor = 1.0 + values["flexibility_percent"]
        flexibility = parts.flexibility.copy()
        flexibility[ELASTIC.index(place)] *= factor
        contact = dict(parts.contact)
        if place in contact:
            flange = contact[place]
            contact[place] = replace(
                flange,
                screw=factor * flange.screw,
                approach=factor * flange.approach,
                weight_approach=factor * flange.weight_approach,
            )
        return replace(parts, flexibility=flexibility, contact=contact)


class BushingStiffness(LinkStiffness):
    """The same of a bushing, whose flanges scale with it."""

    id = "bushing_stiffness"
    places = JOINTS
    sentence = "the bushing of {place} gives more (or less) than modelled"
    check = "check the bushing's material, moisture and length; swap it for a new one"


KEYS = tuple(f"{axis}_um_per_N" for axis in "xyz") + tuple(
    f"turn_{axis}_mdeg_per_Nm" for axis in "xyz"
)

PAIRS = ((0, 1), (0, 2), (1, 2))

COUPLINGS: dict[str, tuple[int, int]] = {
    **{f"{'xyz'[i]}{'xyz'[j]}_um_per_N": (i, j) for i, j in PAIRS},
    **{f"turn_{'xyz'[i]}{'xyz'[j]}_mdeg_per_Nm": (3 + i, 3 + j) for i, j in PAIRS},
    **{f"{'xyz'[i]}_about_{'xyz'[j]}_um_per_Nm": (i, 3 + j) for i in range(3) for j in range(3)},
}
"""Places of the couplings in the symmetric compliance: those of a spring whose axes are turned
against the body's, or whose centre is not the given point."""

COUPLED = {"um_per_N": (1e3, 0.5), "mdeg_per_Nm": (1e5, 50.0), "um_per_Nm": (1e5, 20.0)}
"""Bound and typical magnitude of a coupling by its unit."""


class MountCompliance(Law):
    """Spring between frame and motor, at the centre of the motor's bushing.

    Compliances along and about x, y and z of the place's body at home, through that point.
    Couplings between them are zero for a spring that lies along these axes and through the point.
    """

    id = "mount_compliance"
    stage = "reaction"
    places: tuple[str, ...] = MOTORS
    sentence = "the bracket of {place} gives"
    check = (
        "tighten the bracket's screws; put a dial gauge on the motor housing and load the wrist; "
        "where it stands still, look for a crack at the root of the link"
    )
    excited_by = "loads of several directions at poses all over the workspace"
    inexactness = 0.03
    own = (
        *(Parameter(key, 0.0, 1e3, 1.0) for key in KEYS[:3]),
        *(Parameter(key, 0.0, 1e5, 100.0) for key in KEYS[3:]),
        *(symmetric(key, *COUPLED["_".join(key.split("_")[-3:])]) for key in COUPLINGS),
    )

    def possible(self, values: Mapping[str, Array]) -> NDArray[np.bool_]:
        """Tell which springs yield to every load: no other gives back more than it got."""
        left = _compliance(values)
        possible = np.ones(len(left), dtype=bool)
        # Pivots of an elimination; for so many small matrices far quicker than eigenvalues.
        while left.shape[-1]:
            pivot, beside = left[:, 0, 0], left[:, 1:, 0]
            possible &= pivot >= 0.0
            share = beside / np.where(pivot > 0.0, pivot, 1.0)[:, None]
            left = left[:, 1:, 1:] - beside[:, :, None] * share[:, None, :]
        return possible

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the deflection under the wrench through the place."""
        to_origin = _to_origin(at.table.geometry, place)
        whole = to_origin @ _compliance(values) @ to_origin.T
        return at.screw(place, at.at_home(place, at.through_place(place)) @ whole)


def _compliance(values: Mapping[str, float] | Mapping[str, Array]) -> Array:
    """Return the symmetric compliances (..., 6, 6) of values that are numbers or (n,) each."""
    places = {**{key: (i, i) for i, key in enumerate(KEYS)}, **COUPLINGS}
    found = np.zeros((*np.shape(values[KEYS[0]]), 6, 6))
    for key, (i, j) in places.items():
        found[..., i, j] = found[..., j, i] = values.get(key, 0.0)
    return found


@lru_cache(maxsize=32)
def _to_origin(geometry: Geometry, place: str) -> Array:
    """Return what takes screws at the point of a place's spring at home to O, (6, 6)."""
    if place == "frame":
        return np.eye(6)
    if place == "platform":
        return screws_to_origin(geometry.platform.centre)
    return screws_to_origin(bushing_centre(geometry, MOTOR_JOINT[place]))


class FrameCompliance(MountCompliance):
    """Spring between F and both motors, through O."""

    id = "frame_compliance"
    places = ("frame",)
    sentence = "the frame under both motors gives"
    check = "tighten the frame's screws; measure a target on the frame while the wrist is loaded"
    excited_by = "loads of several directions and sizes; moments of both signs"


class PlatformCompliance(MountCompliance):
    """Spring between the joints' hubs and the plate with tool and target, at the plate's centre."""

    id = "platform_compliance"
    places = ("platform",)
    sentence = "the platform, its screws or the tool's holder give"
    check = "tighten the tool's and the target's screws; tap the tool and watch the target"
    excited_by = "loads of several directions at different tilts"


class DriveCompliance(Law):
    """Windup of a drive: the output turns by compliance times the torque about the motor's axis."""

    id = "drive_compliance"
    stage = "reaction"
    places = MOTORS
    sentence = "the gearbox of {place} winds up under torque"
    check = "lock the motor, load the link with a weight and a dial gauge, compare both directions"
    excited_by = "loads with a torque about the motor axis, of both signs"
    inexactness = 0.03
    own = (Parameter("compliance_mdeg_per_Nm", 0.0, 1e6, 500.0),)

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the turn."""
        axis = at.table.geometry.axes[MOTOR_JOINT[place]]
        torque = at.through_place(place)[:, 3:] @ axis
        return at.motor_turn(place, values["compliance_mdeg_per_Nm"] * torque)
