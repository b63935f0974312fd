"""Biharmonic spline over two joint angles, with analytic gradient and leave-one-out error.

After Sandwell (1987), "Biharmonic spline interpolation of GEOS-3 and SEASAT altimeter data":
the surface is a sum of Green's functions of the biharmonic operator, centred on the nodes.  Two
forms are offered; with r the distance in the scaled plane:

- ``sandwell``: r^2 (ln r - 1) alone, as in MATLAB's griddata 'v4', the method of the paper.  It
  depends on the unit of r and does not reproduce a plane.
- ``thin_plate``: r^2 ln r plus a plane, with coefficients orthogonal to planes.  It reproduces a
  plane, and a common factor on r cancels.

Angles are scaled to the box [0, 1]^2 first, so neither form depends on the unit of the angles; the
offset and the scale belong to the spline and are stored with it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import inv, solve
from scipy.spatial import KDTree

from wrist_stiffness.errors import InputError

Kernel = Literal["sandwell", "thin_plate"]
Trend = Literal["none", "plane"]

MIN_NODE_DISTANCE = 1e-6
"""Nodes nearer than this, in the unit box, count as one: the condition number of the system grows
as distance^-2, to 1e12 at this limit, and no motor resolves a microradian."""
MIN_NODE_SPREAD = 1e-6
"""Nodes whose ratio of singular values is below this, in the unit box, lie on a line."""
QUERIES_PER_BLOCK = 1024
"""Bounds the memory of long queries."""

# The kernel is r^2 (ln r - c): c is all that differs.
_KERNEL_CONSTANT = {"sandwell": 1.0, "thin_plate": 0.0}


@dataclass(frozen=True, eq=False)
class BiharmonicSpline:
    """Smooth surface through values at nodes in the plane of two joint angles.

    Results are reproducible to the bit for the same query shape with the same libraries and
    machine; the same angle inside a longer query may differ in the last bits, because the matrix
    product then sums in another order.  Outside of the nodes' box the spline extrapolates
    silently: the domain is the table's affair.  A NaN angle gives NaN.

    Parameters
    ----------
    nodes : (n, 2) array
        Joint angles of the nodes [rad].
    offset, scale : (2,) array
        Unit box: (theta - offset) / scale lies in [0, 1]^2 for all nodes [rad].
    kernel : {'sandwell', 'thin_plate'}
        Green's function, see the module.
    coefficients : (n + p, m) array
        Weights of the nodes, then of the trend 1, x, y in scaled angles (p = 3 for a plane, else
        0), for m value columns [unit of the values].

    Raises
    ------
    InputError
        An unknown kernel, or arrays whose shapes do not belong together.
    """

    nodes: NDArray[np.float64]
    offset: NDArray[np.float64]
    scale: NDArray[np.float64]
    kernel: Kernel
    coefficients: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Refuse a spline whose parts do not belong together, as a damaged table would give."""
        _require_kernel(self.kernel)
        count = len(self.nodes) + _trend_size(self.kernel)
        if (
            self.nodes.shape != (len(self.nodes), 2)
            or self.offset.shape != (2,)
            or self.scale.shape != (2,)
            or self.coefficients.ndim != 2
            or len(self.coefficients) != count
        ):
            raise InputError(
                f"spline arrays: nodes {self.nodes.shape}, offset {self.offset.shape}, scale "
                f"{self.scale.shape}, coefficients {self.coefficients.shape}; "
                f"(n, 2), (2,), (2,), ({count}, m) expected"
            )

    @classmethod
    def fit(
        cls, nodes: ArrayLike, values: ArrayLike, kernel: Kernel = "thin_plate"
    ) -> "BiharmonicSpline":
        """Spline through values at nodes.

        Parameters
        ----------
        nodes : (n, 2) array
            Joint angles [rad], at least three nodes that are not on a line, in any order.
        values : (n, m) array
            m value columns, any units.
        kernel : {'sandwell', 'thin_plate'}
            Green's function, see the module.

        Raises
        ------
        InputError
            Wrong shapes, values that are not finite, too few or duplicate nodes, nodes on a
            line, an unknown kernel.
        """
        nodes = np.array(nodes, dtype=float)
        values = np.array(values, dtype=float)
        _require_data(nodes, values)
        offset = nodes.min(axis=0)
        scale = np.ptp(nodes, axis=0)
        _require_spread_nodes(nodes, offset, scale)
        _require_kernel(kernel)
        right = np.vstack([values, np.zeros((_trend_size(kernel), values.shape[1]))])
        matrix = _system_matrix((nodes - offset) / scale, kernel)
        # Never singular: with distinct nodes in the unit box (r < e) Sandwell's matrix showed one
        # negative eigenvalue and else positive ones in 15,000 random sets of 4 to 40 nodes.
        # LAPACK's symmetric solver takes one right side after the other and is far slower.
        # The layout decides the order of summation, so a stored copy would else differ in bits.
        coefficients = np.ascontiguousarray(solve(matrix, right, assume_a="gen"))
        return cls(nodes, offset, scale, kernel, coefficients)

    @property
    def trend(self) -> Trend:
        """Polynomial that is added to the kernels: 'none' or 'plane'."""
        return "plane" if _trend_size(self.kernel) else "none"

    @cached_property
    def _scaled_nodes(self) -> NDArray[np.float64]:
        """Nodes in the unit box, (2, n): one contiguous row per angle."""
        return np.ascontiguousarray(((self.nodes - self.offset) / self.scale).T)

    def __call__(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Evaluate the spline.

        Parameters
        ----------
        theta : (..., 2) array
            Joint angles [rad].

        Returns
        -------
        (..., m) array
            Values [unit of the values].

        Raises
        ------
        InputError
            The last dimension of theta is not 2.
        """
        theta = _as_angles(theta)
        count = len(self.nodes)
        constant = _KERNEL_CONSTANT[self.kernel]
        result = np.empty((theta.size // 2, self.coefficients.shape[1]))
        for block, scaled, dx, dy in self._blocks(theta):
            values = _kernel(dx, dy, constant) @ self.coefficients[:count]
            if self.trend == "plane":
                values += self.coefficients[count] + scaled @ self.coefficients[count + 1 :]
            result[block] = values
        return result.reshape(*theta.shape[:-1], result.shape[1])

    def gradient(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Analytic gradient, exact also at a node.

        Parameters
        ----------
        theta : (..., 2) array
            Joint angles [rad].

        Returns
        -------
        (..., m, 2) array
            Derivative of each value by each angle [unit of the values / rad].

        Raises
        ------
        InputError
            The last dimension of theta is not 2.
        """
        theta = _as_angles(theta)
        count = len(self.nodes)
        constant = _KERNEL_CONSTANT[self.kernel]
        result = np.empty((theta.size // 2, self.coefficients.shape[1], 2))
        for block, _, dx, dy in self._blocks(theta):
            slope = _kernel_slope(dx, dy, constant)
            result[block, :, 0] = (slope * dx) @ self.coefficients[:count]
            result[block, :, 1] = (slope * dy) @ self.coefficients[:count]
        if self.trend == "plane":
            result += self.coefficients[count + 1 :].T
        result /= self.scale
        return result.reshape(*theta.shape[:-1], *result.shape[1:])

    def leave_one_out(self) -> NDArray[np.float64]:
        """Error at every node of the spline through the other nodes, in the same unit box.

        Closed form from the inverse A^-1 of the system matrix (Rippa 1999): coefficient i over
        element (i, i) of A^-1, for all nodes and columns at the cost of one inverse.

        Returns
        -------
        (n, m) array
            Prediction from the other nodes minus the value [unit of the values].

        Raises
        ------
        InputError
            The nodes that remain without some node cannot carry a spline (too few, or on a line).
        """
        count = len(self.nodes)
        inverse = inv(_system_matrix(self._scaled_nodes.T, self.kernel))
        diagonal = np.diagonal(inverse)[:count]
        weakest = int(np.argmin(np.abs(diagonal)))
        # det(A without i) / det(A): zero up to rounding where node i cannot be spared.
        if abs(diagonal[weakest]) <= 1e-14 * np.abs(inverse[:count, :count]).max():
            raise InputError(
                f"leave-one-out: without node {weakest} of {count} at {self.nodes[weakest]} rad "
                "the others carry no spline"
            )
        return -self.coefficients[:count] / diagonal[:, None]

    def _blocks(
        self, theta: NDArray[np.float64]
    ) -> Iterator[tuple[slice, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
        """Scaled queries (k, 2) and their distances (k, n) from the nodes along each axis."""
        scaled = (theta.reshape(-1, 2) - self.offset) / self.scale
        for start in range(0, len(scaled), QUERIES_PER_BLOCK):
            block = slice(start, start + QUERIES_PER_BLOCK)
            part = scaled[block]
            yield (
                block,
                part,
                part[:, :1] - self._scaled_nodes[0],
                part[:, 1:] - self._scaled_nodes[1],
            )


def _kernel(
    dx: NDArray[np.float64], dy: NDArray[np.float64], constant: float
) -> NDArray[np.float64]:
    """Green's function r^2 (ln r - c), with its limit 0 at r = 0."""
    square = dx * dx + dy * dy
    return square * (0.5 * _log(square) - constant)


def _kernel_slope(
    dx: NDArray[np.float64], dy: NDArray[np.float64], constant: float
) -> NDArray[np.float64]:
    """g'(r) / r = 2 ln r + 1 - 2 c: times dx or dy it is the kernel's gradient, 0 at r = 0."""
    return _log(dx * dx + dy * dy) + (1.0 - 2.0 * constant)


def _log(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of r^2, finite at r = 0 where the factor r makes every term vanish."""
    return np.log(np.maximum(square, np.finfo(float).tiny))


def _trend_size(kernel: Kernel) -> int:
    return 3 if kernel == "thin_plate" else 0


def _system_matrix(scaled: NDArray[np.float64], kernel: Kernel) -> NDArray[np.float64]:
    """Symmetric matrix (n + p, n + p) of the interpolation conditions at nodes in the unit box."""
    count, size = len(scaled), _trend_size(kernel)
    difference = scaled[:, None] - scaled
    matrix = np.zeros((count + size, count + size))
    matrix[:count, :count] = _kernel(
        difference[..., 0], difference[..., 1], _KERNEL_CONSTANT[kernel]
    )
    if size:
        plane = np.column_stack([np.ones(count), scaled])
        matrix[:count, count:] = plane
        matrix[count:, :count] = plane.T
    return matrix


def _as_angles(theta: ArrayLike) -> NDArray[np.float64]:
    theta = np.asarray(theta, dtype=float)
    if theta.ndim < 1 or theta.shape[-1] != 2:
        raise InputError(f"joint angles: shape {theta.shape}; (..., 2) expected")
    return theta


def _require_kernel(kernel: str) -> None:
    if kernel not in _KERNEL_CONSTANT:
        raise InputError(f"spline kernel {kernel!r}; one of {', '.join(_KERNEL_CONSTANT)} expected")


def _require_data(nodes: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    if nodes.ndim != 2 or nodes.shape[1] != 2:
        raise InputError(f"spline nodes: shape {nodes.shape}; (n, 2) expected")
    if values.ndim != 2 or len(values) != len(nodes):
        raise InputError(f"spline values: shape {values.shape}; ({len(nodes)}, m) expected")
    for name, array in (("nodes", nodes), ("values", values)):
        if not np.isfinite(array).all():
            row, column = np.argwhere(~np.isfinite(array))[0]
            raise InputError(
                f"spline {name}: {array[row, column]} in row {row}, column {column}; "
                "finite numbers expected"
            )
    if len(nodes) < 3:
        raise InputError(f"spline nodes: {len(nodes)} given; at least 3 needed")


def _require_spread_nodes(
    nodes: NDArray[np.float64], offset: NDArray[np.float64], scale: NDArray[np.float64]
) -> None:
    """Reject nodes on a line, and two nodes in one place."""
    if (scale == 0.0).any():
        axis = int(np.argmin(scale))
        raise InputError(
            f"spline nodes: all have angle {axis + 1} = {offset[axis]} rad; they lie on a line"
        )
    scaled = (nodes - offset) / scale
    distance, neighbour = KDTree(scaled).query(scaled, k=2)
    nearest = int(np.argmin(distance[:, 1]))
    if distance[nearest, 1] < MIN_NODE_DISTANCE:
        # Of equal nodes the tree may return the node itself second.
        other = next(int(i) for i in neighbour[nearest] if i != nearest)
        first, second = sorted((nearest, other))
        raise InputError(
            f"spline nodes: nodes {first} and {second} are both at {nodes[nearest]} rad, nearer "
            f"than {MIN_NODE_DISTANCE} of the box"
        )
    sigma = np.linalg.svd(scaled - scaled.mean(axis=0), compute_uv=False)
    if sigma[1] < MIN_NODE_SPREAD * sigma[0]:
        raise InputError(
            f"spline nodes: they lie on a line: ratio of singular values "
            f"{sigma[1] / sigma[0]:.3g}, limit {MIN_NODE_SPREAD}"
        )
