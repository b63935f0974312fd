"""The offline sweep: from a geometry to its lookup table with stated errors.

The parts are condensed once by solid FEM; a pose then costs microseconds.  Mesh and contact rings
are refined until the error that they leave keeps the tolerance, the grid until the splines do at
poses that they never saw.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from wrist_stiffness import __version__
from wrist_stiffness.errors import TableError
from wrist_stiffness.fem.components import SHIPPED_SIZES, Condenser, elastic_components
from wrist_stiffness.fem.condensed_store import condense_solid
from wrist_stiffness.fem.error_budget import FINE_RINGS, error_budget
from wrist_stiffness.fem.parts import RINGS
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.fem.superelement import Interface
from wrist_stiffness.lookup.biharmonic import KERNEL
from wrist_stiffness.lookup.operators import pack
from wrist_stiffness.lookup.response import rated_map
from wrist_stiffness.lookup.table import Evaluation, Table, TableHeader
from wrist_stiffness.lookup.verification import interpolation_errors
from wrist_stiffness.mechanism.components import ELASTIC, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import geometry_from_values, mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace
from wrist_stiffness.progress import Progress, silent

GRIDS = (5, 9, 13, 17, 21, 25, 31, 37)
"""Points along each motor angle that are tried until the tolerance is met."""

OPERATIVE_SHARE = 0.25
"""Splines may err by this part of the tolerance in the operative workspace, where users compare
them with the closed form, and by all of it in the domain."""

FINER, FINEST = 0.8, 0.5
"""Step of the element sizes as a tolerance refines them, and the least ones over those asked for:
`table build --tolerance 0.01` of the shipped wrist gets there, 250,000 elements and 3.1 GB."""


@dataclass(frozen=True)
class BuildSettings:
    """How a table is built."""

    sizes: MeshSettings = SHIPPED_SIZES  # element sizes [m]
    interface: Interface = "rigid"  # interface model of the condensation
    evaluation: Evaluation = "closed_form"  # what the nodes shall use
    rings: int = RINGS  # contact modes over the width of a flange
    tolerance: float = 0.025  # relative error of s and phi that mesh, rings and grid are refined to
    # fixed number of grid points along each angle; None refines until the tolerance is met
    per_axis: int | None = None


def build_table(
    values: Mapping[str, Any],
    settings: BuildSettings,
    progress: Progress = silent,
    condenser: Condenser = condense_solid,
) -> Table:
    """Run the sweep.

    `progress`: called with steps done and in all; `condenser`: `condense_solid`, or a
    `CondensedStore` for a build that can be resumed.  Gives `Table`: with its stated errors in the
    header; not yet written.  They may exceed the tolerance where walls that lift off do, or where a
    finer mesh would need too much memory.  Raises `GeometryError` if the geometry is wrong;
    `TableError` if nodes shall use splines and no grid meets the tolerance.
    """
    geometry = geometry_from_values(values)
    steps = len(ELASTIC) + 2
    # What is refined leaves other parts as they were.
    condenser = cache(condenser)
    sizes, rings = settings.sizes, settings.rings
    while True:
        components, provenance = elastic_components(
            geometry,
            sizes,
            settings.interface,
            lambda done, of: progress(done, steps),
            condenser,
            rings,
        )
        budget = error_budget(geometry, components, sizes, settings.interface, rings, condenser)
        worst = {name: max(halves.values(), default=0.0) for name, halves in budget.items()}
        if worst["stated"] <= settings.tolerance:
            break
        if worst["contact"] > worst["mesh"] and 2 * rings < FINE_RINGS:
            rings *= 2
        elif FINER * sizes.link >= FINEST * settings.sizes.link and worst["mesh"] > worst["walls"]:
            sizes = sizes.times(FINER)
        else:
            break
    progress(steps - 1, steps)

    header = TableHeader(
        geometry=dict(values),
        interface=settings.interface,
        evaluation=settings.evaluation,
        kernel=KERNEL,
        per_axis=0,
        mesh={
            "sizes_mm": {key: round(1e3 * v, 9) for key, v in asdict(sizes).items()},
            "rings": rings,
            "nodes": provenance.nodes,
            "elements": provenance.elements,
        },
        versions={"wrist_stiffness": __version__, **provenance.packages},
        errors={},
    )
    for per_axis in (settings.per_axis,) if settings.per_axis else GRIDS:
        table = _on_grid(replace(header, per_axis=per_axis), components, geometry)
        errors = interpolation_errors(table)
        if settings.per_axis or _meets(errors, settings.tolerance):
            break
    # Nodes that do not use the splines need not wait for them; the table says how good they are.
    fixed = settings.per_axis is not None or settings.evaluation != "spline"
    if not fixed and not _meets(errors, settings.tolerance):
        raise TableError(
            f"no grid up to {GRIDS[-1]} x {GRIDS[-1]} meets the tolerance {settings.tolerance:g}: "
            f"splines still err by {_worst(errors, 'domain'):.3g} in the domain and by "
            f"{_worst(errors, 'operative'):.3g} in the operative workspace "
            f"(at most {OPERATIVE_SHARE * settings.tolerance:g}); --evaluation closed_form needs "
            "none"
        )
    stated = worst["stated"]
    if settings.evaluation == "spline":
        stated += _worst(errors, "operative")
    progress(steps, steps)
    return replace(
        table,
        header=replace(
            table.header,
            errors={
                "stated_relative": stated,
                "mesh_relative": worst["mesh"],
                "contact_relative": worst["contact"],
                "walls_relative": worst["walls"],
                **{name: budget[name] for name in ("mesh", "contact", "walls")},
                "predicted": errors,
            },
        ),
    )


def _on_grid(header: TableHeader, components: ElasticComponents, geometry: Geometry) -> Table:
    mechanism = mechanism_of(geometry)
    nodes = Workspace(mechanism, geometry.limits).grid(header.per_axis)
    configuration = mechanism.forward(nodes)
    return Table(
        header=header,
        components=components,
        nodes=nodes,
        operators=pack(contact_operators(configuration, components, geometry.gravity)),
        map_values=rated_map(
            configuration, contact_operators(configuration, components, np.zeros(3)), geometry
        ),
    )


def _worst(errors: Mapping[str, Any], region: str) -> float:
    return max(errors[region].values())


def _meets(errors: Mapping[str, Any], tolerance: float) -> bool:
    return (
        _worst(errors, "operative") <= OPERATIVE_SHARE * tolerance
        and _worst(errors, "domain") <= tolerance
    )
