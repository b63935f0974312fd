"""A solid of revolution as ten-node tetrahedra, swept from a mesh of its half section.

The section's triangles become a ring of prisms, each prism three tetrahedra.  Every diagonal runs
from the lower-numbered corner of the section at the start of an arc to the higher-numbered one at
its end, so neighbours agree and the mesh is exactly symmetric under turns by one arc.
"""

from __future__ import annotations

import numpy as np
from netgen.occ import OCCGeometry
from numpy.typing import NDArray
from skfem import MeshTet2

from wrist_stiffness.fem.mesh import SolidMesh, generate_mesh, match_facets
from wrist_stiffness.fem.solids import FLANGES, MILLIMETRES

SECTORS = 4
"""Contact sectors of each ring of a flange, equal in angle, counted from the bushing's x towards
its y.  Twice as many change s and phi by less than 0.2 % (docs/walls.md)."""

PRISM_TETS = ((0, 1, 2, 5), (0, 1, 4, 5), (0, 3, 4, 5))
"""Corners of the three tetrahedra of a prism whose corners 0 < 1 < 2 end in 3, 4, 5."""

PRISM_QUAD = ((0, 1, 3), (0, 3, 2))
"""Corners of the two triangles on the side of a prism over the edge 0 < 1 that ends in 2, 3."""

TET_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def revolve(section: OCCGeometry, arcs_per_sector: int) -> SolidMesh:
    """Mesh a half section with triangles and sweep it around the axis.

    `section`: from `solids.bushing_section`: x = radius, y = place along the axis, in millimetres;
    `arcs_per_sector`: prisms along each sector of the circumference.  Gives `SolidMesh`: in metres,
    about z.  Surfaces are the section's named edges; a ring of a flange is split into sectors,
    `inner_0` into `inner_0_0` ... `inner_0_3`.  Raises `GeometryError` if the section cannot be
    meshed.
    """
    plane = generate_mesh(section)
    corners = plane.Coordinates()[:, :2] / MILLIMETRES
    triangles = np.sort(plane.Elements2D().NumPy()["nodes"][:, :3].astype(np.int64) - 1, axis=1)
    segments = plane.Elements1D().NumPy()
    edges = np.sort(segments["nodes"][:, :2].astype(np.int64) - 1, axis=1)
    names = np.array([plane.GetBCName(int(k) - 1) for k in segments["index"]])

    arcs = SECTORS * arcs_per_sector
    arc_angle = 2.0 * np.pi / arcs
    # Node numbers run on past the last arc here, so that middles of arcs that close the circle
    # get the right angle; the numbers wrap only in the finished elements.
    prisms = _sweep(triangles, len(corners), arcs)
    tets = prisms[:, list(PRISM_TETS)].reshape(-1, 4)
    pairs = np.sort(tets[:, list(TET_EDGES)], axis=2).reshape(-1, 2)
    cylindrical = np.column_stack(
        [
            np.tile(corners, (arcs + 1, 1)),
            arc_angle * np.repeat(np.arange(arcs + 1), len(corners)),
        ]
    )
    middles = cylindrical[pairs].mean(axis=1)
    wrap = len(corners) * arcs
    unique, middle_of = np.unique(np.sort(pairs % wrap, axis=1), axis=0, return_inverse=True)
    first = np.zeros(len(unique), dtype=np.int64)
    first[middle_of] = np.arange(len(middle_of))
    radius, height, angle = np.concatenate([cylindrical[:wrap], middles[first]]).T
    nodes = np.stack([radius * np.cos(angle), radius * np.sin(angle), height])
    elements = np.column_stack([tets % wrap, wrap + middle_of.reshape(-1, 6)])
    mesh = MeshTet2(nodes, elements.T)

    surfaces = {}
    sector_of = np.tile(np.arange(arcs) // arcs_per_sector, (2, 1)).T.ravel()
    for name in np.unique(names[names != "default"]):
        quads = _sweep(edges[names == name], len(corners), arcs)
        faces = quads[:, list(PRISM_QUAD)].reshape(len(quads) // arcs, arcs * 2, 3) % wrap
        if name.startswith(FLANGES):
            for sector in range(SECTORS):
                surfaces[f"{name}_{sector}"] = match_facets(
                    mesh, faces[:, sector_of == sector].reshape(-1, 3)
                )
        else:
            surfaces[str(name)] = match_facets(mesh, faces.reshape(-1, 3))
    return SolidMesh(mesh, surfaces, slices=arcs)


def _sweep(cells: NDArray[np.int64], count: int, arcs: int) -> NDArray[np.int64]:
    """Corners of the swept cells (cell by cell, arc by arc): start of the arc, then its end."""
    start = cells[:, None, :] + count * np.arange(arcs)[None, :, None]
    return np.concatenate([start, start + count], axis=2).reshape(-1, 2 * cells.shape[1])
