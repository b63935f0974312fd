"""What a fit says of units that it has not seen: another session, or the end of the only one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.identification.parts import Parts, parted
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.inference.held_out import HeldOut, sealed_units
from wrist_stiffness.inference.settings import HELD_OUT
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.observing import without_mounting

ANOTHER_SESSION = "another session"
THIS_SESSION = "the end of this session"


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
    rows = np.repeat(parts.aside, problem.table.n_components)
    residual = problem.residual(z)
    left = problem.whiten(residual)[rows]
    if fresh:
        columns = problem.columns(z, places=fresh)
        white = problem.whiten(columns)[rows]
        step = np.linalg.lstsq(white, -left, rcond=1e-9)[0]
        residual, left = residual + columns @ step, left + white @ step
    return HeldOut(without_mounting(problem.table, residual)[parts.aside], left)


def _key(fitted: BaseFit, number: int) -> tuple[str, str, int | None]:
    unknown = fitted.problem.unknowns[number]
    return fitted.problem.free[unknown.free].effect.name, unknown.key, unknown.session


class Judge:
    """Fits to what was seen are judged by what was not.

    Parameters
    ----------
    whole : BaseFit
        To all units, without those that are lost.
    """

    def __init__(self, whole: BaseFit) -> None:
        self.whole, table = whole, whole.problem.table
        self.parts = parted(whole.problem.sessions, sealed_units(table, HELD_OUT))
        self.by = ANOTHER_SESSION if len(whole.problem.sessions) > 1 else THIS_SESSION

    def left(self, fitted: BaseFit) -> HeldOut:
        """Return what a fit to the part that was seen leaves of the other."""
        return unseen(fitted, self.parts, self.whole)

    def of_model(self, model: ErrorModel) -> HeldOut:
        """Return what a model leaves of that part as it stands."""
        problem = FitProblem(model, self.parts.whole, ())
        residual = problem.residual(np.empty(0))
        rows = np.repeat(self.parts.aside, problem.table.n_components)
        shown = without_mounting(problem.table, residual)[self.parts.aside]
        return HeldOut(shown, problem.whiten(residual)[rows])
