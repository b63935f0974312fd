"""What a table leaves out, as bounds that random poses and loads of its domain have met.

At every draw each contribution is the difference between two solutions that differ in one thing
alone; their lengths add up, for they may point the same way.  What is stated covers all but one in
a hundred of the sums, so it is a bound and no mean.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np

from wrist_stiffness.fem.components import Condenser, elastic_components
from wrist_stiffness.fem.one_sided import lifting_misses
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.fem.superelement import Interface
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.verification import (
    HALVES,
    STATED,
    UNSEEN_SEED,
    random_loads,
    relative_misses,
    unseen_poses,
)
from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, LINKS, Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

DRAWS, LIFTING_DRAWS = 400, 100
"""Poses and loads; fewer where sliding walls that lift off are solved at each of them."""

FINE_RINGS = 8
"""Rings over a flange's width that are right to 0.1 % (docs/walls.md)."""

LIFTING_SIZES = 1.5625
"""Element sizes of the walls that lift off over the table's."""

COARSER = 2.25
"""Element sizes of the coarser solution over the table's.  Twice is not enough: the number of
elements over a small part's thickness is whole, and a small step may leave it as it is."""

ORDERS = ((LINKS, 1.42), (JOINTS, 0.75))
"""Orders of the energy with the size of the elements: at the rim of a link's bore, where a held and
a free face meet at 90 degrees (stress singular with the exponent 0.71 at Poisson's ratio 0.3), and
at a bushing's hub corner under a flange, where they meet at 270 degrees."""


def error_budget(
    geometry: Geometry,
    components: ElasticComponents,
    sizes: MeshSettings,
    interface: Interface,
    rings: int,
    condenser: Condenser,
) -> dict[str, Any]:
    """State what the mesh, the flanges' discretisation and two-sided walls leave out.

    `interface`: how walls follow their frames; `rings`: the table's rings over the width of a
    flange; `condenser`: `condense_solid`, or one that remembers.  Gives `mesh`, `contact` and
    `walls` (empty unless the bushings slide): error of s and phi, relative to their lengths, that
    `STATED` of the draws keep; `stated`: that of the sums.
    """
    workspace = Workspace(mechanism_of(geometry), geometry.limits)
    lifts = interface == "sliding"
    poses = unseen_poses(workspace)[: LIFTING_DRAWS if lifts else DRAWS]
    loads = random_loads(geometry.limits, len(poses), np.random.default_rng(UNSEEN_SEED))
    configuration = mechanism_of(geometry).forward(poses)

    def twist(parts: ElasticComponents) -> Array:
        return respond(contact_operators(configuration, parts, geometry.gravity), loads).twist

    def condensed(factor: float, rings: int) -> ElasticComponents:
        return elastic_components(
            geometry, sizes.times(factor), interface, condenser=condenser, rings=rings
        )[0]

    found, coarse = twist(components), condensed(COARSER, rings)
    mesh = [
        relative_misses(twist(_with_parts(components, coarse, names)), found)
        / (COARSER**order - 1.0)
        for names, order in ORDERS
    ]
    misses = {
        "mesh": np.sum(mesh, axis=0),
        "contact": relative_misses(found, twist(condensed(1.0, FINE_RINGS))),
    }
    if lifts:
        misses["walls"] = lifting_misses(
            geometry, components, sizes.times(LIFTING_SIZES), poses, loads
        )
    misses["stated"] = np.sum(list(misses.values()), axis=0)
    bounds = {
        name: dict(zip(HALVES, np.quantile(miss, STATED, axis=0).tolist(), strict=True))
        for name, miss in misses.items()
    }
    return {"walls": {}, **bounds}


def _with_parts(
    components: ElasticComponents, other: ElasticComponents, names: Collection[str]
) -> ElasticComponents:
    """Exchange the named parts."""
    of_other = np.array([name in names for name in ELASTIC])
    rows = {
        name: np.where(of_other[:, None, None], getattr(other, name), getattr(components, name))
        for name in ("flexibility", "weight_motor_side", "weight_platform_side")
    }
    contact = {
        joint: (other if joint in names else components).contact[joint]
        for joint in components.contact
    }
    return replace(components, **rows, contact=contact)
