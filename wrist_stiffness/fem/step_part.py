"""A link drawn in CAD: from a STEP file with named bores to its 6 x 6 stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from netgen.libngpy._meshing import NgException
from netgen.occ import OCCGeometry
from scipy.linalg import eigvalsh

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.fem.mesh import SolidMesh, mesh_solid
from wrist_stiffness.fem.parts import assemble_mesh, wrist_parts
from wrist_stiffness.fem.solids import MILLIMETRES, MeshSettings
from wrist_stiffness.fem.superelement import frame_stiffness
from wrist_stiffness.inputs.opening import open_input
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.fits import WIDEST_FIT
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.material import OrthotropicMaterial

COARSER = 1.25
"""Element sizes of the second mesh, as between the levels of a table's mesh study."""


@dataclass(frozen=True)
class StepPart:
    """A link as its STEP file draws it."""

    # (6, 6), between the two bores' frames, at O in F with the wrist at home [N/m, N, N m]
    stiffness: Array
    elements: int  # of its mesh
    # how much stiffer it is on elements `COARSER` times as large, in the worst direction [-]
    coarser: float


def step_part(path: Path, geometry: Geometry, link: str, sizes: MeshSettings) -> StepPart:
    """Mesh and condense a link's STEP file onto its bores.

    `path`: one solid, drawn in F with the wrist at home and O at the origin; its faces `motor_bore`
    and `platform_bore` are held.  `geometry`: for the link's material and the axes of its bores.
    `link`: its name.  `sizes`: element sizes.  Gives `StepPart`: with both bores rigid.  Raises
    `GeometryError` if the file is no such solid, or its bores are not where the geometry has them.
    """
    solid = wrist_parts(geometry)[ELASTIC.index(link)].solid
    if isinstance(solid.material, OrthotropicMaterial):
        raise GeometryError(
            f"{path}: {link} is of an orthotropic material, whose axes follow the arc of a bar; "
            "a STEP file may have any shape"
        )
    found = []
    for factor in (COARSER, 1.0):
        mesh = _mesh(path, sizes.times(factor))
        _check_bores(path, mesh, geometry, link)
        body = assemble_mesh(solid, mesh)
        stiffness, *_ = frame_stiffness(body, np.zeros((3 * len(mesh.nodes), 0)))
        found.append(stiffness[6:, 6:])
    coarse, fine = found
    stiffer = float(eigvalsh(coarse, fine)[-1]) - 1.0
    return StepPart(fine, len(mesh.elements), stiffer)


def _mesh(path: Path, sizes: MeshSettings) -> SolidMesh:
    open_input(path, GeometryError).close()
    try:
        shape = OCCGeometry(str(path)).shape
    except NgException as error:
        raise GeometryError(f"{path}: not a STEP file that can be read") from error
    if len(shape.solids) != 1:
        raise GeometryError(f"{path}: {len(shape.solids)} solids, must be one")
    named = {face.name for face in shape.faces if face.name}
    for bore in ("motor_bore", "platform_bore"):
        if bore not in named:
            others = f"; named are {', '.join(sorted(named))}" if named else "; none has a name"
            raise GeometryError(f"{path}: no face is called {bore}{others}")
    for face in shape.faces:
        if face.name in ("motor_bore", "platform_bore"):
            face.maxh = MILLIMETRES * sizes.bore
    shape.solids.maxh = MILLIMETRES * sizes.link
    return mesh_solid(OCCGeometry(shape))


def _check_bores(path: Path, mesh: SolidMesh, geometry: Geometry, link: str) -> None:
    """Refuse a file in other axes or units: every point of a bore is a radius from its axis."""
    dimensions = geometry.links[link]
    walls = (("motor_bore", dimensions.motor_bore), ("platform_bore", dimensions.platform_bore))
    for (name, diameter), axis in zip(walls, geometry.link_ends(link), strict=True):
        points = mesh.nodes[mesh.surface_nodes(name)]
        radius = np.linalg.norm(np.cross(points, axis), axis=1)
        along = points @ axis
        if np.abs(radius - diameter / 2.0).max() > WIDEST_FIT or along.min() < 0.0:
            raise GeometryError(
                f"{path}: face {name} is {1e3 * radius.min():.2f} to {1e3 * radius.max():.2f} mm "
                f"from its joint's axis, {1e3 * along.min():.1f} to {1e3 * along.max():.1f} mm "
                f"from O along it; the bore of {link} has a radius of {5e2 * diameter:g} mm "
                "(draw in mm, in F, with O at the origin)"
            )
