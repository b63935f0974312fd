"""One effect of a model: a law at a component with values for its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.law import Law, Stage
from wrist_stiffness.model.parameters import Estimate, Parameter, si_factor

SIDES, SHARE = 3.0**0.5, 1.0 / 6.0
"""How far a parameter is moved to both sides [standard uncertainties], and what each side counts:
three-point Gauss-Hermite rule of the unscented transform (Julier and Uhlmann 1997), exact for what
is linear in it."""


@dataclass(frozen=True)
class Effect:
    """A law at a place with its parameters.

    Parameters
    ----------
    law : Law
        The physics.
    component : str
        Where it sits.
    estimates : dict of str to Estimate
        By the parameters' names, in the units of the names; parameters left out have their prior
        mean.

    Raises
    ------
    InputError
        If the law cannot be at the component, or a parameter is unknown, not finite or out of
        bounds.
    """

    law: Law
    component: str
    estimates: Mapping[str, Estimate] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check place and parameters, and fill in those left out."""
        if self.component not in self.law.places:
            raise InputError(
                f"{self.law.id}: component {self.component!r} is not one of "
                f"{', '.join(self.law.places)}"
            )
        known = {parameter.key: parameter for parameter in self.parameters}
        if unknown := [key for key in self.estimates if key not in known]:
            raise InputError(
                f"{self.name}: unknown parameter {unknown[0]}; it has {', '.join(known) or 'none'}"
            )
        filled = {
            key: self.estimates.get(key, Estimate(parameter.mean))
            for key, parameter in known.items()
        }
        for key, estimate in filled.items():
            lower, upper = known[key].lower, known[key].upper
            if not lower <= estimate.value <= upper:
                raise InputError(
                    f"{self.name}: {key} = {estimate.value:g} is outside {lower:g} to {upper:g}"
                )
            if not (np.isfinite(estimate.sigma) and estimate.sigma >= 0.0):
                raise InputError(
                    f"{self.name}: uncertainty {estimate.sigma:g} of {key} is not a number >= 0"
                )
        object.__setattr__(self, "estimates", filled)

    @property
    def name(self) -> str:
        """`law@component`."""
        return f"{self.law.id}@{self.component}"

    @property
    def stage(self) -> Stage:
        """What the law changes at this place."""
        return self.law.stage_at(self.component)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the law at this place."""
        return self.law.parameters(self.component)

    @cached_property
    def si(self) -> dict[str, float]:
        """Values in SI units by the parameters' full names."""
        return {key: e.value * si_factor(key) for key, e in self.estimates.items()}

    @cached_property
    def varied(self) -> tuple[Effect, ...]:
        """The effect with each uncertain parameter moved up and down by `SIDES`, within the bounds.

        What is past a bound is mirrored at it: a clearance of 0 +- 2 um is as large as 2 um.
        """
        moved = []
        for parameter in self.parameters:
            key, estimate = parameter.key, self.estimates[parameter.key]
            if estimate.sigma > 0.0:
                for side in (SIDES, -SIDES):
                    value = estimate.value + side * estimate.sigma
                    mirrored = 2.0 * parameter.within(value) - value
                    moved.append(self.with_values({key: parameter.within(mirrored)}))
        return tuple(moved)

    def with_values(self, values: Mapping[str, float]) -> Effect:
        """Return the same effect with other values of some parameters, in the units of the names.

        Raises
        ------
        InputError
            If a parameter is unknown or out of bounds.
        """
        changed = dict(self.estimates)
        for key, value in values.items():
            changed[key] = Estimate(value, changed[key].sigma if key in changed else 0.0)
        return replace(self, estimates=changed)


def spread_of(value: Array, varied: Sequence[Array]) -> Array:
    """Return how far a value is uncertain, (v, k): s with the covariance s' s.

    `value` (k,): as the effects have it; `varied`, (k,) each: the same with each of the v effects
    of `Effect.varied`.
    """
    return SHARE**0.5 * (np.reshape(varied, (-1, len(value))) - value)


def effect_at(law: Law, place: str, values: Mapping[str, float]) -> Effect:
    """Return a law with these values, each brought within its bounds."""
    known = {parameter.key: parameter for parameter in law.parameters(place)}
    found = {key: Estimate(known[key].within(value)) for key, value in values.items()}
    return Effect(law, place, found)
