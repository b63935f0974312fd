"""What the compiled formulas must know of a wrist, in the order of the structures in `native/`."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import CARRIER, ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.cones import GRAM_ROUNDING
from wrist_stiffness.mechanism.configuration import BODIES
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.influence import LIMB_1, LIMB_2
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.vectors import skew

GROUPS = tuple(
    tuple(name for name in limb if CARRIER[name] == body)
    for limb, body in (
        (LIMB_1, "frame"),
        (LIMB_1, "link_1"),
        (LIMB_2, "frame"),
        (LIMB_2, "link_2"),
        (LIMB_2, "link_3"),
    )
)
"""Elastic components that lie in one limb and turn with one body."""


def mechanism_constants(
    mechanism: Mechanism, rectangle: tuple[Array, Array], limits: Limits
) -> Array:
    """Return what `native` must know of a kinematic scheme and its domain."""
    turn = np.zeros((24, 5))
    driven = np.stack([mechanism.b0, mechanism.d0])
    axes = np.stack([mechanism.a1, mechanism.a2])
    for i in range(2):
        along = np.outer(axes[i], axes[i])
        parts = np.stack([along, np.eye(3) - along, skew(axes[i])], axis=-1)
        columns = [0, 1 + 2 * i, 2 + 2 * i]
        turn[9 * i : 9 * i + 9, columns] = np.swapaxes(parts, 0, 1).reshape(9, 3)
        turn[18 + 3 * i : 21 + 3 * i, columns] = np.swapaxes(parts, 1, 2) @ driven[i]
    homes = [np.stack([each, mechanism.c0, np.cross(each, mechanism.c0)]) for each in driven]
    return np.concatenate(
        [
            turn.ravel(),
            np.linalg.inv(homes).ravel(),
            axes.ravel(),
            [mechanism.b0 @ mechanism.c0, mechanism.c0 @ mechanism.d0],
            [mechanism.assembly_mode, GRAM_ROUNDING],
            np.transpose(rectangle).ravel(),
            [limits.singularity, *limits.most_load],
        ]
    )


def parts_constants(
    components: ElasticComponents,
    gravity: Array,
    screws: Array | None,
    opening: Array | None,
    load_scale: float,
    load_added: Array | None,
) -> Array:
    """Return what `native` must know of the elastic parts and of what is constant."""
    sectors = components.sectors
    m, bodies = len(sectors.gap), len(BODIES)
    flexibility, weight_screw = np.zeros((len(GROUPS), 6, 6)), np.zeros((len(GROUPS), 6, 3))
    group_of, weight_gap = np.zeros((m, 1)), np.zeros((m, 3))
    weight = np.zeros((bodies, 6, 3))
    for group, names in enumerate(GROUPS):
        carried = np.zeros((6, 3))
        for name in reversed(names):
            k = ELASTIC.index(name)
            own = sectors.component == k
            here = carried + components.weight_platform_side[k]
            flexibility[group] += components.flexibility[k]
            weight_screw[group] += components.flexibility[k] @ here
            group_of[own] = group
            weight_gap[own] = sectors.weight_approach[own] + sectors.screw[own] @ here
            carried = here + components.weight_motor_side[k]
        weight[BODIES.index(CARRIER[names[0]])] = carried
    weight[BODIES.index("platform")] = components.platform_weight
    gap = sectors.gap if opening is None else sectors.gap + opening
    rows = [group_of, sectors.slide, sectors.screw, weight_gap, gap[:, None]]
    return np.concatenate(
        [
            gravity,
            [load_scale],
            np.zeros(6) if load_added is None else load_added,
            flexibility.ravel(),
            weight_screw.ravel(),
            np.zeros(6 * len(GROUPS)) if screws is None else screws.ravel(),
            weight.ravel(),
            np.hstack(rows).ravel(),
            sectors.approach.ravel(),
        ]
    )
