"""A plain table made ready for the search: whitened, with the size of its noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from wrist_stiffness.inference.candidates import Candidate
from wrist_stiffness.inference.discrepancy import background, unresolved
from wrist_stiffness.inference.noise import scatter_of
from wrist_stiffness.inference.observations import Array, Mask, Observations
from wrist_stiffness.inference.outliers import lost_units
from wrist_stiffness.inference.point import Background
from wrist_stiffness.inference.projection import orthonormal
from wrist_stiffness.inference.settings import FEWEST_UNITS, OUTLIER_LIMIT
from wrist_stiffness.inference.shared import (
    Apart,
    component_factors,
    own_covariance,
    stated_covariance,
)
from wrist_stiffness.inference.smooth import alike, questions, wander

STATED, ESTIMATED = 0.2, 0.7
"""Standard deviation of the logarithm of the noise's variance where the table states it, and where
only what everything together leaves tells it (assumed)."""

DRIFT = 0.5
"""Expected size of an instrument's slow drift, in scatters of one unit (assumed)."""

BEYOND = 0.03
"""Least part of a question that no name must be able to answer, or it is not asked."""

LAW_RANK = 8
"""Columns of the error of one law."""


class Table:
    """Units of a table as whitened rows.

    Parameters
    ----------
    observations : Observations
        n units of m components.
    base : (n, m, p) float
        Columns of what is refitted.
    named : (n, m, k) float
        Columns of all candidates.
    ordered : bool
        Whether the rows follow each other in time, so that an instrument drifts over them.
    """

    def __init__(
        self, observations: Observations, base: Array, named: Array, ordered: bool
    ) -> None:
        self.observations = observations
        self.ordered = ordered and observations.time_s is not None
        self.questions = questions(observations)
        self._drift = wander(observations) if self.ordered else None
        told = observations.covariance is not None
        self.variance, self.noise_width = (
            (_stated(observations), STATED) if told else self._estimated(base, named)
        )
        n, m = observations.values.shape
        stated = stated_covariance(observations) if told else np.diag(self.variance)
        own = own_covariance(observations, np.broadcast_to(stated, (n, m, m)))
        self.scatter: Array = np.sqrt(np.median(np.diagonal(own, axis1=1, axis2=2), axis=0))
        if self._drift is not None:
            # What the columns of the drift cannot follow is scatter of each row by itself.
            beyond = unresolved(self._drift)[:, None] * (DRIFT * self.scatter) ** 2
            own = own + beyond[:, :, None] * np.eye(m)
        self._apart = Apart(observations, component_factors(own, observations.measured))
        self._rows = np.flatnonzero(observations.measured.ravel())

    def background(self, named: Array) -> Background:
        """Return what has no name.

        The discrepancy is what the columns that have one, (N, q), cannot do (Plumlee 2017): what a
        candidate explains is never called unknown for being smooth.
        """
        drift = DRIFT * self.scatter if self.ordered else None
        own = orthonormal(named)
        whole = background(
            self.observations,
            self.whiten,
            self.questions,
            self.scatter,
            drift,
            self.noise_width,
            self._drift,
        )
        groups = []
        for each in whole.groups:
            left = each.columns
            if each.expected == 0.0:
                left = left - own @ (own.T @ left)
            if np.linalg.norm(left) > BEYOND * np.linalg.norm(each.columns):
                groups.append(replace(each, columns=left))
        return Background(tuple(groups), self.noise_width)

    @cached_property
    def alike(self) -> Array:
        """Columns (n, l) of units under like conditions."""
        return alike(self.observations, LAW_RANK)

    def whiten(self, values: Array) -> Array:
        """Return (n, m) or (n, m, k) as rows of unit scatter, (N,) or (N, k)."""
        columns = values if values.ndim == 3 else values[:, :, None]
        measured = self.observations.measured[:, :, None]
        white = self._apart(np.where(measured, columns, 0.0)).reshape(
            measured.size, -1 if columns.size else 0
        )
        return white[self._rows] if values.ndim == 3 else white[self._rows, 0]

    def varied(self, change: Array) -> Array:
        """Return what a change (n, m) adds where its size changes with the conditions, (N, l)."""
        return self.whiten(change[:, :, None] * self.alike[:, None, :])

    def _estimated(self, base: Array, named: Array) -> tuple[Array, float]:
        """Return the variance (m,) by repeated conditions, or by what everything leaves."""
        structure = np.concatenate([named, everything(self)], axis=2)
        variance, repeats = scatter_of(self.observations, base, structure)
        if not repeats:
            return variance, ESTIMATED
        seen = self.observations.measured.any(axis=0).sum()
        return variance, max(float(np.sqrt(2.0 / (repeats * seen))), STATED)


def everything(table: Table) -> Array:
    """Return the columns (n, m, q) of all questions, in every component."""
    observations = table.observations
    m = observations.n_components
    columns = [each.features(observations.covariates) for each in table.questions]
    if table.ordered:
        columns.append(wander(observations))
    features = np.concatenate([np.zeros((observations.n_units, 0)), *columns], axis=1)
    spread = features[:, None, :, None] * np.eye(m)[:, None, :]
    return np.asarray(spread.reshape(*observations.values.shape, -1))


def _stated(observations: Observations) -> Array:
    covariance = np.asarray(observations.covariance)
    diagonal = np.diagonal(covariance, axis1=-2, axis2=-1)
    return np.asarray(diagonal if covariance.ndim == 2 else np.median(diagonal, axis=0))


def lost(observations: Observations, base: Array, candidates: Sequence[Candidate]) -> Mask:
    """Return which units lie far from everything together, (n,)."""
    if observations.n_units < FEWEST_UNITS:
        return np.zeros(observations.n_units, dtype=bool)
    m = observations.n_components
    smooth = [each.features(observations.covariates) for each in questions(observations)]
    features = np.concatenate([np.zeros((observations.n_units, 0)), *smooth], axis=1)
    spread = features[:, None, :, None] * np.eye(m)[:, None, :]
    columns = [base, spread.reshape(observations.n_units, m, -1)]
    columns += [each.evaluate(observations, s) for each in candidates for s in each.shapes]
    return lost_units(observations, np.concatenate(columns, axis=2), OUTLIER_LIMIT)
