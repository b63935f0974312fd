"""Where the fit of a new effect begins: the best point of its grid beside a fitted base."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear

from wrist_stiffness.campaign.columns import SessionModel
from wrist_stiffness.campaign.fitting.result import Fit
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.columns import Column
from wrist_stiffness.model.effect import Effect, effect_at

FACTORS = (-10.0, -3.0, -1.0, -0.3, 0.3, 1.0, 3.0, 10.0)
"""Multiples of the typed values that are tried where a law knows no prior."""

MOST_TRIALS = 512


def start_values(found: Fit, effect: Effect) -> dict[str, float]:
    """Return values of an effect's parameters with which a fit may begin.

    Parameters
    ----------
    found : Fit
        Of the base alone.
    effect : Effect
        Not in the base; its values count where its law knows no prior.

    Returns
    -------
    dict of str to float
        In the units of the names.
    """
    judge = _Judge(found)
    if any(not np.isfinite(parameter.scale) for parameter in effect.parameters):
        return _best_multiple(judge, effect)
    signals = frozenset.intersection(
        *(frozenset(each.block.temperatures) for each in found.problem.sessions)
    )
    how = effect.law.linearised(effect.component, signals)
    best: tuple[float, dict[str, float]] = (np.inf, {})
    for shape in how.shapes:
        found_at = _factors(judge, effect, how.columns(shape))
        if found_at[0] < best[0]:
            best = found_at[0], how.start(found_at[1], shape)
    begun = effect_at(effect.law, effect.component, best[1])
    return {key: estimate.value for key, estimate in begun.estimates.items()}


def _factors(
    judge: _Judge, effect: Effect, columns: Sequence[Column]
) -> tuple[float, dict[str, float]]:
    """Return half the sum of squares that is left, priors included, and the factors by name."""
    law, place = effect.law, effect.component
    trials = [effect_at(law, place, column.trial) for column in columns]
    origins = [effect_at(law, place, c.origin) if c.origin else None for c in columns]
    changes = judge.changes([*trials, *(origin for origin in origins if origin)])
    moved, rest = changes[: len(trials)], iter(changes[len(trials) :])
    design = np.stack(
        [
            (change - (next(rest) if origin else 0.0)) / column.size
            for change, origin, column in zip(moved, origins, columns, strict=True)
        ],
        axis=1,
    )
    size = np.array([column.factor.plausible for column in columns])
    lower = np.array([column.factor.lower for column in columns]) / size
    upper = np.array([column.factor.upper for column in columns]) / size
    rows = np.vstack([design * size, np.eye(len(size))])
    target = np.concatenate([-judge.residual, np.zeros(len(size))])
    best = lsq_linear(rows, target, (lower, upper))
    names = [column.factor.name for column in columns]
    return float(best.cost), dict(zip(names, (best.x * size).tolist(), strict=True))


def _best_multiple(judge: _Judge, effect: Effect) -> dict[str, float]:
    typed = {key: estimate.value or 1.0 for key, estimate in effect.estimates.items()}
    factors = FACTORS if len(FACTORS) ** len(typed) <= MOST_TRIALS else (-1.0, 1.0)
    tried = [
        {key: value * f for (key, value), f in zip(typed.items(), each, strict=True)}
        for each in product(factors, repeat=len(typed))
    ][:MOST_TRIALS]
    changes = judge.changes([effect.with_values(values) for values in tried])
    left = [float(((judge.residual + change) ** 2).sum()) for change in changes]
    return tried[int(np.nanargmin(left))]


class _Judge:
    """What a further effect changes of the white residual, beyond what the base can take up.

    Parameters
    ----------
    found : Fit
        Of the base.
    """

    def __init__(self, found: Fit) -> None:
        problem = found.problem
        self._fit, self._problem = found, problem
        columns = self._white(problem.columns(found.z))
        rows = np.vstack([columns, np.diag(problem.weights)])
        self._base = np.linalg.qr(rows)[0]
        self._priors = len(problem.unknowns)
        self._models = [
            SessionModel(
                problem.model, session, (*problem.model.effects, *problem.effects(found.z, n))
            )
            for n, session in enumerate(problem.sessions)
        ]
        self.residual = self._beyond(self._white(problem.residual(found.z)[:, :, None]))[:, 0]

    def changes(self, trials: list[Effect]) -> list[Array]:
        """Return the change of the white residual by each trial, (6u + p,) each."""
        blocks: list[list[Array]] = [[] for _ in trials]
        for model, session in zip(self._models, self._problem.sessions, strict=True):
            first = model.predicted([model.effects])[0]
            changes = model.changes([(*model.effects, trial) for trial in trials])
            here = session.residual(first)
            for block, change in zip(blocks, changes, strict=True):
                block.append(np.nan_to_num(session.residual(first + change) - here))
        rows = np.stack([self._problem.rows(block) for block in blocks], axis=2)
        return list(self._beyond(self._white(rows)).T)

    def _white(self, columns: Array) -> Array:
        return self._fit.noise.whiten(self._fit.seen, columns)

    def _beyond(self, white: Array) -> Array:
        rows = np.vstack([white, np.zeros((self._priors, white.shape[1]))])
        return rows - self._base @ (self._base.T @ rows)
