"""A part's own 6 x 6 stiffness, measured or from another solver, or of a pair of ball bearings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.inputs.document import Node
from wrist_stiffness.inputs.schema import (
    UNIT_TOLERANCE,
    Quantity,
    Schema,
    direction,
    list_of,
    number,
    record,
    vector,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross, screws_to_origin, wrenches_to_origin

IN_MILLIMETRES = 1e-3 * np.outer(*[np.repeat([1.0, 1e3], 3)] * 2)
"""A stiffness in N, N mm, mm and rad over the same in N, N m, m and rad (6, 6)."""

LOOSE = 1e-9
"""Stiffness over the largest one, both scaled to forces at the part, that counts as none."""


@dataclass(frozen=True, eq=False)
class OwnStiffness:
    """A part between its two frames."""

    # (6, 6), screw of the platform-side frame against the motor-side one for unit wrenches, at O in
    # F with the wrist at home [m/N, rad/N, rad/(N m)]; none where the part holds nothing
    flexibility: Array


_READ = record(
    {"matrix_N_mm": list_of(vector(6))},
    {"origin_mm": Quantity(vector()), "x": direction, "y": direction},
)


def own_stiffness(node: Node, distance: float, free: Array) -> OwnStiffness:
    """Read the stiffness of a part: wrenches [N, N mm] by row for twists [mm, rad] by column.

    `node`: `matrix_N_mm`, and the frame in F at home if it is not O and F: `origin_mm`, `x`, `y`.
    `distance`: of the part from O [m].  `free` (6, k): twists at O that it need not hold: slide and
    turn of a joint; none for a link.  Gives `OwnStiffness`: in SI units.  Raises `GeometryError` if
    the matrix is not symmetric, not definite or lets go of what it must hold.
    """
    read, place = _READ(node), node["matrix_N_mm"]
    matrix = np.array(read["matrix_N_mm"])
    if matrix.shape != (6, 6):
        raise place.refuse(f"{len(matrix)} rows, needs 6")
    size = np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix))))
    skewed = np.abs(matrix - matrix.T) - UNIT_TOLERANCE * size
    if skewed.max() > 0.0:
        i, j = np.unravel_index(np.argmax(skewed), (6, 6))
        raise place.refuse(
            f"not symmetric: {matrix[i, j]:g} in row {i + 1}, column {j + 1}, "
            f"but {matrix[j, i]:g} in row {j + 1}, column {i + 1}"
        )
    x, y = read.get("x", np.eye(3)[0]), read.get("y", np.eye(3)[1])
    if abs(x @ y) > UNIT_TOLERANCE:
        raise node.refuse(f"x and y are not at a right angle (their product is {x @ y:.3g})")
    axes = np.column_stack([x, y, cross(x, y)])
    wrench = wrenches_to_origin(read.get("origin", np.zeros(3)), axes)
    at_frame = (matrix + matrix.T) / 2.0 / IN_MILLIMETRES
    return OwnStiffness(_inverse(place, wrench @ at_frame @ wrench.T, distance, free))


def bearing_pair(centre: Array, axis: Array) -> Schema[OwnStiffness]:
    """Return the schema of a preloaded pair of ball bearings on an axis that turns freely.

    Of one bearing `radial_N_um` and `axial_N_um`; `distance_mm` between the pressure centres, where
    the lines of contact meet the axis.  Balls that share a preload evenly are exactly a radial and
    an axial spring at that point: T. C. Lim and R. Singh, J. Sound Vib. 139 (1990) 179.

    `centre` (3,): the middle of the pair in F at home [m]; `axis` (3,): unit vector.  The schema
    refuses what is missing or not positive.
    """
    keys = dict.fromkeys(("radial_N_um", "axial_N_um", "distance_mm"), Quantity(number(above=0.0)))

    def make(radial: float, axial: float, distance: float) -> OwnStiffness:
        along = np.outer(axis, axis)
        across = np.eye(3) - along
        flexibility = np.zeros((6, 6))
        flexibility[:3, :3] = across / (2.0 * radial) + along / (2.0 * axial)
        flexibility[3:, 3:] = across * 2.0 / (radial * distance**2)
        to_origin = screws_to_origin(centre)
        return OwnStiffness(to_origin @ flexibility @ to_origin.T)

    return record(keys, make=make)


def in_millimetres(stiffness: Array) -> Array:
    """Return a stiffness (6, 6) [N/m, N, N m] as a file gives it [N/mm, N, N mm]."""
    return np.asarray(stiffness * IN_MILLIMETRES)


def _inverse(place: Node, stiffness: Array, distance: float, free: Array) -> Array:
    """Flexibility (6, 6) of a stiffness at O, zero where it holds nothing and need not."""
    scale = np.repeat([1.0, 1.0 / distance], 3)
    value, vector = np.linalg.eigh(stiffness * np.outer(scale, scale))
    limit = LOOSE * value[-1]
    if value[0] < -limit or value[-1] <= 0.0:
        raise place.refuse(f"not positive: {value[0]:.3g} N/m is its least eigenvalue")
    loose = value <= limit
    may, _ = np.linalg.qr(free / scale[:, None]) if free.size else (free, None)
    missed = vector[:, loose] - may @ (may.T @ vector[:, loose])
    if np.any(np.abs(missed) > UNIT_TOLERANCE):
        holds = "across its joint's axis" if free.size else "in some direction"
        raise place.refuse(f"holds nothing {holds}: rank {6 - int(loose.sum())}")
    firm = vector[:, ~loose]
    return np.asarray((firm / value[~loose]) @ firm.T * np.outer(scale, scale))
