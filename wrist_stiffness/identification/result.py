"""Where a fit arrived: estimates with uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.identification.problem import NO_PRIOR, FitProblem
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.parameters import Parameter

EXCITED = 0.7
"""A parameter is excited if its uncertainty falls below this share of its prior's."""

FAR = 3.0
"""Standard deviations of its prior beyond which a parameter is farther off than usual."""

TOGETHER = 0.7
"""Correlation from which two parameters are said to be told together only."""


@dataclass(frozen=True)
class FittedParameter:
    """One parameter after the fit."""

    # `law@component`; name with its unit
    effect: str
    key: str
    session: str | None  # session whose own it is, None for the wrist's
    # estimate and one standard uncertainty, in the unit of the name
    value: float
    sigma: float
    # mean and standard deviation of the prior
    prior: float
    prior_sigma: float
    usual: float  # standard deviation of the law's own prior; that of the fit may be wider
    at_bound: bool  # whether the estimate lies on a bound of what is possible
    together: tuple[str, ...]  # parameters with which it is told together only

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
    problem: FitProblem,
    z: Array,
    covariance: Array,
    prior: Array,
    sized: Mapping[int, Parameter],
) -> tuple[FittedParameter, ...]:
    """Return all that was fitted, with uncertainties.

    `problem`: what was free; `z` (p,), `covariance` (p, p): steps from the means of the priors;
    `prior` (p,): widths of the priors, in steps; `sized`: parameters with the prior of their law,
    by the place of their unknown, whose mean and step only say where a fit began.
    """
    sigma = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance / np.outer(sigma, sigma)) - np.eye(len(sigma))
    names = [f"{u.effect.name} {u.key}" for u in problem.unknowns]
    fitted = [problem.effects(z, number) for number in range(len(problem.sessions))]
    out = []
    for place, (unknown, steps) in enumerate(zip(problem.unknowns, z.tolist(), strict=True)):
        parameter = unknown.parameter
        value = fitted[unknown.session or 0][unknown.free].estimates[parameter.key].value
        moved = steps * unknown.step
        usual = min(unknown.step, parameter.scale)
        usual /= 1.0 if unknown.weight > NO_PRIOR else NO_PRIOR
        if place in sized:
            moved += unknown.mean - sized[place].mean
            usual = sized[place].scale
        near = 1e-6 * unknown.step
        out.append(
            FittedParameter(
                unknown.effect.name,
                parameter.key,
                None if unknown.session is None else problem.sessions[unknown.session].name,
                value,
                float(sigma[place]) * unknown.step,
                value - moved,
                float(prior[place]) * unknown.step,
                usual,
                min(value - parameter.lower, parameter.upper - value) < near,
                tuple(names[i] for i in np.flatnonzero(correlation[place] > TOGETHER)),
            )
        )
    return tuple(out)
