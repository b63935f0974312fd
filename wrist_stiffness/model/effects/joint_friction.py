"""Dry friction of a cylindrical joint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.effects.joint_clearance import end_screws
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation, lengths

LEAST_BUDGET = 1e-9
"""[N]; keeps the stiffness of a joint without bearing force finite."""


class JointFriction(Law):
    """One Coulomb budget shared by turn and slide, with pre-sliding.

    The pin's surface moves along (radius times turn, slide).  It is held by a bristle before it
    slips, in series with the limb's own flexibility.  The bristle bends by a distance, as rough
    surfaces do whose contacts grow with the load (Greenwood and Williamson), and by so much a
    newton, as a lining does and the bristles of Dahl and LuGre of one stiffness; the force
    never exceeds coefficient times (pressing forces + preload).  While the joint turns the budget
    is spent there and the slide is free; at rest it locks.
    """

    id = "joint_friction"
    stage = "friction"
    places = PASSIVE_JOINTS
    sentence = "{place} rubs: the pose depends on the way it was reached"
    check = "turn the joint by hand; clean it; compare an approach under load with a load at rest"
    excited_by = "approaches from both sides, and loads applied at rest against carried through"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return coefficient, preload, pre-sliding distance and flexibility of the bristle."""
        return (
            Parameter("coefficient", 0.0, 2.0, 0.1, linear=False),
            Parameter("preload_N", 0.0, 100.0, 1.0, linear=False),
            Parameter("presliding_um", 0.01, 200.0, 5.0, mean=5.0, linear=False),
            Parameter("bristle_um_per_N", 0.0, 1000.0, 10.0, linear=False),
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the friction force and torque; the state is the bristle's foot."""
        geometry = at.table.geometry
        radius = 0.5 * geometry.bushings[place].pin_diameter
        pressed = pressing(geometry, place, at.at_home(place, at.through_place(place)))
        budget = values["coefficient"] * (pressed + values["preload_N"]) + LEAST_BUDGET
        bristle = values["presliding_um"] / budget + values["bristle_um_per_N"]
        slide, turn = at.slide_flexibility(place)
        moved = np.stack(
            [radius * at.turn(place), at.slides[:, PASSIVE_JOINTS.index(place)]], axis=1
        )
        compliance = np.stack([bristle + radius**2 * turn, bristle + slide], axis=1)
        start = moved[0] if state is None else state
        force, foot = slip(moved, compliance, budget, start)
        return at.joint_push(place, -force[:, 1], -radius * force[:, 0]), foot


def pressing(geometry: Geometry, joint: str, wrench: Array) -> Array:
    """Return the sum of the radial forces at both ends of a sleeve; a moment presses both.

    Parameters
    ----------
    geometry : Geometry
        Of the wrist.
    joint : str
        The joint.
    wrench : (n, 6) float
        Carried by the joint, at O in its home frame [N, N m].

    Returns
    -------
    (n,) float
        [N].
    """
    ends = wrench @ end_screws(geometry, joint).T
    return np.asarray(lengths(ends[:, :2]) + lengths(ends[:, 2:]))


def slip(moved: Array, compliance: Array, budget: Array, foot: Array) -> tuple[Array, Array]:
    """Follow a bristle that slips when its force exceeds a budget.

    Parameters
    ----------
    moved : (n, 2) float
        Where the surface goes [m].
    compliance : (n, 2) float
        Of the bristle along both directions [m/N].
    budget : (n,) float
        Largest force [N].
    foot : (2,) float
        Where the bristle stands at first [m].

    Returns
    -------
    force : (n, 2) float
        With which the bristle is dragged along [N].
    foot : (2,) float
        Where it stands at last [m].
    """
    force = np.empty_like(moved)
    x, y = float(foot[0]), float(foot[1])
    rows = zip(moved.tolist(), compliance.tolist(), budget.tolist(), strict=True)
    for row, ((u, v), (cu, cv), limit) in enumerate(rows):
        fu, fv = (u - x) / cu, (v - y) / cv
        size = math.hypot(fu, fv)
        if size > limit:
            fu, fv = fu * limit / size, fv * limit / size
            x, y = u - cu * fu, v - cv * fv
        force[row] = fu, fv
    return force, np.array([x, y])
