"""What the search asks of a wrist: fits of sets of effects, and every candidate about them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wrist_stiffness.campaign.searching.base_fit import BaseFit, fit_base, has_walls
from wrist_stiffness.campaign.searching.base_problem import WANDER
from wrist_stiffness.campaign.searching.candidates import (
    Point as WristPoint,
)
from wrist_stiffness.campaign.searching.candidates import (
    WristCandidate,
    wrist_candidates,
)
from wrist_stiffness.campaign.searching.own_law import Beyond
from wrist_stiffness.campaign.searching.questions import alike, questions
from wrist_stiffness.campaign.unit_session import UnitSession
from wrist_stiffness.errors import WristError
from wrist_stiffness.inference.discrepancy import background, low_rank
from wrist_stiffness.inference.evidence import Background, Point
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.search import FALLS, Ranked, Trial
from wrist_stiffness.inference.shared import Apart, own_covariance
from wrist_stiffness.inference.whitening import component_factors
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel

DRIFT = 0.5
"""Expected size of an instrument's slow drift where it states none, in scatters of one
measurement (assumed)."""

KNOWN, UNKNOWN = 0.2, 3.0
"""Standard deviation of the logarithm of the noise's variance where an instrument or dwells tell
it, and where nothing does (assumed)."""

LEAVES_MUCH = 1.5
"""Variance of what is left, in units of the noise, from which a fit is begun from the drawing too:
tolerances that gave way to a large effect may not find back."""

LAW_RANK = 8
"""Columns of the error of one law."""


class WristTable:
    """The units of the sessions as whitened rows.

    Parameters
    ----------
    fitted : BaseFit
        Any fit to them.
    """

    def __init__(self, fitted: BaseFit) -> None:
        table, sessions = fitted.problem.table, fitted.problem.sessions
        self.table: Observations = table
        stated = table.covariance
        self._noise_width = UNKNOWN if stated is None else KNOWN
        own = own_covariance(table, np.diag(4.0 * WANDER**2) if stated is None else stated)
        # A drift that is stated has columns of its own.
        slow = np.concatenate(
            [np.broadcast_to(s.wander, (len(s), 6))[s.measured] for s in sessions]
        )
        if stated is not None:
            own = own - slow[:, :, None] ** 2 * np.eye(6)
        self._apart = Apart(table, component_factors(own, table.measured))
        self._rows = np.flatnonzero(table.measured.ravel())
        self.variance: Array = np.diagonal(own, axis1=1, axis2=2)
        scatter = np.sqrt(np.median(self.variance, axis=0))
        each = [np.broadcast_to(s.white, (len(s), 6))[s.measured] for s in sessions]
        single = np.nan_to_num(np.median(np.concatenate(each), axis=0))
        single = np.where(single > 0.0, single, scatter)
        self.drift = np.maximum(DRIFT * single, slow.max(axis=0))
        self.background: Background = background(
            table, self.whiten, questions(table.covariates), scatter, self.drift, self._noise_width
        )
        self._alike = low_rank(alike(table.covariates), LAW_RANK)

    def whiten(self, values: Array) -> Array:
        """Return (u, 6) or (u, 6, k) as rows of unit scatter, (N,) or (N, k)."""
        columns = values if values.ndim == 3 else values[:, :, None]
        filled = np.where(self.table.measured[:, :, None], np.nan_to_num(columns), 0.0)
        white = self._apart(filled).reshape(-1, columns.shape[2])[self._rows]
        return white if values.ndim == 3 else white[:, 0]

    def varied(self, change: Array) -> Array:
        """Return columns (N, l) for a change (u, 6) whose size changes with the conditions.

        Units under like conditions change alike.
        """
        return self.whiten(change[:, :, None] * self._alike[:, None, :])


@dataclass(frozen=True, eq=False)
class WristFit:
    """A set of effects fitted whole to the wrist.

    Parameters
    ----------
    base : BaseFit
        Set-up, tolerances and effects.
    table : WristTable
        Of the same units.
    """

    base: BaseFit
    table: WristTable

    @property
    def names(self) -> Collection[str]:
        """Effects of the set."""
        return self.base.extras

    def change(self, name: str) -> Array:
        """Return what an effect of the set does to the predictions, (u, 6) to first order."""
        at = self.places[name]
        return np.asarray(-self.base.columns[:, :, at] @ self.base.z[at])

    @cached_property
    def places(self) -> dict[str, np.ndarray]:
        """Places of the unknowns of each effect."""
        problem, of_base = self.base.problem, self.base.of_base
        names = [problem.free[unknown.free].effect.name for unknown in problem.unknowns]
        return {
            own: np.flatnonzero([n == own and not b for n, b in zip(names, of_base, strict=True)])
            for own in self.names
        }

    @cached_property
    def point(self) -> Point:
        """Where the fit ended, whitened."""
        base, table = self.base, self.table
        columns, z = base.columns.copy(), base.z.copy()
        inexact = [np.zeros((len(table.whiten(base.residual)), 0))]
        varied = {}
        for name, places in self.places.items():
            effect = base.problem.free[base.problem.unknowns[places[0]].free].effect
            known = {each.key: each for each in effect.parameters}
            varied[name] = table.varied(self.change(name))
            inexact.append(effect.law.inexactness * varied[name])
            for place in places:
                unknown = base.problem.unknowns[place]
                own = known[unknown.key]
                columns[:, :, place] *= own.scale / unknown.step
                value = unknown.mean + base.z[place] * unknown.step
                z[place] = (value - own.mean) / own.scale
        return Point(
            table.whiten(base.residual),
            table.whiten(columns),
            z,
            base.problem.weights.copy(),
            self.places,
            np.concatenate(inexact, axis=1),
            varied,
        )


class WristProblem:
    """A wrist and its sessions as the search asks them.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    sessions : tuple of UnitSession
        In the order of time.
    """

    def __init__(self, model: ErrorModel, sessions: tuple[UnitSession, ...]) -> None:
        self._model, self._sessions = model, sessions
        self._first = fit_base(model, sessions)
        self.table = WristTable(self._first)
        self._asked: dict[int, tuple[BaseFit, WristPoint, dict[str, WristCandidate]]] = {}

    @property
    def background(self) -> Background:
        """What has no name."""
        return self.table.background

    def begin(self) -> WristFit:
        """Return the nominal model with its tolerances."""
        return WristFit(self._first, self.table)

    def trials(self, fit: WristFit) -> Sequence[Trial]:
        """Return the catalogue about a fit."""
        _, candidates = self._catalogue(fit)
        found = []
        for each in candidates.values():
            blocks = [
                (shape, self.table.whiten(-each.at(shape) * each.usual)) for shape in each.shapes
            ]
            found.append(Trial(each.name, each.law.smooth, tuple(blocks)))
        return found

    def added(self, fit: WristFit, ranked: Ranked) -> WristFit | None:
        """Return the best fit with one effect more; None where its law finds no equilibrium."""
        point, candidates = self._catalogue(fit)
        candidate = candidates[ranked.trial.name]
        factors = [each.factor.name for each in candidate.recipe.columns(ranked.shape)]
        values = (ranked.z * candidate.usual).tolist()
        start = candidate.effect(dict(zip(factors, values, strict=True)), ranked.shape)
        try:
            own = Beyond(fit.base, point).fitted(candidate, start)
            extras = [*fit.base.beyond().values(), own]
            found = self._fitted(extras, fit.base)
            if found.variance > LEAVES_MUCH and found.cost < FALLS * fit.base.cost:
                found = min(found, self._fitted(extras, None), key=_cost)
            if found.variance > LEAVES_MUCH and has_walls(own):
                usual = {p.key: p.mean or p.scale for p in own.parameters}
                gradual = [*fit.base.beyond().values(), own.with_values(usual)]
                found = min(found, self._gradual(gradual, fit.base), key=_cost)
        except WristError:
            return None
        return WristFit(found, self.table)

    def without(self, fit: WristFit, name: str) -> WristFit:
        """Return the fit with one effect less, begun where this one ended."""
        others = [each for own, each in fit.base.beyond().items() if own != name]
        return WristFit(self._fitted(others, fit.base), self.table)

    def _fitted(self, extras: Sequence[Effect], start: BaseFit | None) -> BaseFit:
        return fit_base(self._model, self._sessions, extras, start)

    def _gradual(self, extras: Sequence[Effect], start: BaseFit) -> BaseFit:
        return fit_base(self._model, self._sessions, extras, start, True, "rounded first")

    def _catalogue(self, fit: WristFit) -> tuple[WristPoint, dict[str, WristCandidate]]:
        known = self._asked.get(id(fit.base))
        if known is None or known[0] is not fit.base:
            sessions = self._sessions
            used = tuple(each.measured for each in sessions)
            models = tuple(fit.base.model(n, with_extras=True) for n in range(len(sessions)))
            point = WristPoint(models, used)
            absent = {each.name for each in self._model.effects} | set(fit.names)
            found = {each.name: each for each in wrist_candidates(point, absent)}
            self._asked = {id(fit.base): (fit.base, point, found)}
            known = self._asked[id(fit.base)]
        return known[1], known[2]


def _cost(fitted: BaseFit) -> float:
    return fitted.cost
