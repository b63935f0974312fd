"""Judge a fit by units that it has not seen.

Held out is the last session where there are several, else the end of the only one.  What is set up
anew in a session is fitted to the last one by itself; the wrist's own parameters are not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.campaign.fitting.fit import fit, start_of
from wrist_stiffness.campaign.fitting.problem import FitProblem, require_units
from wrist_stiffness.campaign.fitting.result import Fit
from wrist_stiffness.campaign.fitting.wander import with_wander
from wrist_stiffness.inference.held_out import HeldOut, sealed_units
from wrist_stiffness.inference.observations import Labels, Observations
from wrist_stiffness.inference.settings import HELD_OUT
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.progress import Progress, silent

ANOTHER_SESSION = "another session"
THIS_SESSION = "this session only"
SEEN = "the fit's own data"


@dataclass(frozen=True, eq=False)
class Judged:
    """A fit and what it leaves of the units by which it is judged.

    Parameters
    ----------
    fit : Fit
        It has not seen those units, unless `by` says so.
    observations : Observations
        Residuals of those units, NaN where not measured or lost.
    rows : (k,) int
        Their numbers among the units of all sessions.
    by : str
        `another session`, `this session only` or `the fit's own data`.
    """

    fit: Fit
    observations: Observations
    rows: Labels
    by: str

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square of each quantity, by its key."""
        left = HeldOut(self.observations.values, np.empty(0))
        return {q.key: left.rmse(q) for q in self.observations.reported}

    def held_out(self, fit: Fit) -> HeldOut:
        """Return what is left, made white with the noise of a fit."""
        values = self.observations.values
        units = with_wander(self.observations, fit.wander)
        return HeldOut(values, fit.noise.whiten(units, values[:, :, None])[:, 0])


def judged(
    problem: FitProblem,
    start: tuple[FitProblem, Array] | None = None,
    progress: Progress = silent,
) -> Judged:
    """Fit to all but the held-out units and say what is left of those.

    Parameters
    ----------
    problem : FitProblem
        All sessions.
    start : (FitProblem, (q,) float), optional
        Point of a like problem from which to begin.
    progress : callable
        Told steps done and steps at most.
    """
    table = problem.table
    aside = sealed_units(table, HELD_OUT)
    if len(problem.sessions) == 1:
        require_units(problem, int(np.count_nonzero(aside)))
        found = fit(problem, _begin(problem, start), aside, progress)
        return Judged(found, found.observations.take(aside), table.rows[aside], THIS_SESSION)
    earlier = replace(problem, sessions=problem.sessions[:-1])
    require_units(earlier)
    found = fit(earlier, _begin(earlier, start), None, progress)
    again = tuple(each for each in problem.free if each.per_session)
    own = {each.effect.name for each in again}
    wrist = tuple(each for each in found.effects() if each.name not in own)
    last = FitProblem(
        problem.model.with_effects(*problem.model.effects, *wrist), problem.sessions[-1:], again
    )
    left = fit(last).observations if again else last.table.with_values(last.residual(np.empty(0)))
    return Judged(found, left, table.rows[aside], ANOTHER_SESSION)


def _begin(problem: FitProblem, start: tuple[FitProblem, Array] | None) -> Array | None:
    return None if start is None else start_of(problem, *start)


def judged_by_itself(found: Fit) -> Judged:
    """Return a fit with what it leaves of its own data."""
    return Judged(found, found.observations, found.observations.rows, SEEN)
