"""Solving a body of cyclic symmetry harmonic by harmonic.

Seen from axes that turn with its slices, the stiffness of a mesh that maps onto itself under a
turn about z is block-circulant.  A Fourier transform over the slices splits it into one small
system per harmonic, instead of a ring whose cut is two whole sections wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from wrist_stiffness.fem.factor import Factor, factorise
from wrist_stiffness.mechanism.components import Array

SAME_PLACE = 1e-9
"""Nodes nearer than this are one [m]."""


@dataclass(frozen=True)
class CyclicFactor:
    """A factored stiffness of cyclic symmetry.

    Parameters
    ----------
    slices : (n, m) int
        Places of the unknowns of each slice in the right-hand side, three in a row per node.
    turns : (n, 3, 3) float
        Rotation from the axes of slice 0 to those of each slice.
    harmonics : list of Factor
        Real and imaginary parts of the harmonics 0 ... n // 2.
    """

    slices: NDArray[np.int64]
    turns: Array
    harmonics: list[Factor]

    def solve(self, right: Array) -> Array:
        """Solve for right-hand sides (u, k)."""
        count, size = self.slices.shape
        by_slice = right[self.slices].reshape(count, size // 3, 3, -1)
        turned = np.einsum("sba,snbk->snak", self.turns, by_slice).reshape(count, size, -1)
        waves = np.fft.rfft(turned, axis=0)
        solved = []
        for factor, wave in zip(self.harmonics, waves, strict=True):
            real, imaginary = np.split(factor.solve(np.vstack([wave.real, wave.imag])), 2)
            solved.append(real + 1j * imaginary)
        turned = np.fft.irfft(np.array(solved), n=count, axis=0)
        by_slice = np.einsum("sab,snbk->snak", self.turns, turned.reshape(count, size // 3, 3, -1))
        solution = np.empty_like(right)
        solution[self.slices] = by_slice.reshape(count, size, -1)
        return solution


def factorise_cyclic(
    stiffness: sparse.csr_matrix, nodes: Array, free: NDArray[np.int64], count: int
) -> CyclicFactor:
    """Factor the stiffness of the free unknowns of a body of cyclic symmetry.

    Parameters
    ----------
    stiffness : sparse.csr_matrix
        (3 n, 3 n) of all nodes [N/m].
    nodes : (n, 3) float
        Their places [m].
    free : (u,) int
        Unknowns to solve for, sorted: whole nodes, symmetric too.
    count : int
        Number of equal slices about z, at least 3.

    Returns
    -------
    CyclicFactor
        To solve with.
    """
    angles = 2.0 * np.pi / count * np.arange(count)
    turns = np.zeros((count, 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0], turns[:, 0, 1] = np.sin(angles), -np.sin(angles)
    turns[:, 2, 2] = 1.0
    free_nodes = free[::3] // 3
    sliced = free_nodes[_slices(nodes[free_nodes], turns)]
    unknowns = (3 * sliced[:, :, None] + np.arange(3)).reshape(count, -1)

    first = stiffness[unknowns[0]]
    blocks = {}
    for step in (-1, 0, 1):
        turn = sparse.kron(sparse.eye(sliced.shape[1]), turns[step])
        blocks[step] = first[:, unknowns[step]] @ turn
    harmonics = []
    for wave in range(count // 2 + 1):
        phase = np.exp(2j * np.pi * wave / count)
        real = blocks[0] + phase.real * (blocks[1] + blocks[-1])
        imaginary = phase.imag * (blocks[1] - blocks[-1])
        # In real numbers, because SuperLU's complex kernels crawl where BLAS has many threads.
        matrix = sparse.bmat([[real, -imaginary], [imaginary, real]])
        harmonics.append(factorise(matrix, np.arange(matrix.shape[0])))
    return CyclicFactor(np.searchsorted(free, unknowns), turns, harmonics)


def _slices(nodes: Array, turns: Array) -> NDArray[np.int64]:
    """Node numbers of each slice in the same order (n, m): slice s is slice 0 turned s times."""
    count = len(turns)
    angle = np.arctan2(nodes[:, 1], nodes[:, 0])
    # The first slice keeps the nodes on the plane where it starts and leaves those where it ends.
    margin = SAME_PLACE / np.hypot(nodes[:, 0], nodes[:, 1])
    first = np.flatnonzero((angle > -margin) & (angle < 2.0 * np.pi / count - margin))
    images = np.einsum("sab,nb->sna", turns, nodes[first])
    distance, found = cKDTree(nodes).query(images)
    if distance.max() > SAME_PLACE or len(np.unique(found)) != len(nodes):
        raise ValueError(f"the mesh is not symmetric under turns by 1/{count}")
    return found.astype(np.int64)
