"""What the search asks of a wrist: fits of sets of effects, and every candidate about them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice, product

import numpy as np

from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.identification.base_fit import (
    Base,
    BaseFit,
    best_valley,
    fit_base,
    fit_cleaned,
    free_base,
)
from wrist_stiffness.identification.candidates import (
    Point as WristPoint,
)
from wrist_stiffness.identification.candidates import (
    WristCandidate,
    searched,
    wrist_candidates,
)
from wrist_stiffness.identification.likelihood import likelihood_of
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.identification.strained import strain
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.point import Background
from wrist_stiffness.inference.search import Ranked, Trial, ranked
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.sessions.unit_session import UnitSession

LEAVES_MUCH, HELPS = 1.5, 0.8
"""Variance of what an effect leaves, in units of the noise, and share of the cost without it, at
which a fit with walls is tried again little by little."""

FACTORS = (-10.0, -3.0, -1.0, -0.3, 0.3, 1.0, 3.0, 10.0)
"""Multiples of the typed values that are tried."""

PLAYS = np.geomspace(1e-3, 10.0, 9).tolist()
"""Multiples of the usual play that are tried: play is seen from far below a micrometre on, and a
fit that begins with too much of it does not find back."""

MOST_MULTIPLES = 512


class WristProblem:
    """A wrist and its sessions as the search asks them.

    `model`: what is known of the wrist; `sessions`: in the order of time; `base`: what of the model
    is free and what stays; by default as `free_base` says.
    """

    def __init__(
        self, model: ErrorModel, sessions: tuple[UnitSession, ...], base: Base | None = None
    ) -> None:
        self._model, self._base = model, base or free_base(model)
        free, held = self._base
        problem = FitProblem(model.with_effects(*held), sessions, free)
        first = _cleaned(problem)
        if first.rough:
            # Something is missing only if no valley leads to the noise.
            valley = best_valley(first.base.problem)
            if not _known(valley, 0).rough:
                again = _cleaned(problem, valley.z)
                first = first if again.rough else again
        self._first, self.table, self._sessions = first, first.table, first.problem.sessions
        self._extended: tuple[WristFit, Effect, WristFit] | None = None
        self._near: dict[WristCandidate, WristFit] = {}
        self._asked: tuple[BaseFit, dict[str, WristCandidate]] | None = None

    def asks(self, model: ErrorModel, base: Base) -> bool:
        """Tell whether it is of this model, with this free and that held."""
        one = self._model
        same = one.table is model.table and one.evaluation == model.evaluation
        return same and one.effects == model.effects and self._base == base

    @property
    def background(self) -> Background:
        """What has no name."""
        return self.table.background

    def begin(self) -> WristFit:
        """Return the nominal model with its tolerances."""
        return self._first

    def trials(self, fit: WristFit) -> Sequence[Trial]:
        """Return the catalogue about a fit."""
        return [self._trial(each) for each in self._catalogue(fit).values()]

    def _trial(self, candidate: WristCandidate) -> Trial:
        blocks = [
            (shape, self.table.whiten(-candidate.at(shape) * candidate.usual))
            for shape in candidate.shapes
        ]
        law = candidate.law
        return Trial(
            candidate.name,
            law.smooth,
            tuple(blocks),
            candidate.possible,
            walls=law.state_is_a_guess,
        )

    def giving(self, fit: WristFit) -> Sequence[tuple[Array, WristFit]]:
        """Return the fits in which one more law gives, with the column (N,) which that adds."""
        return [
            (column, replace(fit, gives=(*fit.gives, give)))
            for give, column in fit.ways.items()
            if give not in fit.gives
        ]

    def nearly(self, fit: WristFit, ranked: Ranked) -> WristFit | None:
        """Return nearly the best fit with one effect more, as `beside` does.

        None where its law finds no equilibrium.
        """
        candidate = self._catalogue(fit)[ranked.trial.name]
        try:
            return self._nearly(fit, candidate, ranked)
        except WristError:
            return None

    def _nearly(self, fit: WristFit, candidate: WristCandidate, ranked: Ranked) -> WristFit:
        if candidate not in self._near:
            begun = candidate.effect(ranked.z, ranked.shape)
            if begun.law.state_is_a_guess:
                begun = next(_from_best(fit.base, self.about(fit), begun, _plays(begun)))
            self._near[candidate] = self.beside(fit, begun)
        return self._near[candidate]

    def beside(self, fit: WristFit, effect: Effect) -> WristFit:
        """Return a fit with one effect more, from its values, with the base's columns without it.

        Set-up and tolerances follow it; nearly as far as a whole fit, and far quicker.

        Raises `WristError` if its law finds no equilibrium.
        """
        extras = [*fit.base.beyond().values(), effect]
        return self._fitted(extras, fit.base, quickly=True)

    def added(self, fit: WristFit, ranked: Ranked) -> WristFit | None:
        """Return the best fit with one effect more.

        None where its law finds no equilibrium, or its bounds leave nothing of it.
        """
        name = ranked.trial.name
        found = self._added(fit, ranked, self._catalogue(fit)[name])
        return found if found is not None and found.change(name).any() else None

    def extended(self, fit: WristFit, effect: Effect) -> WristFit:
        """Return the best fit with an effect that somebody named; the last one is kept.

        Raises `InputError` if its law finds no equilibrium anywhere near these data.
        """
        last = self._extended
        if last is None or last[0].base is not fit.base or last[1] != effect:
            last = fit, effect, self._extend(fit, effect)
        self._extended = last
        return last[2]

    def _extend(self, fit: WristFit, effect: Effect) -> WristFit:
        point = self.about(fit)
        if any(not np.isfinite(parameter.scale) for parameter in effect.parameters):
            others = list(fit.base.beyond().values())
            for start in _from_best(fit.base, point, effect, _multiples(effect)):
                with suppress(UndefinedFormulaError):
                    return self._fitted([*others, start], fit.base)
            return self._fitted([*others, effect], fit.base)
        (candidate,) = wrist_candidates(point, [(effect.law, effect.component)])
        (best,) = ranked(evidence(fit.point, self.background), [self._trial(candidate)])
        found = self._added(fit, best, candidate)
        if found is None:
            raise InputError(f"{effect.name}: its law finds no equilibrium in these recordings")
        return found

    def _added(self, fit: WristFit, ranked: Ranked, candidate: WristCandidate) -> WristFit | None:
        try:
            start = self._nearly(fit, candidate, ranked).base
            extras = list(start.beyond().values())
            found = self._fitted(extras, start)
            walls = any(each.law.state_is_a_guess for each in extras)
            if (
                walls
                and found.base.variance > LEAVES_MUCH
                and found.base.cost < HELPS * fit.base.cost
            ):
                again = self._fitted(extras, fit.base, gradually=True)
                found = min(found, again, key=lambda each: each.base.cost)
            return found
        except WristError:
            return None

    def without(self, fit: WristFit, name: str) -> WristFit:
        """Return the fit with one effect less, begun where this one ended."""
        others = [each for own, each in fit.base.beyond().items() if own != name]
        return self._fitted(others, fit.base)

    def strained(self, fit: WristFit) -> bool:
        """Tell whether the tolerances took up more than those of a sound wrist would."""
        tense = strain(fit)
        return tense is not None and tense.rare

    def _fitted(self, extras: Sequence[Effect], start: BaseFit | None, **how: bool) -> WristFit:
        own = fit_base(self._model, self._sessions, extras, start, base=self._base, **how)
        return WristFit(own, self.table)

    def _catalogue(self, fit: WristFit) -> dict[str, WristCandidate]:
        if self._asked is None or self._asked[0] is not fit.base:
            absent = {each.name for each in self._model.effects} | set(fit.names)
            found = wrist_candidates(self.about(fit), searched(absent))
            self._asked = fit.base, {each.name: each for each in found}
            self._near = {}
        return self._asked[1]

    def about(self, fit: WristFit) -> WristPoint:
        """Return where candidates are asked: beside all but play, of which the whole fit knows.

        Play would be solved again for each of them; what else has a past does what it did.
        """
        models = []
        for number in range(len(self._sessions)):
            own = fit.base.model(number)
            beside = tuple(
                e for e in own.effects if not (e.name in fit.names and e.law.state_is_a_guess)
            )
            held = own.held(beside)
            models.append(replace(own, effects=tuple(held.get(e.name, e) for e in beside)))
        return WristPoint(tuple(models))


def _cleaned(problem: FitProblem, start: Array | None = None) -> WristFit:
    return _known(*fit_cleaned(problem, start))


def _known(base: BaseFit, lost: int) -> WristFit:
    return WristFit(base, likelihood_of(base, lost))


def _plays(effect: Effect) -> list[dict[str, float]]:
    """Return values of a law with walls from next to no play to much."""
    return [{p.key: p.mean or factor * p.scale for p in effect.parameters} for factor in PLAYS]


def _multiples(effect: Effect) -> list[dict[str, float]]:
    """Return multiples of the values that somebody typed."""
    typed = {key: estimate.value or 1.0 for key, estimate in effect.estimates.items()}
    factors = FACTORS if len(FACTORS) ** len(typed) <= MOST_MULTIPLES else (-1.0, 1.0)
    return [
        {key: value * f for (key, value), f in zip(typed.items(), each, strict=True)}
        for each in islice(product(factors, repeat=len(typed)), MOST_MULTIPLES)
    ]


def _from_best(
    fitted: BaseFit, point: WristPoint, effect: Effect, tried: Sequence[dict[str, float]]
) -> Iterator[Effect]:
    """Give an effect at values from those on that explain most beside a base that follows.

    `fitted`: what everything else explains, which to first order follows; `point`: the same, for
    trials; `tried`: its values, each brought within its bounds; those for which a formula is
    undefined are left out.
    """
    # Weights where there is no prior are tiny: QR keeps them apart from rounding.
    root, weights = np.sqrt(max(1.0, fitted.variance)), fitted.problem.weights
    whiten = fitted.problem.whiten
    basis = np.linalg.qr(np.vstack([whiten(fitted.columns) / root, np.diag(weights)]))[0]

    def beyond(white: Array, offset: Array) -> Array:
        rows = np.concatenate([white / root, offset])
        return np.asarray(rows - basis @ (basis.T @ rows))

    found = _defined(point, effect, tried)
    if not found:
        return
    white = whiten(np.stack([change for _, change in found], axis=-1))
    explained = beyond(white, np.zeros((len(weights), len(found))))
    left = beyond(whiten(fitted.residual), weights * fitted.z)[:, None] - explained
    for place in np.argsort(np.sum(left**2, axis=0), kind="stable"):
        yield effect_at(effect.law, effect.component, found[place][0])


def _defined(
    point: WristPoint, effect: Effect, tried: Sequence[dict[str, float]]
) -> list[tuple[dict[str, float], Array]]:
    """Return those of the values for which an effect is defined, each with its change (u, m)."""
    try:
        changes = point.changes([(effect.law, effect.component, each) for each in tried])
    except UndefinedFormulaError:
        half = len(tried) // 2
        parts = [tried[:half], tried[half:]] if half else []
        return [each for part in parts for each in _defined(point, effect, part)]
    return list(zip(tried, changes, strict=True))
