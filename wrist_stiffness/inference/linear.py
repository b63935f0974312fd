"""What the search asks of a plain table: fits of sets, linear but for the shapes of effects."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq
from scipy.optimize import minimize

from wrist_stiffness.inference.candidates import (
    Candidate,
    Nuisance,
    nuisance_columns,
)
from wrist_stiffness.inference.evidence import LEAST_PRIOR, Evidence, log_size_prior, size_weight
from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.plain_table import Table
from wrist_stiffness.inference.point import Background, Point
from wrist_stiffness.inference.possible import Possible, within_bounds
from wrist_stiffness.inference.projection import SQUARED_ROUNDING
from wrist_stiffness.inference.search import Ranked, Trial

FREE = 30.0
"""Standard deviation of a parameter that has no prior, in the size at which it alone would do as
much as was measured."""

ROUNDS = 10
"""Of the fit with the heavy tails of the priors."""

Shape = tuple[float, ...]


@dataclass(frozen=True)
class Term:
    """A candidate in a set."""

    candidate: Candidate  # which
    shape: Shape  # where it is not linear


@dataclass(frozen=True, eq=False)
class LinearFit:
    """A set of candidates fitted whole to a table."""

    problem: LinearProblem  # what was fitted to
    terms: Mapping[str, Term]  # the set
    z: Array  # (p,), nuisances and parameters, in the standard deviations of their priors

    @property
    def names(self) -> Collection[str]:
        """Effects of the set."""
        return self.terms

    @cached_property
    def places(self) -> dict[str, NDArray[np.intp]]:
        """Places of the parameters of each effect."""
        found, first = {}, self.problem.n_nuisances
        for name, term in self.terms.items():
            found[name] = np.arange(first, first + len(term.candidate.parameters))
            first += len(term.candidate.parameters)
        return found

    @property
    def cost(self) -> float:
        """Minus twice the log posterior, up to what all fits to the table share."""
        columns = self.problem.columns(tuple(self.terms.values()))
        left, base = self.problem.white - columns @ self.z, self.z[: self.problem.n_nuisances]
        found = float(left @ left + base @ base)
        for places in self.places.values():
            found -= 2.0 * float(log_size_prior(np.sum(self.z[places] ** 2), len(places)))
        return found

    def change(self, name: str) -> Array:
        """Return what an effect of the set does to the observations, (n, m)."""
        term = self.terms[name]
        sizes = self.problem.sizes[name] * self.z[self.places[name]]
        return np.asarray(self.problem.evaluate(term.candidate, term.shape) @ sizes)

    @cached_property
    def point(self) -> Point:
        """Where the fit ended, as the evidence takes it: what stands at a bound stays there."""
        held, whole = self.problem.held(self), self.whole
        if not held.any():
            return whole
        moves = np.concatenate([~held, np.ones(len(whole.z) - len(held), dtype=bool)])
        return replace(whole, columns=whole.columns * moves, linear=False)

    @cached_property
    def whole(self) -> Point:
        """Where the fit ended, whitened."""
        problem, table = self.problem, self.problem.table
        columns = problem.columns(tuple(self.terms.values()))
        varied = {name: table.varied(self.change(name)) for name in self.terms}
        shares = {name: term.candidate.inexactness for name, term in self.terms.items()}
        inexact = [share * varied[name] for name, share in shares.items() if share]
        bent = [problem.tangents(self, name) for name in self.terms]
        free = np.concatenate([np.zeros((len(columns), 0)), *bent], axis=1)
        p = columns.shape[1]
        return Point(
            problem.white - columns @ self.z,
            np.concatenate([-columns, -free], axis=1),
            np.concatenate([self.z, np.zeros(free.shape[1])]),
            np.ones(p + free.shape[1]),
            self.places,
            np.concatenate([np.zeros((len(columns), 0)), *inexact], axis=1),
            varied,
            linear=not free.shape[1],
            possible={name: problem.possible(term.candidate) for name, term in self.terms.items()},
        )

    def covariance_by(self, found: Evidence) -> Array:
        """Covariance of all unknowns, by the evidence; what stands at a bound may move.

        `found`: of this fit.
        """
        if self.problem.held(self).any():
            found = replace(found, point=self.whole)
        return found.covariance


class LinearProblem:
    """A table, its candidates and its nuisances as the search asks them.

    `observations`: without lost units; `candidates`, `nuisances`: the catalogue, and what is
    refitted; `ordered`: whether the rows follow each other in time.
    """

    def __init__(
        self,
        observations: Observations,
        candidates: Sequence[Candidate],
        nuisances: Sequence[Nuisance],
        ordered: bool,
    ) -> None:
        self.observations = observations
        self.laws = {each.name: each for each in candidates}
        self.nuisances = nuisance_columns(observations, tuple(nuisances))
        self._evaluated: dict[tuple[str, Shape], Array] = {}
        blocks = [self.evaluate(each, shape) for each in candidates for shape in each.shapes]
        named = np.concatenate([np.zeros((*observations.values.shape, 0)), *blocks], axis=2)
        self.table = table = Table(observations, self.nuisances.columns, named, ordered)
        self.white: Array = table.whiten(observations.values)
        bare = table.whiten(self.nuisances.columns)
        norm = np.linalg.norm(bare, axis=0)
        much = FREE * max(float(np.linalg.norm(self.white)), 1.0)
        free = much / np.where(norm > 0.0, norm, 1.0)
        prior = self.nuisances.prior_std
        self.base_sizes: Array = np.where(np.isfinite(prior), prior, free)
        self._base = bare * self.base_sizes
        beside = float(np.linalg.norm(self.white - self._base @ self.begin().z))
        self.sizes = {each.name: self._sizes(each, beside) for each in candidates}
        self._trials = [self._trial(each) for each in candidates]

    @property
    def n_nuisances(self) -> int:
        """Parameters of the base."""
        return self._base.shape[1]

    @cached_property
    def _named(self) -> tuple[list[Term], Array]:
        """Candidates at the points of their grids, and the columns of base and these, whitened."""
        terms = []
        for each in self._trials:
            for shape, _ in each.blocks:
                term = Term(self.laws[each.name], shape)
                alone = self.fitted({each.name: term})
                # What its bounds forbid explains nothing, and leaves that to the discrepancy.
                if not self.held(alone)[alone.places[each.name]].all():
                    terms.append(term)
        return terms, self.columns(terms)

    @cached_property
    def background(self) -> Background:
        """What has no name."""
        return self.table.background(self._named[1])

    def named_share(self, change: Array) -> tuple[Array, list[tuple[Term, Array]]]:
        """Return what base (b,) and candidates (k,) can do of a change of the observations (n, m).

        No discrepancy is what they can do, so a discrepancy that is told for other units lacks it.
        """
        terms, columns = self._named
        norm = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
        target = self.table.whiten(change)
        found = lstsq(columns / norm, target, cond=SQUARED_ROUNDING)[0] / norm
        sizes = [self.sizes[each.candidate.name] for each in terms]
        ends = np.cumsum([self.n_nuisances, *map(len, sizes)])[:-1]
        base, *own = np.split(found, ends)
        return base * self.base_sizes, [
            (term, size * z) for term, size, z in zip(terms, sizes, own, strict=True)
        ]

    def begin(self) -> LinearFit:
        """Return the base alone."""
        return self.fitted({})

    def trials(self, fit: LinearFit) -> Sequence[Trial]:
        """Return the candidates that are not in a set."""
        return [each for each in self._trials if each.name not in fit.terms]

    def nearly(self, fit: LinearFit, ranked: Ranked) -> None:
        """Return nothing: a whole fit costs no more."""

    def giving(self, fit: LinearFit) -> tuple[()]:
        """Return nothing: the laws of a plain table are as they are stated."""
        return ()

    def added(self, fit: LinearFit, ranked: Ranked) -> LinearFit | None:
        """Return the best fit with one effect more; None where its bounds leave nothing of it."""
        name = ranked.trial.name
        candidate = self.laws[name]
        terms = {**fit.terms, name: Term(candidate, ranked.shape)}
        if candidate.shape:
            terms[name] = Term(candidate, self._best_shape(fit, terms, name))
        found = self.fitted(terms)
        return found if np.any(found.z[found.places[name]]) else None

    def strained(self, fit: LinearFit) -> bool:
        """Tell that nothing is: a plain table does not say what its nuisances may be at most."""
        return False

    def without(self, fit: LinearFit, name: str) -> LinearFit:
        """Return the fit with one effect less."""
        return self.fitted({own: term for own, term in fit.terms.items() if own != name})

    def evaluate(self, candidate: Candidate, shape: Shape) -> Array:
        """Return the columns of a candidate over the table, (n, m, k)."""
        key = (candidate.name, shape)
        if key not in self._evaluated:
            self._evaluated[key] = candidate.evaluate(self.observations, shape)
        return self._evaluated[key]

    def columns(self, terms: Sequence[Term]) -> Array:
        """Return what base and terms do, whitened, for standard deviations of their priors."""
        own = [self._whitened(each.candidate, each.shape) for each in terms]
        return np.concatenate([self._base, *own], axis=1)

    def fitted(self, terms: Mapping[str, Term]) -> LinearFit:
        """Fit a set of terms at their shapes, within the bounds of their parameters."""
        columns = self.columns(tuple(terms.values()))
        bare = LinearFit(self, terms, np.zeros(columns.shape[1]))
        gram, target = columns.T @ columns, columns.T @ self.white
        lower, upper = self._bounds(bare)

        def solve(free: NDArray[np.bool_], z: Array) -> Array:
            return _solved(gram, target, bare.places, free, z)

        def slope(z: Array) -> Array:
            return np.asarray(target - gram @ z - _weights(z, bare.places) * z)

        z = solve(np.ones(len(target), dtype=bool), bare.z)
        z, _ = within_bounds(z, lower, upper, solve, slope)
        return LinearFit(self, terms, z)

    def held(self, fit: LinearFit) -> NDArray[np.bool_]:
        """Return which parameters stand at a bound."""
        lower, upper = self._bounds(fit)
        return np.asarray((fit.z <= lower) | (fit.z >= upper))

    def tangents(self, fit: LinearFit, name: str) -> Array:
        """Return the change by the shape of an effect, in widths of its range, (N, s)."""
        term = fit.terms[name]
        found = []
        for place, parameter in enumerate(term.candidate.shape):
            low, high = parameter.grid[0], parameter.grid[-1]
            ends = []
            for step in (-1e-3, 1e-3):
                shape = list(term.shape)
                shape[place] = float(np.clip(shape[place] + step * (high - low), low, high))
                ends.append((shape[place], self._whitened(term.candidate, tuple(shape))))
            slope = (ends[1][1] - ends[0][1]) / (ends[1][0] - ends[0][0])
            # A Gaussian as dense as an even spread over the range.
            width = (high - low) / np.sqrt(2.0 * np.pi)
            found.append(slope @ fit.z[fit.places[name]] * width)
        return np.array(found).reshape(-1, len(self.white)).T

    def _bounds(self, fit: LinearFit) -> tuple[Array, Array]:
        lower, upper = np.full(len(fit.z), -np.inf), np.full(len(fit.z), np.inf)
        for name, places in fit.places.items():
            own = self.possible(fit.terms[name].candidate)
            lower[places], upper[places] = own.lower, own.upper
        return lower, upper

    def possible(self, candidate: Candidate) -> Possible:
        """Return what the parameters of a candidate can be."""
        size = self.sizes[candidate.name]
        lower = np.array([each.lower for each in candidate.parameters]) / size
        return Possible(lower, np.array([each.upper for each in candidate.parameters]) / size)

    def _best_shape(self, fit: LinearFit, terms: Mapping[str, Term], name: str) -> Shape:
        candidate, start = terms[name].candidate, terms[name].shape
        limits = [(each.grid[0], each.grid[-1]) for each in candidate.shape]
        width = np.array([high - low for low, high in limits])

        def cost(scaled: Array) -> float:
            shape = tuple((scaled * width).tolist())
            found = self.fitted({**terms, name: Term(candidate, shape)}).cost
            self._evaluated.pop((name, shape), None)
            return found

        bounds = [(low / w, high / w) for (low, high), w in zip(limits, width, strict=True)]
        begin = np.array(start) / width
        simplex = np.vstack([begin, *(begin + s for s in _simplex(begin, bounds))])
        found = minimize(
            cost,
            begin,
            method="Nelder-Mead",
            bounds=bounds,
            options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 0.05, "maxfev": 60},
        )
        best = found.x if found.fun < cost(begin) else begin
        return tuple((best * width).tolist())

    def _whitened(self, candidate: Candidate, shape: Shape) -> Array:
        return self.table.whiten(self.evaluate(candidate, shape) * self.sizes[candidate.name])

    def _trial(self, candidate: Candidate) -> Trial:
        blocks = [(shape, -self._whitened(candidate, shape)) for shape in candidate.shapes]
        return Trial(candidate.name, True, tuple(blocks), self.possible(candidate))

    def _sizes(self, candidate: Candidate, beside: float) -> Array:
        """Return the scales of the priors of the parameters, (k,); the base leaves `beside`."""
        stated = [each.scale or each.plausible for each in candidate.parameters]
        if all(stated):
            return np.array(stated, dtype=float)
        middle = candidate.shapes[len(candidate.shapes) // 2]
        norm = np.linalg.norm(self.table.whiten(self.evaluate(candidate, middle)), axis=0)
        much = beside / np.where(norm > 0.0, norm, 1.0)
        return np.array([own or size for own, size in zip(stated, much, strict=True)])


def _simplex(begin: Array, bounds: Sequence[tuple[float, float]]) -> Array:
    """Return steps along each axis that stay inside, a tenth of the range."""
    return np.diag(
        [0.1 if at + 0.1 <= high else -0.1 for at, (_, high) in zip(begin, bounds, strict=True)]
    )


def _solved(
    gram: Array,
    target: Array,
    effects: Mapping[str, NDArray[np.intp]],
    free: NDArray[np.bool_],
    z: Array,
) -> Array:
    """Return the most probable unknowns where those that are not free stay, (p,)."""
    z = np.where(free, 0.0, z)
    if not len(target):
        return z
    # The tails of the priors first: a large effect is found from their side.
    weight = np.ones(len(target))
    for places in effects.values():
        weight[places] = 1e-8
    rest = target - gram[:, ~free] @ z[~free]
    at = np.flatnonzero(free)
    for _ in range(ROUNDS if effects else 1):
        information = gram[np.ix_(at, at)] + np.diag(weight[at])
        scale = 1.0 / np.sqrt(np.diag(information))
        scaled = information * scale[:, None] * scale + LEAST_PRIOR * np.eye(len(at))
        z[at] = scale * np.linalg.solve(scaled, scale * rest[at])
        weight = _weights(z, effects)
    return z


def _weights(z: Array, effects: Mapping[str, NDArray[np.intp]]) -> Array:
    """Return the precisions of Gaussian priors with the slopes of those of the unknowns, (p,)."""
    weight = np.ones(len(z))
    for places in effects.values():
        weight[places] = size_weight(float(np.sum(z[places] ** 2)), len(places))
    return weight
