"""What the encoders hide of the angles of units, and which units hide the same.

Between two counts an encoder shows nothing.  In motion every moment hides a part of its own; a
motor at rest hides the same part all the time, before and after a load is put on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.units import COUNTS, WINDOW_S, Cut, Labels


def hidden_counts(table: Table, cut: Cut, theta: Array) -> Array:
    """Return what a standard deviation of each motor's hidden part does to units, (u, 6, 2).

    `theta` (u, 2): mean angles of the units [rad].
    """
    mechanism, step = table.mechanism, table.geometry.limits.encoder_step
    jacobian = np.zeros((len(theta), 6, 2))
    jacobian[:, 3:] = mechanism.jacobian(mechanism.forward(theta))
    known = counts_known(cut, step)
    return np.asarray(jacobian * (step / np.sqrt(12.0 * known))[:, None, :])


def counts_known(cut: Cut, step: float) -> Array:
    """Return how many counts of their own the mean angles of units rest on, (u, 2)."""
    used = cut.unit >= 0
    unit, theta = cut.unit[used], cut.block.theta[used]
    low, high = np.full((2, len(cut.dwell), 2), np.nan)
    np.fmin.at(low, unit, theta)
    np.fmax.at(high, unit, theta)
    moments = np.bincount(unit, minlength=len(low))[:, None]
    return np.clip((high - low) / step, 1.0, np.where(cut.dwell[:, None], 1.0, moments))


def stands_of(table: Table, cuts: Sequence[Cut]) -> Labels:
    """Return the stand of the motors that each unit shares with others, -1 for none, (u,)."""
    found, first = [], 0
    for cut in cuts:
        own = _stands(cut, table.geometry.limits.encoder_step)
        alike = np.bincount(own[own >= 0], minlength=1)
        alone = (own < 0) | (alike[np.maximum(own, 0)] < 2)
        found.append(np.where(alone, -1, own + first))
        first += len(alike)
    return np.concatenate(found)


def _stands(cut: Cut, step: float) -> Labels:
    """Return the number of the stand in which each unit lies, -1 in motion, (u,).

    A motor that comes to rest shows the count of its rest already, and is not there yet.
    """
    theta, number = cut.block.theta, np.zeros(len(cut.kept), dtype=np.intp)
    begun = theta[0]
    for moment in range(1, len(theta)):
        moved = bool((np.abs(theta[moment] - begun) > COUNTS * step).any())
        begun = theta[moment] if moved else begun
        number[moment] = number[moment - 1] + moved
    used = cut.unit >= 0
    unit, number = cut.unit[used], number[used]
    first, last = np.full(len(cut.dwell), len(theta)), np.full(len(cut.dwell), -1)
    np.minimum.at(first, unit, number)
    np.maximum.at(last, unit, number)
    moving = np.zeros(len(cut.dwell), dtype=bool)
    # A count that flickers at rest is as fast at its moment as a slow motion.
    fast = (np.abs(cut.mean_speed[used]) > COUNTS * step / WINDOW_S).any(axis=1)
    np.logical_or.at(moving, unit, fast)
    return np.where((first == last) & (cut.dwell | ~moving), first, -1)
