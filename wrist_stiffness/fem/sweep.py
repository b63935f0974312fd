"""The offline sweep: from a geometry to its lookup table with stated errors.

The parts are condensed once by solid FEM; a pose then costs microseconds, so the grid is refined
until poses that the splines never saw agree with the closed form to the tolerance.
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
from wrist_stiffness.fem.convergence import QUANTITIES, mesh_convergence
from wrist_stiffness.fem.error_budget import error_budget
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.fem.superelement import Interface
from wrist_stiffness.lookup.biharmonic import Kernel
from wrist_stiffness.lookup.operators import pack
from wrist_stiffness.lookup.rated_load import rated_map
from wrist_stiffness.lookup.table import Evaluation, Table, TableHeader
from wrist_stiffness.lookup.verification import interpolation_errors, unseen_poses
from wrist_stiffness.mechanism.components import ELASTIC, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import geometry_from_values, mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace
from wrist_stiffness.progress import Progress, silent

GRIDS = (5, 9, 13, 17, 21, 25, 31, 37)
"""Points along each motor angle that are tried until the tolerance is met."""

DOMAIN_FACTOR = 4.0
"""The whole map may err by this times the tolerance of the operative workspace."""

MESH_FACTORS = (1.5625, 1.25, 1.0)
"""Element sizes of the mesh study over those of the table, which is the last."""

MESH_POSES = 12
"""Operative poses over which the mesh study averages."""


@dataclass(frozen=True)
class BuildSettings:
    """How a table is built.

    Parameters
    ----------
    sizes : MeshSettings
        Element sizes [m].
    interface : str
        Interface model of the condensation.
    evaluation : str
        What the nodes shall use.
    kernel : str
        Kernel of the splines.
    tolerance : float
        Largest relative error of the interpolated s and phi in the operative workspace.
    per_axis : int or None
        Fixed number of grid points along each angle; None refines until the tolerance is met.
    """

    sizes: MeshSettings = SHIPPED_SIZES
    interface: Interface = "rigid"
    evaluation: Evaluation = "closed_form"
    kernel: Kernel = "thin_plate"
    tolerance: float = 0.005
    per_axis: int | None = None


def build_table(
    values: Mapping[str, Any],
    settings: BuildSettings,
    progress: Progress = silent,
    condenser: Condenser = condense_solid,
) -> Table:
    """Run the sweep.

    Parameters
    ----------
    values : mapping
        As a geometry file reads.
    settings : BuildSettings
        Mesh, interface, grid.
    progress : callable
        Called with steps done and in all.
    condenser : callable
        `condense_solid`, or a `CondensedStore` for a build that can be resumed.

    Returns
    -------
    Table
        With its stated errors in the header; not yet written.

    Raises
    ------
    GeometryError
        If the geometry is wrong.
    TableError
        If nodes shall use splines and no grid meets the tolerance.
    """
    geometry = geometry_from_values(values)
    steps = len(ELASTIC) + len(MESH_FACTORS) + 1
    # The mesh study ends with the table's own mesh, which is there already.
    condenser = cache(condenser)
    components, provenance = elastic_components(
        geometry,
        settings.sizes,
        settings.interface,
        lambda done, of, name: progress(done, steps),
        condenser,
    )
    study = mesh_convergence(
        geometry,
        _operative_configuration(geometry),
        settings.sizes,
        MESH_FACTORS,
        settings.interface,
        condenser,
        lambda done, of: progress(len(ELASTIC) + done, steps),
    )
    by_mesh = np.abs(study.errors()[-1])

    header = TableHeader(
        geometry=dict(values),
        interface=settings.interface,
        evaluation=settings.evaluation,
        kernel=settings.kernel,
        per_axis=0,
        mesh={
            "sizes_mm": {key: round(1e3 * v, 9) for key, v in asdict(settings.sizes).items()},
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
            f"splines still err by {_worst(errors, 'operative'):.3g} in the operative workspace "
            f"and by {_worst(errors, 'domain'):.3g} in the domain "
            f"(at most {DOMAIN_FACTOR * settings.tolerance:g}); --evaluation closed_form needs none"
        )
    budget = error_budget(
        geometry, components, study, settings.sizes, settings.interface, condenser
    )
    worst = {name: max(halves.values(), default=0.0) for name, halves in budget.items()}
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
                "mesh_mean": dict(zip(QUANTITIES, by_mesh.tolist(), strict=True)),
                **errors,
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
    return max(errors["predicted"][region].values())


def _meets(errors: Mapping[str, Any], tolerance: float) -> bool:
    return (
        _worst(errors, "operative") <= tolerance
        and _worst(errors, "domain") <= DOMAIN_FACTOR * tolerance
    )


def _operative_configuration(geometry: Geometry) -> Configuration:
    mechanism = mechanism_of(geometry)
    poses = unseen_poses(Workspace(mechanism, geometry.limits))
    inside = poses[Workspace(mechanism, geometry.limits).operative(poses)]
    return mechanism.forward(inside[:MESH_POSES])
