"""What a fit says of units that it has not seen: another session, or the end of the only one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.campaign.unit_session import UnitSession
from wrist_stiffness.campaign.units import Mask
from wrist_stiffness.inference.held_out import HeldOut

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
        shift, turn = each.shift.copy(), each.turn.copy()
        shift[own], turn[own] = np.nan, np.nan
        parts.append(replace(each, shift=shift, turn=turn))
    return Parts(sessions, tuple(parts), aside)


def unseen(fitted: BaseFit, parts: Parts, whole: BaseFit) -> HeldOut:
    """Return what a fit leaves of the units that it has not seen.

    What is set up anew in a session of which it saw nothing is taken from a fit that saw all, and
    refitted to first order; everything else keeps its value.

    Parameters
    ----------
    fitted : BaseFit
        To the part that was seen.
    parts : Parts
        Of the sessions.
    whole : BaseFit
        A fit to all units.
    """
    problem = replace(fitted.problem, sessions=parts.whole)
    known = {_key(whole, n): z for n, z in enumerate(whole.z)}
    blank = {n for n, each in enumerate(parts.seen) if not each.measured.any()}
    fresh = [n for n, unknown in enumerate(problem.unknowns) if unknown.session in blank]
    z = fitted.z.copy()
    z[fresh] = [known[_key(fitted, n)] for n in fresh]
    rows = np.repeat(parts.aside, 6)
    residual = problem.residual(z)
    left = problem.whiten(residual)[rows]
    if fresh:
        columns = problem.columns(z, places=fresh)
        white = problem.whiten(columns)[rows]
        step = np.linalg.lstsq(white, -left, rcond=1e-9)[0]
        residual, left = residual + columns @ step, left + white @ step
    return HeldOut(residual[parts.aside], left)


def _key(fitted: BaseFit, number: int) -> tuple[str, str, int | None]:
    unknown = fitted.problem.unknowns[number]
    return fitted.problem.free[unknown.free].effect.name, unknown.key, unknown.session
