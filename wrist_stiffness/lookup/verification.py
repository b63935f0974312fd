"""How well a table's splines interpolate, at poses that they never saw."""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.lookup.rated_load import rated_map
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

UNSEEN_POSES = 400
UNSEEN_SEED = 20150226


def unseen_poses(workspace: Workspace) -> Array:
    """Return `UNSEEN_POSES` random poses in the map domain that no grid contains, (n, 2) [rad]."""
    rng = np.random.default_rng(UNSEEN_SEED)
    lower, upper = workspace.rectangle
    poses = rng.uniform(lower, upper, (4 * UNSEEN_POSES, 2))
    return poses[workspace.domain(poses)][:UNSEEN_POSES]


def interpolation_errors(table: Table) -> dict[str, Any]:
    """Compare the table's splines with the closed form at poses they never saw.

    Parameters
    ----------
    table : Table
        With its grid.

    Returns
    -------
    dict
        Largest error relative to the local value, by region and quantity: `predicted` through the
        spline of the operators with contact solved, `map` through the spline of s and phi itself
        (the paper's way), and the leave-one-out error of the map.
    """
    workspace = table.workspace
    poses = unseen_poses(workspace)
    configuration = table.mechanism.forward(poses)
    # Columns 3 and 4 of the map are |s| and phi.
    exact = rated_map(
        configuration, table.operators_at(configuration, "closed_form"), table.geometry
    )[:, 3:]
    predicted = rated_map(
        configuration, table.operators_at(configuration, "spline"), table.geometry
    )[:, 3:]
    load_only = rated_map(
        configuration,
        contact_operators(configuration, table.components, np.zeros(3)),
        table.geometry,
    )[:, 3:]
    mapped = table.map_spline(poses)[:, 3:]
    operative = workspace.operative(poses)
    leave_one_out = np.abs(table.map_spline.leave_one_out()[:, 3:]) / table.map_values[:, 3:]
    inside = workspace.operative(table.nodes)
    return {
        "unseen_poses": len(poses),
        "predicted": _by_region(np.abs(predicted - exact) / exact, operative),
        "map": _by_region(np.abs(mapped - load_only) / load_only, operative),
        "leave_one_out": _by_region(leave_one_out, inside),
    }


def _by_region(relative: Array, operative: np.ndarray) -> dict[str, dict[str, float]]:
    return {
        region: {name: float(np.max(rows[:, i])) for i, name in enumerate(("s", "phi"))}
        for region, rows in (("operative", relative[operative]), ("domain", relative))
    }
