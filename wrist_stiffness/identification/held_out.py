"""What a fit says of units that it has not seen: another session, or the end of the only one."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from wrist_stiffness.identification.base_fit import BaseFit, without_units
from wrist_stiffness.identification.likelihood import WristTable, likelihood_of
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.inference.evidence import Evidence
from wrist_stiffness.inference.held_out import HeldOut, sealed_units
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.observing import without_mounting

ANOTHER_SESSION = "another session"
THIS_SESSION = "the end of this session"

MUCH = 1.5
"""Error of another session, in times noise and drift, that is neither: of one wrist a fit to both
leaves up to 1.1, of two 1.7 and more where noise does not hide it
(`pytest test/identification/test_diagnosing.py -k two_wrists`)."""


class Judge:
    """Fits to what was seen are judged by what was not.

    Parameters
    ----------
    whole : BaseFit
        To all units, without those that are lost.

    Attributes
    ----------
    seen : tuple of UnitSession
        With nothing measured in the units that are held out.
    aside : (u,) bool
        These units, of all that were measured.
    by : str
        What they are.
    """

    def __init__(self, whole: BaseFit) -> None:
        self.whole, sessions = whole, whole.problem.sessions
        self.aside = sealed_units(whole.problem.table)
        self.seen = without_units(sessions, self.aside)
        self.by = ANOTHER_SESSION if len(sessions) > 1 else THIS_SESSION

    def left(self, fitted: BaseFit) -> HeldOut:
        """Return what a fit to the part that was seen leaves of the other.

        What is set up anew in a session of which it saw nothing is taken from the fit that saw all,
        and refitted to first order; everything else keeps its value.
        """
        problem = replace(fitted.problem, sessions=self.whole.problem.sessions)
        known = {_key(self.whole, n): z for n, z in enumerate(self.whole.z)}
        blank = {n for n, each in enumerate(self.seen) if not each.measured.any()}
        fresh = [n for n, unknown in enumerate(problem.unknowns) if unknown.session in blank]
        z = fitted.z.copy()
        z[fresh] = [known[_key(fitted, n)] for n in fresh]
        residual = problem.residual(z)
        if fresh:
            columns = problem.columns(z, places=fresh)
            white, left = (self._white(problem, each) for each in (columns, residual))
            residual = residual + columns @ np.linalg.lstsq(white, -left, rcond=1e-9)[0]
        return self._held_out(problem, residual)

    def noise(self, found: Evidence, drift: bool = False) -> dict[str, float]:
        """Return the scatter of one unit of that part, also by slow drift, RMS by quantity.

        `found`: tells how large both are.
        """
        scatter = self._table.scatter(found, drift)[self.aside]
        return self.whole.problem.table.take(self.aside).rms(scatter)

    @cached_property
    def _table(self) -> WristTable:
        return likelihood_of(self.whole)

    def of_fit(self, fitted: BaseFit) -> HeldOut:
        """Return what a fit to all sessions leaves of that part."""
        return self._held_out(fitted.problem, fitted.residual)

    def of_model(self, model: ErrorModel) -> HeldOut:
        """Return what a model leaves of that part as it stands."""
        problem = FitProblem(model, self.whole.problem.sessions, ())
        return self._held_out(problem, problem.residual(np.empty(0)))

    def _held_out(self, problem: FitProblem, residual: Array) -> HeldOut:
        shown = without_mounting(problem.table, residual)[self.aside]
        return HeldOut(shown, self._white(problem, residual))

    def _white(self, problem: FitProblem, values: Array) -> Array:
        return problem.whiten(values)[np.repeat(self.aside, problem.table.n_components)]


def _key(fitted: BaseFit, number: int) -> tuple[str, str, int | None]:
    unknown = fitted.problem.unknowns[number]
    return unknown.effect.name, unknown.key, unknown.session
