"""Where a fit arrived: estimates with uncertainties, and the model that they make."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.campaign.fitting.problem import NO_PRIOR, FitProblem
from wrist_stiffness.campaign.fitting.wander import with_wander
from wrist_stiffness.inference.observations import Mask, Observations
from wrist_stiffness.inference.whitening import NoiseModel
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.parameters import Estimate

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


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit arrived.

    Parameters
    ----------
    problem : FitProblem
        What was fitted.
    z : (p,) float
        Steps of the unknowns from the means of their priors.
    covariance : (p, p) float
        Of `z`; the colour of the noise and a misfit beyond it are in it.
    columns : (u, 6, p) float
        Change of the residual by a step of each unknown [m, rad].
    residual : (u, 6) float
        Of the units of `problem.table`, NaN where not measured or lost [m, rad].
    used : (u,) bool
        Units that the fit saw.
    noise : NoiseModel
        Scatter of the units, with a misfit counted as more of it.
    wander : (2, 6) float
        Scatter of moments in motion and of rests beside what the table states, in `seen` already
        [m, rad].
    misfit : float
        Sum of the squared white residuals over their degrees of freedom; 1 if only noise is left.
    lost : int
        Units left out as lost beams.
    arrived : bool
        Whether the steps converged.
    """

    problem: FitProblem
    z: Array
    covariance: Array
    columns: Array
    residual: Array
    used: Mask
    noise: NoiseModel
    wander: Array
    misfit: float
    lost: int
    arrived: bool

    @property
    def observations(self) -> Observations:
        """The units with their residuals."""
        return self.problem.table.with_values(self.residual)

    @property
    def seen(self) -> Observations:
        """The units that the fit saw, the others blank, with their wander."""
        blank = np.where(self.used[:, None], self.residual, np.nan)
        return with_wander(self.problem.table.with_values(blank), self.wander)

    @property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted, with uncertainties."""
        problem = self.problem
        sigma = np.sqrt(np.diag(self.covariance))
        correlation = np.abs(self.covariance / np.outer(sigma, sigma)) - np.eye(len(sigma))
        names = [f"{problem.free[u.free].effect.name} {u.key}" for u in problem.unknowns]
        fitted = [problem.effects(self.z, number) for number in range(len(problem.sessions))]
        out = []
        for place, (unknown, z) in enumerate(zip(problem.unknowns, self.z, strict=True)):
            effect = fitted[unknown.session or 0][unknown.free]
            value = effect.estimates[unknown.key].value
            near = 1e-6 * unknown.step
            out.append(
                FittedParameter(
                    problem.free[unknown.free].effect.name,
                    unknown.key,
                    None if unknown.session is None else problem.sessions[unknown.session].name,
                    value,
                    float(sigma[place]) * unknown.step,
                    value - float(z) * unknown.step,
                    unknown.step / unknown.weight,
                    unknown.step / (1.0 if unknown.weight > NO_PRIOR else NO_PRIOR),
                    min(value - unknown.lower, unknown.upper - value) < near,
                    tuple(names[i] for i in np.flatnonzero(correlation[place] > TOGETHER)),
                )
            )
        return tuple(out)

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
        rows = self.columns[self.used]
        variance = np.einsum("uij,jk,uik->ui", rows, self.covariance, rows)
        measured = self.problem.table.measured[self.used]
        mean = (variance * measured).sum(axis=0) / np.maximum(measured.sum(axis=0), 1)
        names = tuple(free.effect.name for free in self.problem.free)
        return JointUncertainty(names, np.sqrt(mean))

    def model(self, session: int = -1) -> ErrorModel:
        """Return the model with the fitted effects, as a session has them."""
        model = self.problem.model
        return model.with_effects(*model.effects, *self.effects(session))
