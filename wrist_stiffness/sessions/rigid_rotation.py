"""Where the rigid wrist points: what every measured pose is held against."""

from __future__ import annotations

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.in_pieces import in_pieces


def rigid_rotation(table: Table, theta: Array) -> Array:
    """Return the rotation U -> F of the rigid platform, (n, 3, 3), at reachable angles (n, 2)."""
    return in_pieces(table.mechanism.platform_rotation, theta)
