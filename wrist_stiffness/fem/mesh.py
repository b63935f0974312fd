"""Second-order tetrahedral meshes with named surfaces: from netgen's mesh to scikit-fem's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from netgen.libngpy._meshing import NgException
from netgen.meshing import Mesh as NetgenMesh
from netgen.occ import OCCGeometry
from numpy.typing import NDArray
from skfem import MeshTet2

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.fem.solids import MILLIMETRES
from wrist_stiffness.mechanism.components import Array

SKFEM_TET10 = (0, 1, 2, 3, 4, 7, 5, 6, 8, 9)
"""Netgen's ten nodes in the order 4 vertices, edges 01, 12, 02, 03, 13, 23 (C3D10 and VTK too)."""


@dataclass(frozen=True)
class SolidMesh:
    """Ten-node tetrahedra of one solid."""

    tets: MeshTet2  # the mesh, in metres; curved elements at curved faces
    # dict of str to (n,), facet numbers of each named surface
    surfaces: dict[str, NDArray[np.int64]]
    # equal turns about z that map the mesh, its bore and its hub wall onto themselves; 1 if none
    slices: int = 1

    @property
    def nodes(self) -> Array:
        """Places of all nodes, vertices first, then the middles of the edges (n, 3) [m]."""
        return np.ascontiguousarray(self.tets.doflocs.T)

    @property
    def elements(self) -> NDArray[np.int64]:
        """Node numbers of the tetrahedra in the order of `SKFEM_TET10` (n, 10)."""
        return np.asarray(self.tets.dofs.element_dofs.T, dtype=np.int64)

    def surface_triangles(self, name: str) -> NDArray[np.int64]:
        """Nodes of a named surface's triangles: corners, then middles of 01, 12, 02 (m, 6)."""
        facets = self.surfaces[name]
        middles = self.tets.dofs.edge_dofs[0][self.tets.f2e[:, facets]]
        return np.concatenate([self.tets.facets[:, facets], middles]).T.astype(np.int64)

    def surface_nodes(self, name: str) -> NDArray[np.int64]:
        """Node numbers on a named surface, sorted (n,)."""
        return np.unique(self.surface_triangles(name))


def mesh_solid(shape: OCCGeometry) -> SolidMesh:
    """Mesh a shape with ten-node tetrahedra of the sizes stored in it.

    `shape`: from `solids.py`, in millimetres; a shape is meshed once (the kernel keeps the first
    sizes).  Gives `SolidMesh`: in metres.  Raises `GeometryError` if the shape cannot be meshed.
    """
    netgen = generate_mesh(shape)
    netgen.SecondOrder()
    volume = netgen.Elements3D().NumPy()["nodes"][:, list(SKFEM_TET10)].astype(np.int64) - 1
    places = netgen.Coordinates() / MILLIMETRES
    tets = MeshTet2(places.T, volume.T)
    return SolidMesh(tets, _named_surfaces(netgen, volume[:, :4], tets))


def generate_mesh(shape: OCCGeometry) -> NetgenMesh:
    """Let netgen mesh a shape; a `GeometryError` if it cannot."""
    try:
        # Its threads make the same mesh and wait for each other five times as long.
        return shape.GenerateMesh(parallel_meshing=False)
    except NgException as error:
        raise GeometryError(f"the mesher gave up on a part: {error}") from error


def match_facets(tets: MeshTet2, triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Facet numbers of triangles given by their vertex numbers (n, 3), sorted and unique (m,)."""
    count = tets.nvertices
    keys = _triple_key(np.sort(tets.facets.T, axis=1), count)
    order = np.argsort(keys)
    found = np.searchsorted(keys[order], _triple_key(np.sort(triangles, axis=1), count))
    return np.unique(order[found]).astype(np.int64)


def _named_surfaces(
    netgen: NetgenMesh, corners: NDArray[np.int64], tets: MeshTet2
) -> dict[str, NDArray[np.int64]]:
    """Facets by surface name; scikit-fem has renumbered the vertices in ascending order."""
    surface = netgen.Elements2D().NumPy()
    triangles = np.searchsorted(np.unique(corners), surface["nodes"][:, :3].astype(np.int64) - 1)
    names = np.array([face.bcname for face in netgen.FaceDescriptors()])[surface["index"] - 1]
    return {
        str(name): match_facets(tets, triangles[names == name])
        for name in np.unique(names[names != "default"])
    }


def _triple_key(triangles: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return (triangles[:, 0].astype(np.int64) * count + triangles[:, 1]) * count + triangles[:, 2]
