"""The likelihood of a wrist's units: what noise, drift and a discrepancy make of each, whitened."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.identification.questions import (
    Conditions,
    alike,
    passing,
    questions,
    smooth_columns,
)
from wrist_stiffness.inference.discrepancy import (
    DRIFT,
    PASSING,
    SLOW_DRIFT,
    Question,
    background,
    drift_features,
    unresolved,
)
from wrist_stiffness.inference.evidence import Evidence
from wrist_stiffness.inference.noise import KNOWN, unstated
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.projection import low_rank
from wrist_stiffness.inference.shared import (
    LAW_RANK,
    Whitened,
    as_they_stood,
    own_covariance,
    with_shared,
)
from wrist_stiffness.inference.smooth import by_session
from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.sessions.observing import counts_known
from wrist_stiffness.sessions.unit_session import UnitSession


def likelihood_of(base: BaseFit, lost: int = 0) -> WristTable:
    """Return the likelihood of the units of a fit; so many more were lost."""
    return WristTable(_left(base), base.problem.sessions, base.columns, lost=lost)


def _left(base: BaseFit) -> Observations:
    """Return what a fit leaves of the units, which hidden counts change as wrong zeros do.

    A turn about a motor's axis is a shift too where the instrument's frame is not quite F.
    """
    problem = base.problem
    left = problem.table.with_values(base.residual)
    if left.shared is None:
        return left
    step = problem.model.table.geometry.limits.encoder_step
    known = problem.rows([counts_known(each.cut, step) for each in problem.sessions])
    shared = left.shared.copy()
    for place, motor in enumerate(MOTORS):
        slope = np.zeros(left.values.shape)
        for number, unknown in enumerate(problem.unknowns):
            if unknown.effect.name == f"encoder_offset@{motor}":
                turn = np.radians(1e-3 * unknown.step)
                slope += np.nan_to_num(base.columns[:, :, number]) / turn
        zeroed = slope.any(axis=1)
        shared[zeroed, :, place] = (step / np.sqrt(12.0 * known[:, [place]]) * slope)[zeroed]
    covariance = left.covariance
    if covariance is not None:
        covariance = covariance - _product(left.shared) + _product(shared)
    return replace(left, shared=shared, covariance=covariance)


def _product(columns: Array) -> Array:
    return np.asarray(columns @ np.swapaxes(columns, -1, -2))


class WristTable(Whitened):
    """The units of the sessions as whitened rows.

    Where nothing states their noise it is told by repeated conditions, or by what neither a fit nor
    any smooth law of the conditions explains.  How much in all remains to be found; how much more
    one gauge scatters than another, and angles than lengths, does not.

    `left`: what a fit leaves of the units, under the conditions of `observing.tabulate` [m, rad];
    `sessions`: of which; `columns` (u, m, p): slopes of that fit; `ask`: from the conditions to
    what is asked of the discrepancy; `lost`: units that were left out as lost beams.
    """

    def __init__(
        self,
        left: Observations,
        sessions: Sequence[UnitSession],
        columns: Array,
        ask: Callable[[Conditions], Sequence[Question]] = questions,
        lost: int = 0,
    ) -> None:
        self.lost = lost
        each_its_own = np.eye(left.n_components)
        slow = np.concatenate(
            [np.broadcast_to(s.drift, (len(s), len(s.drift)))[s.measured] for s in sessions]
        )
        base = columns if left.common is None else np.concatenate([columns, left.common], 2)
        stated = left.covariance
        if stated is None:
            left, usual, width = unstated(left, base, smooth_columns(left))
            own = own_covariance(left, with_shared(left, np.diag(usual)))
        else:
            left = as_they_stood(left, base, smooth_columns(left))
            # A drift that is stated has columns of its own.
            own = own_covariance(left, stated) - slow[:, :, None] ** 2 * each_its_own
            width = KNOWN
        variance: Array = np.diagonal(own, axis1=1, axis2=2)
        self._scatter = variance
        if left.shared is not None and left.stand is not None:
            shared = np.sum(left.shared**2, axis=2) * (left.stand >= 0)[:, None]
            self._scatter = variance + shared
        each = [np.broadcast_to(s.white, (len(s), len(s.white)))[s.measured] for s in sessions]
        single = np.nan_to_num(np.median(np.concatenate(each), axis=0))
        single = np.where(single > 0.0, single, np.sqrt(np.median(variance, axis=0)))
        self.drift = np.maximum(DRIFT * single, slow.max(axis=0))
        wander = by_session(left, drift_features)
        short = passing(left.sessions, left.covariates)
        # What the columns of a drift cannot follow is scatter of each unit by itself.
        beyond = unresolved(wander) + PASSING**2 * unresolved(short)
        own = own + (beyond[:, None] * self.drift**2)[:, :, None] * each_its_own
        self.variance = np.diagonal(own, axis1=1, axis2=2)
        super().__init__(left, own, low_rank(alike(left.covariates), LAW_RANK)[0])
        asked, usual = ask(left.covariates), np.sqrt(np.median(self.variance, axis=0))
        self.background = background(self, asked, usual, width, self.drift, wander, short)

    def noise(self, found: Evidence) -> dict[str, float]:
        """Return the scatter of a unit by noise and hidden counts, RMS by quantity."""
        return self.observations.rms(self.scatter(found))

    def noise_and_drift(self, found: Evidence) -> dict[str, float]:
        """Return that with the instrument's slow drift as it went here, RMS by quantity.

        What the set-up takes up of a drift is in no residual.
        """
        drift, ground = np.zeros(self.observations.values.shape), found.background
        for number, (group, wrong) in enumerate(zip(ground.groups, found.discrepant, strict=True)):
            if group.name == SLOW_DRIFT and not wrong:
                drift += group.change(found.unnamed[ground.group == number])
        return self.observations.rms(self.scatter(found) + drift**2)

    def scatter(self, found: Evidence, drift: bool = False) -> Array:
        """Return the variance of each unit by noise, and by slow drift, (u, m).

        `found`: of these sessions or of others of the same instrument; it tells how large both are.
        """
        own = self._scatter * found.noise
        at = {each.name: list(each.components) for each in self.observations.quantities}
        groups = zip(found.background.groups, found.amplitude, found.discrepant, strict=True)
        for group, size, wrong in groups:
            if drift and group.name == SLOW_DRIFT and not wrong:
                own[:, at[group.quantity]] += (size * self.drift[at[group.quantity]]) ** 2
        return own
