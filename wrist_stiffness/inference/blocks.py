"""Blocks of neighbouring units."""

import numpy as np

from wrist_stiffness.inference.observations import Labels


def time_blocks(sessions: Labels, wanted: int) -> Labels:
    """Cut the units into blocks of neighbours that never span two sessions, (n,)."""
    blocks = np.empty(len(sessions), dtype=np.int64)
    names = np.unique(sessions)
    number = 0
    for session in names:
        places = np.flatnonzero(sessions == session)
        share = max(1, round(wanted * len(places) / len(sessions)))
        for piece in np.array_split(places, min(share, len(places))):
            blocks[piece] = number
            number += 1
    return blocks
