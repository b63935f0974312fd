"""Second-order tetrahedral meshes with named surfaces: from netgen's mesh to scikit-fem's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from netgen.meshing import Mesh as NetgenMesh
from netgen.occ import OCCGeometry
from numpy.typing import NDArray
from skfem import MeshTet2

from wrist_stiffness.fem.solids import MILLIMETRES
from wrist_stiffness.mechanism.components import Array

SKFEM_TET10 = (0, 1, 2, 3, 4, 7, 5, 6, 8, 9)
"""Netgen's ten nodes in the order 4 vertices, edges 01, 12, 02, 03, 13, 23 (C3D10 and VTK too)."""


@dataclass(frozen=True)
class SolidMesh:
    """Ten-node tetrahedra of one solid.

    Parameters
    ----------
    tets : MeshTet2
        The mesh, in metres; curved elements at curved faces.
    surfaces : dict of str to (n,) int
        Facet numbers of each named surface.
    """

    tets: MeshTet2
    surfaces: dict[str, NDArray[np.int64]]

    @property
    def nodes(self) -> Array:
        """Places of all nodes, vertices first, then the middles of the edges (n, 3) [m]."""
        return np.ascontiguousarray(self.tets.doflocs.T)

    @property
    def elements(self) -> NDArray[np.int64]:
        """Node numbers of the tetrahedra in the order of `SKFEM_TET10` (n, 10)."""
        return np.asarray(self.tets.dofs.element_dofs.T, dtype=np.int64)

    def surface_nodes(self, name: str) -> NDArray[np.int64]:
        """Node numbers on a named surface, sorted (n,)."""
        facets = self.surfaces[name]
        vertices = self.tets.facets[:, facets]
        edges = self.tets.dofs.edge_dofs[0][self.tets.f2e[:, facets]]
        return np.unique(np.concatenate([vertices.ravel(), edges.ravel()])).astype(np.int64)


def mesh_solid(shape: OCCGeometry) -> SolidMesh:
    """Mesh a shape with ten-node tetrahedra of the sizes stored in it.

    Parameters
    ----------
    shape : OCCGeometry
        From `solids.py`, in millimetres; a shape is meshed once (the kernel keeps the first sizes).

    Returns
    -------
    SolidMesh
        In metres.
    """
    netgen = shape.GenerateMesh()
    netgen.SecondOrder()
    volume = netgen.Elements3D().NumPy()["nodes"][:, list(SKFEM_TET10)].astype(np.int64) - 1
    places = netgen.Coordinates() / MILLIMETRES
    tets = MeshTet2(places.T, volume.T)
    return SolidMesh(tets, _named_surfaces(netgen, volume[:, :4], tets))


def _named_surfaces(
    netgen: NetgenMesh, corners: NDArray[np.int64], tets: MeshTet2
) -> dict[str, NDArray[np.int64]]:
    """Facets by surface name; scikit-fem has renumbered the vertices in ascending order."""
    surface = netgen.Elements2D().NumPy()
    vertices = np.unique(corners)
    triangles = np.sort(np.searchsorted(vertices, surface["nodes"][:, :3].astype(np.int64) - 1))
    facet_keys = _triple_key(np.sort(tets.facets.T, axis=1), len(vertices))
    order = np.argsort(facet_keys)
    found = order[np.searchsorted(facet_keys[order], _triple_key(triangles, len(vertices)))]
    names = np.array([face.bcname for face in netgen.FaceDescriptors()])
    name_of = names[surface["index"] - 1]
    return {
        str(name): np.unique(found[name_of == name]) for name in np.unique(names) if name != "default"
    }


def _triple_key(triangles: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return (triangles[:, 0].astype(np.int64) * count + triangles[:, 1]) * count + triangles[:, 2]
