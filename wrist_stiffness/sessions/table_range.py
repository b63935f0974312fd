"""What of a recording lies outside the range for which a table holds."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.block import Block
from wrist_stiffness.sessions.in_pieces import in_pieces


def beyond_range(table: Table, block: Block) -> list[str]:
    """Say which limits of a table samples exceed: how many, how far, and the limit."""
    limits, of = table.geometry.limits, len(block)
    out = []
    for name, columns, limit, unit in (
        ("force", slice(0, 3), limits.most_load[0], "N"),
        ("moment", slice(3, 6), limits.most_load[1], "N m"),
    ):
        size = np.linalg.norm(block.load[:, columns], axis=1)
        if beyond := int(np.sum(size > limit)):
            out.append(
                f"{beyond} of {of} measured poses are not used: the {name} at O goes up to "
                f"{size.max():.3g} {unit}, the table's limit is {limit:.3g} {unit}"
            )
    outside = ~in_pieces(table.workspace.domain, block.theta)
    if outside.any():
        first = ", ".join(f"{angle:.1f}" for angle in np.degrees(block.theta[outside][0]))
        turns = np.abs(block.theta).max() > 2.0 * np.pi
        out.append(
            f"{outside.sum()} of {of} measured poses are not used: they lie outside the table's "
            f"domain, the first at {first} deg"
            + (" (are the angles in degrees? a recording has radians)" if turns else "")
        )
    return out
