"""What a table leaves out, as bounds that random poses and loads of its domain have met.

At every draw each contribution is the difference between two solutions that differ in one thing
alone; their lengths add up, for they may point the same way.  What is stated covers all but one in
a hundred of the sums, so it is a bound and no mean.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.fem.components import Condenser, elastic_components
from wrist_stiffness.fem.convergence import Convergence
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
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

DRAWS, LIFTING_DRAWS = 400, 100
"""Poses and loads; fewer where sliding walls that lift off are solved at each of them."""

FINE_RINGS = 4
"""Rings over a flange's width that are right to 0.1 % (docs/walls.md)."""


def error_budget(
    geometry: Geometry,
    components: ElasticComponents,
    study: Convergence,
    sizes: MeshSettings,
    interface: Interface,
    condenser: Condenser,
) -> dict[str, Any]:
    """State what the mesh, the flanges' discretisation and two-sided walls leave out.

    Parameters
    ----------
    geometry : Geometry
        The wrist.
    components : ElasticComponents
        Of the table.
    study : Convergence
        Mesh study that ends with the table's mesh.
    sizes : MeshSettings
        The table's element sizes.
    interface : {"rigid", "distributing", "sliding"}
        How walls follow their frames.
    condenser : callable
        `condense_solid`, or one that remembers.

    Returns
    -------
    dict
        `mesh`, `contact` and `walls` (empty unless the bushings slide): error of s and phi,
        relative to their lengths, that `STATED` of the draws keep; `stated`: that of the sums.
    """
    workspace = Workspace(mechanism_of(geometry), geometry.limits)
    lifts = interface == "sliding"
    poses = unseen_poses(workspace)[: LIFTING_DRAWS if lifts else DRAWS]
    loads = random_loads(geometry.limits, len(poses), np.random.default_rng(UNSEEN_SEED))
    configuration = mechanism_of(geometry).forward(poses)

    def twist(parts: ElasticComponents) -> Array:
        return respond(contact_operators(configuration, parts, geometry.gravity), loads).twist

    def condensed(factor: float, rings: int = 1) -> ElasticComponents:
        return elastic_components(
            geometry, sizes.times(factor), interface, condenser=condenser, rings=rings
        )[0]

    before = study.factors[-2]
    # What is left of the mesh's error is this part of its last step.
    left = 1.0 / ((before / study.factors[-1]) ** study.order[: len(HALVES)] - 1.0)
    misses = {
        "mesh": left * relative_misses(twist(condensed(before)), twist(components)),
        "contact": relative_misses(twist(components), twist(condensed(1.0, FINE_RINGS))),
    }
    if lifts:
        coarse = sizes.times(study.factors[0])
        misses["walls"] = lifting_misses(geometry, components, coarse, poses, loads)
    misses["stated"] = np.sum(list(misses.values()), axis=0)
    bounds = {
        name: dict(zip(HALVES, np.quantile(miss, STATED, axis=0).tolist(), strict=True))
        for name, miss in misses.items()
    }
    return {"walls": {}, **bounds}
