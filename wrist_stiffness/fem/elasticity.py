"""Linear elasticity on ten-node tetrahedra: stiffness and consistent loads of one solid.

Unknowns are numbered node by node, x, y, z: unknown 3 n + a is direction a of node n.  The bases,
their gradients and the quadrature are scikit-fem's; the vector stiffness is put together from the
scalar gradients in one product per element, which is twenty times faster than a vector form.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from skfem import Basis, ElementTetP2, ElementTriP2
from skfem.models.poisson import mass
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from wrist_stiffness.fem.mesh import SolidMesh
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.material import AnyMaterial, Material, OrthotropicMaterial

FOUR_POINTS = 2
"""Order of the quadrature of a ten-node tetrahedron's stiffness: four points, as in other codes."""

LOAD_ORDER = 5
"""Order of the quadrature of loads: exact for shape function times volume of a curved element."""


def lame(material: Material) -> tuple[float, float]:
    """First and second Lame constants [Pa]."""
    e, nu = material.young, material.poisson
    return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))


def stiffness_matrix(mesh: SolidMesh, material: AnyMaterial) -> sparse.csr_matrix:
    """Stiffness of a solid.

    `material`: its material; the axes of an orthotropic one turn about z.  Gives (3 n, 3 n)
    symmetric positive semi-definite [N/m].
    """
    if isinstance(material, Material):
        block = _isotropic_blocks(mesh, material)
    else:
        block = _orthotropic_blocks(mesh, material)
    count = len(block)
    unknowns = (3 * mesh.elements[:, None, :] + np.arange(3)[None, :, None]).reshape(count, 30)
    rows = np.repeat(unknowns, 30, axis=1).ravel()
    columns = np.tile(unknowns, (1, 30)).ravel()
    size = 3 * len(mesh.nodes)
    matrix = sparse.csr_matrix((block.ravel(), (rows, columns)), shape=(size, size))
    return (matrix + matrix.T) * 0.5


def _isotropic_blocks(mesh: SolidMesh, material: Material) -> Array:
    """Stiffness of each element (e, 3, 10, 3, 10) [N/m]."""
    first, shear = lame(material)
    gradient, volume = _gradients(mesh)
    count = gradient.shape[0]
    # products[e, a, i, b, j] = integral of d_a N_i d_b N_j over element e
    weighted = (gradient * volume[:, None, None, :]).reshape(count, 30, -1)
    products = weighted @ gradient.reshape(count, 30, -1).transpose(0, 2, 1)
    products = products.reshape(count, 3, 10, 3, 10)
    laplacian = np.einsum("eaiaj->eij", products)
    block = first * products + shear * products.transpose(0, 3, 2, 1, 4)
    for a in range(3):
        block[:, a, :, a, :] += shear * laplacian
    return np.asarray(block)


def _orthotropic_blocks(mesh: SolidMesh, material: OrthotropicMaterial) -> Array:
    """Stiffness of each element (e, 30, 30) [N/m]; its axes turn about z from point to point."""
    elastic = np.linalg.inv(material.compliance)
    basis = Basis(mesh.tets, ElementTetP2(), intorder=FOUR_POINTS)
    place = np.asarray(basis.global_coordinates())
    gradient, volume = _gradients(mesh)
    count = len(gradient)
    block = np.zeros((count, 30, 30))
    for q in range(volume.shape[1]):
        axes = _axes_about_z(place[:2, :, q])
        slope = axes.transpose(0, 2, 1) @ gradient[..., q]
        # Strains 11, 22, 33, 23, 13, 12 by motion along each axis of each node.
        strain = np.zeros((count, 6, 3, 10))
        for a in range(3):
            strain[:, a, a] = slope[:, a]
        for row, (a, b) in enumerate(((1, 2), (0, 2), (0, 1)), 3):
            strain[:, row, a], strain[:, row, b] = slope[:, b], slope[:, a]
        turned = np.einsum("esmi,eam->esai", strain, axes).reshape(count, 6, 30)
        stress = (elastic * volume[:, q, None, None]) @ turned
        block += turned.transpose(0, 2, 1) @ stress
    return block


def _gradients(mesh: SolidMesh) -> tuple[Array, Array]:
    """Gradients (e, 3, 10, q) [1/m] and volumes (e, q) [m^3] at the quadrature points."""
    basis = Basis(mesh.tets, ElementTetP2(), intorder=FOUR_POINTS)
    gradient = np.array([field[0].grad for field in basis.basis])
    return np.ascontiguousarray(gradient.transpose(2, 1, 0, 3)), basis.dx


def mass_matrix(mesh: SolidMesh, density: float) -> sparse.csr_matrix:
    """Return the consistent mass between the nodes, the same along x, y and z, (n, n) [kg]."""
    return density * mass.assemble(Basis(mesh.tets, ElementTetP2(), intorder=LOAD_ORDER))


def surface_integrals(mesh: SolidMesh, surface: str) -> Array:
    """Integrals of each node's shape function N times 1, x, y, z over a named surface.

    Gives `Array`: (n, 4) integrals of N [m^2] and of N x, N y, N z [m^3].
    """
    triangles = mesh.surface_triangles(surface)
    points, weights = get_quadrature(RefTri, LOAD_ORDER)
    shape, slope = map(
        np.array, zip(*(ElementTriP2().lbasis(points, i) for i in range(6)), strict=True)
    )
    corners = mesh.nodes[triangles]
    tangents = np.einsum("fni,ndq->dfqi", corners, slope)
    area = weights * np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=-1)
    place = np.einsum("fni,nq->fqi", corners, shape)
    factors = np.concatenate([np.ones((*area.shape, 1)), place], axis=-1)
    integrals = np.zeros((len(mesh.nodes), 4))
    np.add.at(integrals, triangles, np.einsum("nq,fq,fqk->fnk", shape, area, factors))
    return integrals


def body_force(mass: sparse.csr_matrix) -> Array:
    """Nodal forces of a unit acceleration field along x, y and z on a mass (3 n, 3) [kg]."""
    forces = np.asarray(mass.sum(axis=1))[:, :, None] * np.eye(3)
    return forces.reshape(-1, 3)


def rigid_motion(points: Array) -> Array:
    """Displacements of points by the six unit screws at the origin.

    `points` (n, 3): places [m].  Gives `Array`: (3 n, 6): translations along and rotations about x,
    y, z; its transpose gives the resultant force and moment at the origin of nodal forces.
    """
    x, y, z = points.T
    zero = np.zeros_like(x)
    spin = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)
    shift = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return np.concatenate([shift, spin], axis=2).reshape(-1, 6)


def cylindrical_axes(points: Array) -> sparse.csr_matrix:
    """Return the axes along the radius, around and along z at each point off z.

    `points` (n, 3): places [m].  Gives (3 n, 3 n) orthogonal: x, y, z components from radial,
    tangential and axial ones.
    """
    return block_axes(_axes_about_z(points[:, :2].T))


def _axes_about_z(place: Array) -> Array:
    """Return the axes along the radius, around and along z as columns (n, 3, 3), at x, y (2, n)."""
    cosine, sine = place / np.hypot(*place)
    axes = np.zeros((place.shape[1], 3, 3))
    axes[:, 0, 0], axes[:, 0, 1], axes[:, 1, 0], axes[:, 1, 1] = cosine, -sine, sine, cosine
    axes[:, 2, 2] = 1.0
    return axes


def block_axes(blocks: Array) -> sparse.csr_matrix:
    """Return a block diagonal matrix (3 n, 3 n) of one 3 x 3 block for each node (n, 3, 3)."""
    count = len(blocks)
    return sparse.csr_matrix(
        sparse.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(3 * count,) * 2)
    )
