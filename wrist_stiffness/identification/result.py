"""Where a fit arrived: estimates with uncertainties, and the model that they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wrist_stiffness.identification.problem import NO_PRIOR, FitProblem
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.sessions.observing import without_mounting

EXCITED = 0.7
"""A parameter is excited if its uncertainty falls below this share of its prior's."""

FAR = 3.0
"""Standard deviations of its prior beyond which a parameter is farther off than usual."""

TOGETHER = 0.7
"""Correlation from which two parameters are said to be told together only."""


@dataclass(frozen=True)
class FittedParameter:
    """One parameter after the fit.

    Parameters
    ----------
    effect, key : str
        `law@component`, name with unit.
    session : str or None
        Session whose own it is, None for the wrist's.
    value, sigma : float
        Estimate and one standard uncertainty, in the unit of the name.
    prior, prior_sigma : float
        Mean and standard deviation of the prior.
    usual : float
        Standard deviation of the law's own prior; that of the fit may be wider.
    at_bound : bool
        Whether the estimate lies on a bound of what is possible.
    together : tuple of str
        Parameters with which it is told together only.
    """

    effect: str
    key: str
    session: str | None
    value: float
    sigma: float
    prior: float
    prior_sigma: float
    usual: float
    at_bound: bool
    together: tuple[str, ...]

    @property
    def excited(self) -> bool:
        """Whether the data say more of it than its prior."""
        return self.sigma < EXCITED * self.prior_sigma

    @property
    def moved(self) -> float:
        """How far it went from the mean of its prior, in standard deviations that are usual."""
        return (self.value - self.prior) / self.usual

    @property
    def far(self) -> bool:
        """Whether the data say that it is farther off than usual."""
        return self.excited and abs(self.moved) > FAR


def told_parameters(
    problem: FitProblem, z: Array, covariance: Array, prior: Array
) -> tuple[FittedParameter, ...]:
    """Return all that was fitted, with uncertainties.

    Parameters
    ----------
    problem : FitProblem
        What was free.
    z, covariance : (p,), (p, p) float
        Steps from the means of the priors.
    prior : (p,) float
        Widths of the priors, in steps.
    """
    sigma = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance / np.outer(sigma, sigma)) - np.eye(len(sigma))
    names = [f"{problem.free[u.free].effect.name} {u.key}" for u in problem.unknowns]
    fitted = [problem.effects(z, number) for number in range(len(problem.sessions))]
    out = []
    for place, (unknown, steps) in enumerate(zip(problem.unknowns, z.tolist(), strict=True)):
        effect = fitted[unknown.session or 0][unknown.free]
        value = effect.estimates[unknown.key].value
        # A fit begins with a wider prior where an effect is large; that is no knowledge of it.
        own = {each.key: each.scale for each in effect.parameters}
        usual = min(unknown.step, own[unknown.key])
        near = 1e-6 * unknown.step
        out.append(
            FittedParameter(
                problem.free[unknown.free].effect.name,
                unknown.key,
                None if unknown.session is None else problem.sessions[unknown.session].name,
                value,
                float(sigma[place]) * unknown.step,
                value - steps * unknown.step,
                float(prior[place]) * unknown.step,
                usual / (1.0 if unknown.weight > NO_PRIOR else NO_PRIOR),
                min(value - unknown.lower, unknown.upper - value) < near,
                tuple(names[i] for i in np.flatnonzero(correlation[place] > TOGETHER)),
            )
        )
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Fit:
    """What is known of a wrist after a fit.

    Parameters
    ----------
    fit : WristFit
        Set-up, tolerances and effects at their most probable values.
    lost : int
        Units left out as lost beams.
    """

    fit: WristFit
    lost: int

    @property
    def problem(self) -> FitProblem:
        """What was fitted, without the lost units."""
        return self.fit.base.problem

    @property
    def z(self) -> Array:
        """Steps of the unknowns from the means of their priors, (p,)."""
        return self.fit.base.z

    @cached_property
    def covariance(self) -> Array:
        """Covariance of `z` (p, p): noise, drift and a discrepancy are in it."""
        return self.fit.covariance

    @property
    def columns(self) -> Array:
        """Change of the residual by a step of each unknown, (u, 6, p) [m, rad]."""
        return self.fit.base.columns

    @property
    def observations(self) -> Observations:
        """The units with their residuals [m, rad]."""
        table = self.problem.table
        return table.with_values(without_mounting(table, self.fit.base.residual))

    @property
    def arrived(self) -> bool:
        """Whether the steps settled."""
        return self.fit.base.arrived

    @cached_property
    def noise(self) -> dict[str, float]:
        """Root mean square of the noise and the instrument's drift, by the key of the quantity."""
        return self.fit.table.noise_and_drift(self.fit.evidence)

    @cached_property
    def discrepancy(self) -> dict[str, float]:
        """Root mean square that the model leaves above that, likewise."""
        return self.fit.table.above(self.fit.evidence)

    @property
    def rough(self) -> bool:
        """Whether more than noise is left."""
        return self.fit.evidence.unexplained > 0.0

    @cached_property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted, with uncertainties."""
        prior = self.fit.ratio / np.sqrt(self.fit.evidence.precision[: len(self.z)])
        return told_parameters(self.problem, self.z, self.covariance, prior)

    def effects(self, session: int = -1) -> tuple[Effect, ...]:
        """Return the free effects with estimates and uncertainties, as a session has them."""
        problem = self.problem
        session %= len(problem.sessions)
        sigma = np.sqrt(np.diag(self.covariance))
        estimates: list[dict[str, Estimate]] = [
            dict(each.effect.estimates) for each in problem.free
        ]
        values = problem.effects(self.z, session)
        for unknown, own in zip(problem.unknowns, sigma, strict=True):
            if unknown.session in (None, session):
                value = values[unknown.free].estimates[unknown.key].value
                estimates[unknown.free][unknown.key] = Estimate(value, float(own) * unknown.step)
        return tuple(
            replace(each.effect, estimates=own)
            for each, own in zip(problem.free, estimates, strict=True)
        )

    @property
    def joint(self) -> JointUncertainty:
        """What the uncertainties of all parameters make of a prediction together."""
        rows, measured = self.columns, self.problem.table.measured
        if any(each.gauges is not None for each in self.problem.sessions):
            rows = self.problem.twists(self.z)
            measured = np.ones(rows.shape[:2], dtype=bool)
        variance = np.einsum("uij,jk,uik->ui", rows, self.covariance, rows)
        mean = (variance * measured).sum(axis=0) / np.maximum(measured.sum(axis=0), 1)
        names = tuple(free.effect.name for free in self.problem.free)
        return JointUncertainty(names, np.sqrt(mean))

    def model(self, session: int = -1) -> ErrorModel:
        """Return the model with the fitted effects, as a session has them."""
        model = self.problem.model
        return model.with_effects(*model.effects, *self.effects(session))
