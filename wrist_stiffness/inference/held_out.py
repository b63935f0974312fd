"""The held-out part: it names nothing and only takes away.

Of several sessions it is the last one, put aside before looking and opened when the search is over:
inside a session a badly excited parameter improves every cross-validation and fails the day after.

Of one session it is a part, without which what was found is fitted anew.  All of the session chose
the effects, this part too: it judges their values, and hardly whether they are the right ones.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.observations import Array, Labels, Mask, Observations, Quantity
from wrist_stiffness.inference.point import Background, Point
from wrist_stiffness.inference.search import NEGLIGIBLE

HELD_OUT = 0.2
"""Part of the units that judges where there is one session only (assumed)."""

JUDGES = 8
"""Blocks in time of the held-out part from which the uncertainty of a gain is taken."""


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


def sealed_units(observations: Observations) -> Mask:
    """Which units are put aside: the last session, or the end of the only one, (n,)."""
    sessions = observations.sessions
    names = np.unique(sessions)
    if len(names) > 1:
        return sessions == names[-1]
    n = observations.n_units
    return np.arange(n) >= n - max(1, round(HELD_OUT * n))


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Residuals of a model on units that it has not seen."""

    residual: Array  # (n, m), in the units of the table; NaN = not measured
    # (N,), whitened, without what the set-up of the session could still take up: where a wander or
    # a registration goes after the end of the data is no evidence against an effect
    white: Array

    @property
    def energy(self) -> float:
        """Weighted sum of squares, in units of the noise."""
        return float(self.white @ self.white)

    def rmse(self, quantity: Quantity) -> float:
        """Root mean square of the vector norm of a quantity; blanks do not count."""
        columns = self.residual[:, list(quantity.components)]
        measured = np.isfinite(columns)
        total = np.sum(np.where(measured, columns, 0.0) ** 2, axis=0)
        mean = total / np.maximum(measured.sum(axis=0), 1)
        return float(np.sqrt(mean.sum())) * quantity.per_si

    def rms(self, quantities: Iterable[Quantity]) -> dict[str, float]:
        """Return that of each quantity that was measured there, by its key."""
        measured = np.flatnonzero(np.isfinite(self.residual).any(axis=0))
        return {q.key: self.rmse(q) for q in quantities if {*q.components} & {*measured.tolist()}}


def speak_for(
    found: Point, without: Point, background: Background, taken: Callable[[Array], Array]
) -> float:
    """Return by how much better a set foretells held-out units than the model without it.

    Log odds of what was measured in them, given the others: beside noise, drift and discrepancy as
    the others show them beside the set, and all values as well as the others tell them.  A right
    set foretells them k times worse in at most one table of k (Markov's inequality).

    `found`, `without`: where fits to all units ended, with the set and without it; `background`: of
    all; `taken`: takes the held-out units out of whitened rows.
    """
    groups = tuple(replace(each, columns=taken(each.columns)) for each in background.groups)
    seen = evidence(_seen(found, taken), Background(groups, background.noise_width))
    whole = replace(seen, background=background.part(seen.background.numbers))

    def foretold(point: Point) -> float:
        part = replace(seen, point=_seen(point, taken))
        return replace(whole, point=point).unbounded - part.unbounded

    return foretold(found) - foretold(without)


def _seen(point: Point, taken: Callable[[Array], Array]) -> Point:
    left, columns, inexact = (taken(each) for each in (point.left, point.columns, point.inexact))
    return replace(point, left=left, columns=columns, inexact=inexact)


def bought(before: HeldOut, after: HeldOut, quantity: Quantity) -> tuple[float, float]:
    """Fall of the held-out error of a quantity and its standard uncertainty.

    Of a change f that takes the share b of itself off the error, squares fall by (2 b - 1) f^2.  So
    the uncertainty is that of b: of a regression on f whose errors may wander within blocks (Liang
    and Zeger 1986).

    `before`, `after`: without and with the effect; `quantity`: what is told.
    """
    columns = list(quantity.components)
    left, kept = (np.nan_to_num(each.residual[:, columns]) for each in (before, after))
    change = left - kept
    size = float(np.sum(change**2))
    units = int(np.isfinite(before.residual[:, columns]).any(axis=1).sum())
    if not size:
        return 0.0, 0.0
    error = left - float(np.sum(left * change)) / size * change
    # Of blocks without a change nothing is learned: each has an equal share of it.
    weight = np.sum(change**2, axis=1)
    block = np.floor(JUDGES * (np.cumsum(weight) - 0.5 * weight) / size).astype(np.int64)
    scores, count = np.bincount(block, np.sum(error * change, axis=1)), len(set(block[weight > 0]))
    spread = count / (count - 1) * np.sum(scores**2) if count > 1 else np.inf
    fall = 2.0 * float(np.sqrt(spread)) / units
    level = before.rmse(quantity) + after.rmse(quantity)
    slope = quantity.per_si**2 / level if level > 0 else 0.0
    return before.rmse(quantity) - after.rmse(quantity), fall * slope


def refuted(before: HeldOut, after: HeldOut) -> bool:
    """Whether an effect makes held-out units worse by more than chance explains.

    The change f of the prediction gains 2 r f - f^2; with a right f its standard deviation is
    2 |f|, so a loss beyond twice that is none of a right effect.  Where f is next to nothing, so is
    a loss, and what wanders in r may pass that: of log odds that are negligible nothing is learned.
    """
    change = float(np.linalg.norm(before.white - after.white))
    gain = before.energy - after.energy
    return gain < -max(4.0 * change, 2.0 * NEGLIGIBLE)
