"""Sparse Cholesky-like factorisation with a nested-dissection ordering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymetis
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu
from scipy.spatial import cKDTree

from wrist_stiffness.mechanism.components import Array


@dataclass(frozen=True)
class Factor:
    """A factored symmetric positive definite matrix."""

    # (n,), elimination order of the unknowns; those that are not among them stay zero
    order: NDArray[np.int64]
    lu: SuperLU  # factors of the reordered matrix

    def solve(self, right: Array) -> Array:
        """Solve for one or more right-hand sides (n,) or (n, k)."""
        if right.ndim == 2:
            # SuperLU is four times slower on a block of columns than on one after the other.
            columns = [self.solve(column) for column in right.T]
            return np.column_stack(columns) if columns else np.zeros_like(right)
        solution = np.zeros_like(right)
        solution[self.order] = self.lu.solve(right[self.order])
        return solution


def factorise(matrix: sparse.spmatrix, unknowns: NDArray[np.int64]) -> Factor:
    """Factor a symmetric positive definite matrix without pivoting.

    METIS orders the graph of the nodes; on the wrist's solids this is three times faster than a
    minimum-degree ordering of the unknowns.

    `matrix`: (n, n); `unknowns` (n,) int: number of each row; rows of one node, 3 k to 3 k + 2, are
    ordered together.
    """
    _, group = np.unique(unknowns // 3, return_inverse=True)
    entries = sparse.coo_matrix(matrix)
    links = sparse.csr_matrix(
        (np.ones(entries.nnz, dtype=bool), (group[entries.row], group[entries.col]))
    )
    links.setdiag(False)
    links.eliminate_zeros()
    graph = pymetis.CSRAdjacency(links.indptr, links.indices)
    nodes = np.asarray(pymetis.nested_dissection(graph)[0])
    rank = np.argsort(nodes)
    order = np.argsort(rank[group], kind="stable").astype(np.int64)
    reordered = sparse.csc_matrix(sparse.csr_matrix(matrix)[order][:, order])
    lu = splu(
        reordered,
        permc_spec="NATURAL",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return Factor(order, lu)


SAME_PLACE = 1e-9
"""Nodes nearer than this are one [m]."""


@dataclass(frozen=True)
class CyclicFactor:
    """A factored stiffness of cyclic symmetry."""

    slices: NDArray[np.int64]  # (n, m), places of the unknowns of each slice in the right-hand side
    harmonics: list[Factor]  # real and imaginary parts of the harmonics 0 ... n // 2

    def solve(self, right: Array) -> Array:
        """Solve for right-hand sides (u, k) in the nodes' cylindrical axes."""
        waves = np.fft.rfft(right[self.slices], axis=0)
        solved = []
        for factor, wave in zip(self.harmonics, waves, strict=True):
            real, imaginary = np.split(factor.solve(np.vstack([wave.real, wave.imag])), 2)
            solved.append(real + 1j * imaginary)
        solution = np.empty_like(right)
        solution[self.slices] = np.fft.irfft(np.array(solved), n=len(self.slices), axis=0)
        return solution


def factorise_cyclic(
    stiffness: sparse.csr_matrix,
    axes: sparse.csr_matrix,
    nodes: Array,
    free: NDArray[np.int64],
    count: int,
) -> CyclicFactor:
    """Factor the stiffness of the free unknowns of a body of cyclic symmetry.

    `stiffness`: (3 n, 3 n) of all nodes [N/m]; `axes`: (3 n, 3 n) from
    `elasticity.cylindrical_axes`; `nodes` (n, 3): their places [m]; `free` (u,): unknowns in
    cylindrical axes to solve for, sorted, the same in every slice; `count`: number of equal slices
    about z, at least 3.
    """
    sliced = _slices(nodes, count)
    unknowns = (3 * sliced[:, :, None] + np.arange(3)).reshape(count, -1)
    own = np.flatnonzero(np.isin(unknowns[0], free))
    unknowns = unknowns[:, own]
    if unknowns.size != len(free) or not np.isin(unknowns, free).all():
        raise ValueError(f"what is held is not symmetric under turns by 1/{count}")
    first = axes.T.tocsr()[unknowns[0]] @ stiffness @ axes
    before, here, after = (first[:, unknowns[step]] for step in (-1, 0, 1))
    harmonics = []
    for wave in range(count // 2 + 1):
        phase = np.exp(2j * np.pi * wave / count)
        real = here + phase.real * (after + before)
        imaginary = phase.imag * (after - before)
        # In real numbers, because SuperLU's complex kernels crawl where BLAS has many threads.
        matrix = sparse.bmat([[real, -imaginary], [imaginary, real]])
        harmonics.append(factorise(matrix, np.concatenate([own, own + 3 * sliced.shape[1]])))
    return CyclicFactor(np.searchsorted(free, unknowns), harmonics)


def _slices(nodes: Array, count: int) -> NDArray[np.int64]:
    """Node numbers of each slice in the same order (n, m): slice s is slice 0 turned s times."""
    angle = np.arctan2(nodes[:, 1], nodes[:, 0])
    radius = np.hypot(nodes[:, 0], nodes[:, 1])
    # The first slice keeps the nodes on the plane where it starts and leaves those where it ends.
    margin = SAME_PLACE / radius
    first = np.flatnonzero((angle > -margin) & (angle < 2.0 * np.pi / count - margin))
    turned = angle[first] + 2.0 * np.pi / count * np.arange(count)[:, None]
    height = np.broadcast_to(nodes[first, 2], turned.shape)
    images = np.stack([radius[first] * np.cos(turned), radius[first] * np.sin(turned), height], -1)
    distance, found = cKDTree(nodes).query(images)
    if distance.max() > SAME_PLACE or len(np.unique(found)) != len(nodes):
        raise ValueError(f"the mesh is not symmetric under turns by 1/{count}")
    return found.astype(np.int64)
