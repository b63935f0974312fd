"""Biharmonic spline over two joint angles.

After Sandwell (1987), "Biharmonic spline interpolation of GEOS-3 and SEASAT altimeter data":
the surface is a sum of Green's functions of the biharmonic operator, centred on the nodes.  With r
the distance in the scaled plane it is r^2 ln r plus a plane, with coefficients orthogonal to
planes: unlike r^2 (ln r - 1) alone, MATLAB's griddata 'v4' and the paper's, it reproduces a plane,
and a common factor on r cancels.

Angles are scaled to the box [0, 1]^2 first, so it does not depend on the unit of the angles; the
offset and the scale belong to the spline and are stored with it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve

from wrist_stiffness.errors import InputError

KERNEL, TREND = "thin_plate", "plane"
"""What a table calls r^2 ln r, and the polynomial that is added."""

MIN_NODE_SPREAD = 1e-6
"""Nodes whose ratio of singular values is below this lie on a line."""
QUERIES_PER_BLOCK = 1024
"""Bounds the memory of long queries."""


@dataclass(frozen=True, eq=False)
class BiharmonicSpline:
    """Smooth surface through values at nodes in the plane of two joint angles.

    Results are reproducible to the bit for the same query shape with the same libraries and
    machine; the same angle inside a longer query may differ in the last bits, because the matrix
    product then sums in another order.  Outside of the nodes' box the spline extrapolates
    silently: the domain is the table's affair.  A NaN angle gives NaN.
    """

    nodes: NDArray[np.float64]  # (n, 2), joint angles of the nodes [rad]
    # `offset`, `scale`: (2,), unit box: (theta - offset) / scale lies in [0, 1]^2 for all nodes
    # [rad]
    offset: NDArray[np.float64]
    scale: NDArray[np.float64]
    # (n + 3, m), weights of the nodes, then of the trend 1, x, y in scaled angles, for m value
    # columns [unit of the values]
    coefficients: NDArray[np.float64]

    @classmethod
    def fit(cls, nodes: ArrayLike, values: ArrayLike) -> "BiharmonicSpline":
        """Spline through values at nodes.

        `nodes` (n, 2): joint angles [rad], at least three nodes that are not on a line, in any
        order; `values` (n, m): m value columns, any units.  Raises `InputError`: too few
        nodes, nodes on a line.
        """
        nodes = np.array(nodes, dtype=float)
        values = np.array(values, dtype=float)
        if len(nodes) < 3:
            raise InputError(f"spline nodes: {len(nodes)} given; at least 3 needed")
        offset = nodes.min(axis=0)
        scale = np.ptp(nodes, axis=0)
        sigma = np.linalg.svd(nodes - nodes.mean(axis=0), compute_uv=False)
        if sigma[1] < MIN_NODE_SPREAD * sigma[0]:
            raise InputError(f"spline nodes: all {len(nodes)} lie on a line")
        right = np.vstack([values, np.zeros((3, values.shape[1]))])
        matrix = _system_matrix((nodes - offset) / scale)
        # LAPACK's symmetric solver takes one right side after the other and is far slower.
        # The layout decides the order of summation, so a stored copy would else differ in bits.
        coefficients = np.ascontiguousarray(solve(matrix, right, assume_a="gen"))
        return cls(nodes, offset, scale, coefficients)

    @cached_property
    def _scaled_nodes(self) -> NDArray[np.float64]:
        """Nodes in the unit box, (2, n): one contiguous row per angle."""
        return np.ascontiguousarray(((self.nodes - self.offset) / self.scale).T)

    def __call__(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Evaluate the spline, (..., m): values [unit of the values].

        `theta` (..., 2): joint angles [rad].
        """
        theta = np.asarray(theta, dtype=float)
        scaled = (theta.reshape(-1, 2) - self.offset) / self.scale
        count = len(self.nodes)
        result = np.empty((len(scaled), self.coefficients.shape[1]))
        for start in range(0, len(scaled), QUERIES_PER_BLOCK):
            block = slice(start, start + QUERIES_PER_BLOCK)
            part = scaled[block]
            away = part[:, :1] - self._scaled_nodes[0], part[:, 1:] - self._scaled_nodes[1]
            values = _kernel(*away) @ self.coefficients[:count]
            values += self.coefficients[count] + part @ self.coefficients[count + 1 :]
            result[block] = values
        return result.reshape(*theta.shape[:-1], result.shape[1])


def _kernel(dx: NDArray[np.float64], dy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Green's function r^2 ln r, with its limit 0 at r = 0."""
    square = dx * dx + dy * dy
    return square * (0.5 * np.log(np.maximum(square, np.finfo(float).tiny)))


def _system_matrix(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric matrix (n + 3, n + 3) of the interpolation conditions at nodes in the unit box."""
    count = len(scaled)
    difference = scaled[:, None] - scaled
    matrix = np.zeros((count + 3, count + 3))
    matrix[:count, :count] = _kernel(difference[..., 0], difference[..., 1])
    plane = np.column_stack([np.ones(count), scaled])
    matrix[:count, count:] = plane
    matrix[count:, :count] = plane.T
    return matrix
