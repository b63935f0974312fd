"""How well a table's splines interpolate, at poses and loads that they never saw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.workspace import Workspace

UNSEEN_POSES = 2000
UNSEEN_SEED = 20150226

STATED = 0.99
"""Share of the unseen poses and loads whose error a table's stated one covers; what is left are
creases, where a flange lifts off between two nodes."""

COVERED = 0.95
"""Share of fresh ones that it must cover."""

HALVES = {"s": slice(0, 3), "phi": slice(3, 6)}


def unseen_poses(workspace: Workspace, rng: np.random.Generator | None = None) -> Array:
    """Return `UNSEEN_POSES` random poses in the map domain that no grid contains, (n, 2) [rad].

    The same ones unless a generator is given.
    """
    rng = rng or np.random.default_rng(UNSEEN_SEED)
    lower, upper = workspace.rectangle
    poses = rng.uniform(lower, upper, (8 * UNSEEN_POSES, 2))
    return poses[workspace.domain(poses)][:UNSEEN_POSES]


def random_loads(limits: Limits, count: int, rng: np.random.Generator) -> Array:
    """Return loads of any direction and of any size within a table's range, (n, 6) [N, N m]."""
    loads = rng.normal(size=(count, 6))
    for half, most in zip(HALVES.values(), (limits.force, limits.moment), strict=True):
        size = np.linalg.norm(loads[:, half], axis=1, keepdims=True)
        loads[:, half] *= rng.uniform(0.0, most, (count, 1)) / size
    return loads


def relative_misses(twist: Array, exact: Array) -> Array:
    """Return the lengths of the errors of s and phi over those of s and phi, (n, 2)."""
    return np.column_stack(
        [
            np.linalg.norm((twist - exact)[:, half], axis=1)
            / np.linalg.norm(exact[:, half], axis=1)
            for half in HALVES.values()
        ]
    )


def spline_misses(
    table: Table, rng: np.random.Generator | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Compare splines and closed form at random poses under own weight and random loads.

    `rng`: draws them; the same ones every time if None.  Gives (n, 2): errors of s and phi as
    vectors, relative to their lengths, and (n,) bool: whether the pose is in the operative
    workspace.
    """
    poses = unseen_poses(table.workspace, rng)
    loads = random_loads(
        table.geometry.limits, len(poses), rng or np.random.default_rng(UNSEEN_SEED)
    )
    configuration = table.mechanism.forward(poses)
    exact, splined = (
        respond(table.operators_at(configuration, way), loads).twist
        for way in ("closed_form", "spline")
    )
    return relative_misses(splined, exact), table.workspace.operative(poses)


def interpolation_errors(table: Table) -> dict[str, dict[str, float]]:
    """State how well the table's splines follow the closed form at poses that they never saw.

    Gives errors of s and phi by region, `operative` and `domain`, relative to the local value: all
    but one in a hundred of the errors, as vectors, of the splines of the operators with contact
    solved under random loads.
    """
    misses, operative = spline_misses(table)
    return {
        region: dict(zip(HALVES, np.quantile(rows, STATED, axis=0).tolist(), strict=True))
        for region, rows in (("operative", misses[operative]), ("domain", misses))
    }
