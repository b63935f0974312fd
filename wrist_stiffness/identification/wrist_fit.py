"""A fitted set of effects as the evidence takes it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.identification.candidates import possible
from wrist_stiffness.identification.likelihood import WristTable
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.identification.result import FittedParameter, told_parameters
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.evidence import Evidence, known_noise
from wrist_stiffness.inference.giving import WAYS, Give, given
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.point import Point
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.parameters import Estimate, Parameter
from wrist_stiffness.sessions.observing import without_mounting

MOST_ROUNDS = 10
"""Steps from where a fit ended to the maximum of the posterior."""

SMALL_GAIN = 1e-2
"""A fit has settled where twice the log posterior gains no more: a tenth of an uncertainty."""

FAR = 1.0
"""Standard uncertainties: where a fit ends further from the maximum, at a kink, that is said."""

MOST_HALVINGS = 8

LEAST = 1e-12
"""Share of the largest eigenvalue of a correlation below which one is rounding."""


@dataclass(frozen=True, eq=False)
class WristFit:
    """A set of effects fitted whole to the wrist."""

    base: BaseFit  # set-up, tolerances and effects
    table: WristTable  # of the same units
    gives: tuple[Give, ...] = ()  # in which ways laws of the set give
    off: float = 0.0  # from the maximum of the posterior, in standard uncertainties of all unknowns

    @property
    def names(self) -> Collection[str]:
        """Effects of the set."""
        return self.base.extras

    def change(self, name: str) -> Array:
        """Return what an effect of the set does to the predictions, (u, 6) to first order."""
        at = self.places[name]
        return np.asarray(-self.base.columns[:, :, at] @ self.base.z[at])

    @property
    def problem(self) -> FitProblem:
        """What was fitted, without the lost units."""
        return self.base.problem

    @property
    def z(self) -> Array:
        """Steps of the unknowns from the means of their priors, (p,)."""
        return self.base.z

    @property
    def observations(self) -> Observations:
        """The units with what is left of them [m, rad]."""
        table = self.problem.table
        return table.with_values(without_mounting(table, self.base.residual))

    @property
    def arrived(self) -> bool:
        """Whether it ended within its uncertainty."""
        return self.off < FAR

    @property
    def lost(self) -> int:
        """How many units were left out as lost beams."""
        return self.table.lost

    @cached_property
    def ways(self) -> dict[Give, Array]:
        """What is left less, (N,), for each way in which a law may give that is not exact."""
        scale = np.sqrt(np.median(self.table.variance, axis=0))
        found = {}
        for name in (n for n, effect in self.base.beyond().items() if effect.law.inexactness):
            columns = -self.table.whiten(given(self.change(name), scale))
            found.update({Give(name, way): columns[:, n] for n, way in enumerate(WAYS)})
        return found

    def twist(self, name: str) -> Array:
        """Return the twists (u, 6) at O by which an effect of the set changes the predictions."""
        base, found = self.base, []
        for number, session in enumerate(base.problem.sessions):
            own = base.model(number)
            others = tuple(each for each in own.effects if each.name != name)
            here, without = own.along([own.effects, others])
            found.append((here - without)[session.measured])
        return np.concatenate(found)

    @cached_property
    def places(self) -> dict[str, NDArray[np.intp]]:
        """Places of the unknowns of each effect."""
        names = [each.effect.name for each in self.problem.unknowns]
        of_base = self.base.of_base
        return {
            own: np.flatnonzero([n == own and not b for n, b in zip(names, of_base, strict=True)])
            for own in self.names
        }

    @cached_property
    def sized(self) -> dict[int, Parameter]:
        """Parameters by the place of their unknown, where they have a typical magnitude."""
        every = [place for places in self.places.values() for place in places.tolist()]
        found = {place: self.problem.unknowns[place].parameter for place in every}
        return {place: own for place, own in found.items() if np.isfinite(own.scale)}

    @cached_property
    def ratio(self) -> Array:
        """Steps of the fit in one standard deviation of each unknown of `point`, (p,)."""
        found = np.ones(len(self.base.z))
        for place, own in self.sized.items():
            found[place] = own.scale / self.base.problem.unknowns[place].step
        return found

    @cached_property
    def point(self) -> Point:
        """Where the fit ended, as the evidence takes it: effects that stand at a bound stay there.

        A clearance below nothing would explain a lot.
        """
        lower, upper = self.base.problem.bounds
        held = np.isclose(self.base.z, lower) | np.isclose(self.base.z, upper)
        held &= ~self.base.of_base
        if not held.any():
            return self.whole
        return replace(self.whole, columns=self.whole.columns * ~held)

    @cached_property
    def whole(self) -> Point:
        """Where the fit ended, whitened; effects in typical magnitudes from their law's mean."""
        base, table, unknowns = self.base, self.table, self.problem.unknowns
        z = base.z.copy()
        inexact = [np.zeros((len(table.whiten(base.residual)), 0))]
        inexact += [self.ways[each][:, None] for each in self.gives]
        varied = {}
        for name, places in self.places.items():
            varied[name] = table.varied(self.change(name))
            inexact.append(unknowns[places[0]].effect.law.inexactness * varied[name])
        for place, own in self.sized.items():
            unknown = unknowns[place]
            z[place] = (unknown.mean + base.z[place] * unknown.step - own.mean) / own.scale
        weight = base.problem.weights.copy()
        effects, sizing, can = {}, {}, {}
        for name, places in self.places.items():
            known = [place for place in places.tolist() if place in self.sized]
            if not known:
                continue
            weight[known] = 1.0
            effect = unknowns[known[0]].effect
            keys = effect.law.sized_by(effect.component)
            effects[name] = np.array(known, dtype=np.intp)
            can[name] = possible(effect.law, tuple(self.sized[n] for n in known))
            sizing[name] = np.array([n for n in known if self.sized[n].key in keys], dtype=np.intp)
        return Point(
            table.whiten(base.residual),
            table.whiten(base.columns * self.ratio),
            z,
            weight,
            effects,
            np.concatenate(inexact, axis=1),
            varied,
            self.gives,
            sizing=sizing,
            possible=can,
        )

    def without_numbers(self, name: str) -> Point:
        """Return the point without the unknowns of an effect of no typical magnitude.

        What it does stays in what is left.
        """
        point, kept = self.point, np.delete(np.arange(len(self.base.z)), self.places[name])
        before = list(point.varied)[: list(point.varied).index(name)]
        first = len(self.gives) + sum(point.varied[each].shape[1] for each in before)
        wrong = np.arange(first, first + point.varied[name].shape[1])
        return replace(
            point,
            columns=point.columns[:, kept],
            z=point.z[kept],
            weight=point.weight[kept],
            effects={n: np.searchsorted(kept, own) for n, own in point.effects.items()},
            inexact=np.delete(point.inexact, wrong, axis=1),
            varied={n: own for n, own in point.varied.items() if n != name},
            sizing={n: np.searchsorted(kept, own) for n, own in point.sizing.items()},
        )

    @cached_property
    def evidence(self) -> Evidence:
        """At the amplitudes of the largest evidence."""
        return evidence(self.point, self.table.background)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the steps of all unknowns where a fit has settled, (p, p)."""
        return self.covariance_by(self.evidence) * np.outer(self.ratio, self.ratio)

    @property
    def rough(self) -> bool:
        """Whether more than noise is left."""
        return self.evidence.unexplained > 0.0

    @cached_property
    def noise(self) -> dict[str, float]:
        """Root mean square of the noise and the instrument's drift, by the key of the quantity."""
        return self.table.noise_and_drift(self.evidence)

    @cached_property
    def discrepancy(self) -> dict[str, float]:
        """Root mean square that the model leaves above that, likewise."""
        return self.table.above(self.evidence)

    @cached_property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted, with uncertainties, where a fit has settled."""
        prior = self.ratio / np.sqrt(self.evidence.precision[: len(self.z)])
        return told_parameters(self.problem, self.z, self.covariance, prior, self.sized)

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
        rows, measured = self.base.columns, self.problem.table.measured
        if any(each.gauges is not None for each in self.problem.sessions):
            rows = self.problem.twists(self.z)
            measured = np.ones(rows.shape[:2], dtype=bool)
        # What is wrong with a measurement alone moves no platform.
        moves = [not u.effect.law.of_measurement(u.effect.component) for u in self.problem.unknowns]
        sigmas = []
        for columns in (rows, rows * moves):
            variance = np.einsum("uij,jk,uik->ui", columns, self.covariance, columns)
            mean = (variance * measured).sum(axis=0) / np.maximum(measured.sum(axis=0), 1)
            sigmas.append(np.sqrt(mean))
        return JointUncertainty(tuple(free.effect.name for free in self.problem.free), *sigmas)

    def model(self, session: int = -1) -> ErrorModel:
        """Return the model with the fitted effects, as a session has them."""
        model = self.problem.model
        return model.with_effects(*model.effects, *self.effects(session))

    def covariance_by(self, found: Evidence) -> Array:
        """Covariance of all unknowns of `point`, by its evidence; what stands at a bound may move.

        `found`: of this fit.
        """
        return replace(found, point=self.whole).covariance_of_fit

    def settled(self) -> WristFit:
        """Return the most probable values beside noise and drift as they are known.

        A discrepancy takes nothing over from them: they are there to predict, and nobody would
        predict by a discrepancy.
        """
        fit, gain, here = self, np.inf, False
        for _ in range(MOST_ROUNDS):
            noise = known_noise(fit.whole, self.table.background)
            step, gain = fit._step(noise)
            moved = fit._moved(noise, step) if gain >= SMALL_GAIN else None
            if moved is not None:
                fit, here = moved, False
            elif here:
                break
            else:
                fit, here = replace(fit, base=fit.base.with_columns_here()), True
        return replace(fit, off=float(np.sqrt(gain)))

    def _step(self, found: Evidence) -> tuple[Array, float]:
        """Return the step to the maximum within the bounds (p,), and its gain to second order."""
        z, whole = self.base.z, self.ratio * found.step
        if not len(z):
            return z, 0.0
        lower, upper = self.base.problem.bounds
        low, high = np.minimum(lower - z, 0.0), np.maximum(upper - z, 0.0)
        covariance = found.covariance[: len(z), : len(z)] * np.outer(self.ratio, self.ratio)
        sigma = np.sqrt(np.diag(covariance))
        sizes, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
        root = (vectors / np.sqrt(np.maximum(sizes, LEAST * sizes[-1]))).T
        step = whole
        if ((step < low) | (step > high)).any():
            bounds = low / sigma - LEAST, high / sigma + LEAST
            step = sigma * lsq_linear(root, root @ (whole / sigma), bounds, method="bvls").x
        step = np.clip(step, low, high)
        left = root @ ((whole - step) / sigma)
        return step, float(np.sum((root @ (whole / sigma)) ** 2) - left @ left)

    def _moved(self, found: Evidence, step: Array) -> WristFit | None:
        """Return the fit a step further on, or less far; None where none is better."""
        before = found.cost(self.point)
        for halvings in range(MOST_HALVINGS):
            z = self.base.z + 0.5**halvings * step
            try:
                base = replace(self.base, z=z, residual=self.base.problem.residual(z))
            except UndefinedFormulaError:
                continue
            tried = replace(self, base=base)
            if found.cost(tried.point) < before:
                return tried
        return None
