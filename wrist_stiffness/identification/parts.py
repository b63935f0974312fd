"""Sessions with some units put aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.sessions.unit_session import UnitSession
from wrist_stiffness.sessions.units import Mask

Sessions = tuple[UnitSession, ...]


@dataclass(frozen=True)
class Parts:
    """Sessions with a part that is held out.

    Parameters
    ----------
    whole : tuple of UnitSession
        With all that was measured.
    seen : tuple of UnitSession
        With nothing measured in the units that are held out.
    aside : (u,) bool
        These units, of all that were measured.
    """

    whole: Sessions
    seen: Sessions
    aside: Mask


def parted(sessions: Sessions, aside: Mask) -> Parts:
    """Return the sessions with some units (u,) of all measured ones held out."""
    parts, start = [], 0
    for each in sessions:
        rows = np.flatnonzero(each.measured)
        own = rows[aside[start : start + len(rows)]]
        start += len(rows)
        parts.append(each.without(own))
    return Parts(sessions, tuple(parts), aside)
