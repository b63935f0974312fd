"""The likelihood of a wrist's units: what noise, drift and a discrepancy make of each, whitened."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.identification.questions import Conditions, alike, passing, questions
from wrist_stiffness.inference.discrepancy import (
    PASSING,
    SLOW_DRIFT,
    Question,
    background,
    drift_features,
    low_rank,
    unresolved,
)
from wrist_stiffness.inference.evidence import Evidence
from wrist_stiffness.inference.noise import scatter_of
from wrist_stiffness.inference.observations import Labels, Observations
from wrist_stiffness.inference.point import Background
from wrist_stiffness.inference.shared import Apart, component_factors, own_covariance
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.observing import usual_wander
from wrist_stiffness.sessions.unit_session import UnitSession

DRIFT = 0.5
"""Expected size of an instrument's slow drift where it states none, in scatters of one
measurement (assumed)."""

KNOWN, UNKNOWN = 0.2, 3.0
"""Standard deviation of the logarithm of the noise's variance where an instrument or dwells tell
it, and where nothing does (assumed)."""

SURE_OF_NOISE = 3.0
"""Widths by which noise may be more than is known of it; beyond, it is a misfit."""

LAW_RANK = 8
"""Columns of the error of one law."""


def unstated(table: Observations, residual: Array, columns: Array) -> tuple[Array, float] | None:
    """Return the variance of a unit, (m,), where nothing states it, and how well it is known.

    By repeated conditions, or by what neither a fit nor any smooth law of the conditions explains.
    How much in all remains to be found; how much more one gauge scatters than another, and angles
    than lengths, does not.

    Parameters
    ----------
    table : Observations
        Conditions of u units.
    residual : (u, m) float
        What the fit leaves [m, rad].
    columns : (u, m, p) float
        Its slopes.

    Returns
    -------
    ((m,) float, float) or None
        The variance, and the standard deviation of its logarithm; None where it is stated.
    """
    if table.covariance is not None:
        return None
    common = np.zeros((*table.values.shape, 0)) if table.common is None else table.common
    asked = [each.features(table.covariates) for each in questions(table.covariates)]
    smooth = [np.zeros((table.n_units, 0)), *(each for each in asked if each is not None)]
    spread = np.concatenate(smooth, axis=1)[:, None, :, None] * np.eye(table.n_components)[:, None]
    base = np.concatenate([columns, common], axis=2)
    structure = spread.reshape(*table.values.shape, -1)
    variance, repeats = scatter_of(table.with_values(residual), base, structure)
    if not repeats:
        return variance, UNKNOWN
    seen = table.measured.any(axis=0).sum()
    return variance, max(float(np.sqrt(2.0 / (repeats * seen))), KNOWN)


def likelihood_of(base: BaseFit) -> WristTable:
    """Return the likelihood of the units of a fit."""
    table = base.problem.table
    return WristTable(table, base.problem.sessions, unstated(table, base.residual, base.columns))


class WristTable:
    """The units of the sessions as whitened rows.

    Parameters
    ----------
    table : Observations
        Of `observing.tabulate`.
    sessions : sequence of UnitSession
        Of which.
    scatter : ((m,) float, float), optional
        Variance of one unit and how well it is known, where nothing states it: see `unstated`.
    ask : callable, optional
        From the conditions to what is asked of the discrepancy.
    """

    def __init__(
        self,
        table: Observations,
        sessions: Sequence[UnitSession],
        scatter: tuple[Array, float] | None = None,
        ask: Callable[[Conditions], Sequence[Question]] = questions,
    ) -> None:
        self.table: Observations = table
        stated = table.covariance
        usual, width = scatter or (4.0 * usual_wander(table.quantities) ** 2, UNKNOWN)
        self._noise_width = width if stated is None else KNOWN
        own = own_covariance(table, np.diag(usual) if stated is None else stated)
        # A drift that is stated has columns of its own.
        slow = np.concatenate(
            [np.broadcast_to(s.wander, (len(s), len(s.wander)))[s.measured] for s in sessions]
        )
        if stated is not None:
            own = own - slow[:, :, None] ** 2 * np.eye(table.n_components)
        variance: Array = np.diagonal(own, axis1=1, axis2=2)
        self._scatter = variance
        if table.shared is not None and table.stand is not None:
            shared = np.sum(table.shared**2, axis=2) * (table.stand >= 0)[:, None]
            self._scatter = variance + shared
        each = [np.broadcast_to(s.white, (len(s), len(s.white)))[s.measured] for s in sessions]
        single = np.nan_to_num(np.median(np.concatenate(each), axis=0))
        single = np.where(single > 0.0, single, np.sqrt(np.median(variance, axis=0)))
        self.drift = np.maximum(DRIFT * single, slow.max(axis=0))
        wander = drift_features(table)
        short = passing(table.sessions, table.covariates)
        # What the columns of a drift cannot follow is scatter of each unit by itself.
        beyond = unresolved(wander) + PASSING**2 * unresolved(short)
        own = own + (beyond[:, None] * self.drift**2)[:, :, None] * np.eye(table.n_components)
        self.variance: Array = np.diagonal(own, axis1=1, axis2=2)
        self._apart = Apart(table, component_factors(own, table.measured))
        self._rows = np.flatnonzero(table.measured.ravel())
        self.background: Background = background(
            table,
            self.whiten,
            ask(table.covariates),
            np.sqrt(np.median(self.variance, axis=0)),
            self.drift,
            self._noise_width,
            wander,
            short,
        )
        self._alike = low_rank(alike(table.covariates), LAW_RANK)

    def whiten(self, values: Array) -> Array:
        """Return (u, 6) or (u, 6, k) as rows of unit scatter, (N,) or (N, k)."""
        columns = values if values.ndim == 3 else values[:, :, None]
        filled = np.where(self.table.measured[:, :, None], np.nan_to_num(columns), 0.0)
        white = self._apart(filled).reshape(self.table.measured.size, columns.shape[2])
        white = white[self._rows]
        return white if values.ndim == 3 else white[:, 0]

    @property
    def unit(self) -> Labels:
        """Unit of each row, (N,)."""
        return self._rows // self.table.n_components

    def noise(self, found: Evidence) -> dict[str, float]:
        """Return the scatter of a unit by noise and hidden counts, RMS by quantity."""
        return self.table.rms(self._scatter_of(found))

    def noise_and_drift(self, found: Evidence) -> dict[str, float]:
        """Return that with the instrument's slow drift, RMS by quantity."""
        own = self._scatter_of(found)
        at = {each.name: list(each.components) for each in self.table.quantities}
        groups = zip(found.background.groups, found.amplitude, found.discrepant, strict=True)
        for group, size, wrong in groups:
            if group.name == SLOW_DRIFT and not wrong:
                own[:, at[group.quantity]] += (size * self.drift[at[group.quantity]]) ** 2
        return self.table.rms(own)

    def _scatter_of(self, found: Evidence) -> Array:
        """Variance of each unit by noise, as far as the excess is no misfit."""
        known = np.log(found.excess) <= SURE_OF_NOISE * self._noise_width
        return self._scatter * (found.excess if known else 1.0)

    def above(self, found: Evidence) -> dict[str, float]:
        """Return what is left above that noise, RMS by quantity."""
        own = np.zeros_like(self.variance)
        for quantity in self.table.quantities:
            at = list(quantity.components)
            count = max(int(self.table.measured[:, at].sum()), 1)
            own[:, at] = self.variance[:, at] * found.left_of(quantity.name, count)
        return self.table.rms(own)

    def varied(self, change: Array) -> Array:
        """Return columns (N, l) for a change (u, 6) whose size changes with the conditions.

        Units under like conditions change alike.
        """
        return self.whiten(change[:, :, None] * self._alike[:, None, :])
