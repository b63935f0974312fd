"""Who is asked: baselines that need no error model, and the ceiling that knows the laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from bench_wrist import Array, wrist
from dictionary import Word, nuisance_names
from observe import Riddle, Session, observe
from scipy.stats import chi2

ALPHA = 0.01
"""Chance of a false alarm that the ceiling allows itself over the whole catalogue."""

INDISTINGUISHABLE = 9.0
"""A rival whose chi-square lies this close to the best one is in its class."""

STRUCTURE = 0.10
"""`unknown` where this share of the excess over the noise is left."""

NUISANCE_SCALE = 300.0
"""Prior of a nuisance in units of its plausible size: practically free."""

GP_EVIDENCE = 10.0
"""Least gain of log evidence at which the Gaussian process compensates at all."""

TIME = 12
"""Column of the time among the conditions."""

GEOMETRY = ("axis_misalignment", "encoder_offset")
MOST_FINDINGS = 4


@dataclass(frozen=True)
class Answer:
    """What a solver says.

    Parameters
    ----------
    verdict : str
        `none`, `effect` or `unknown`.
    classes : tuple of tuple of str
        Findings in the order in which they entered, each a class of `effect@component`, best first.
    predicted : (u, 6) float
        Change of the second session's residual that is explained.
    """

    verdict: str
    classes: tuple[tuple[str, ...], ...]
    predicted: Array


Solver = Callable[[Riddle, Sequence[Word]], Answer]


def always_none(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Say that nothing is missing."""
    return Answer("none", (), np.zeros_like(riddle.test.residual))


def told_the_answer(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Know effect, place, form, shape and magnitude."""
    if not riddle.hidden:
        return always_none(riddle, words)
    bare = observe(wrist(), replace(riddle.case, effects=()), (), 1)
    names = tuple((f"{h.effect}@{h.component}",) for h in riddle.hidden)
    return Answer("effect", names, riddle.test.residual - bare.residual)


def geometry_only(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Calibrate joint axes and zeros, and believe that this is all."""
    chosen = [word for word in words if word.name.split("@")[0] in GEOMETRY]
    fit = Whitened(riddle.train, _nuisance(words))
    values, gain, free = fit.fit(chosen)
    predicted = predict(chosen, values)
    if chi2.sf(gain, free) > ALPHA:
        return Answer("none", (), np.zeros_like(predicted))
    return Answer("effect", (tuple(w.name for w in chosen if "axis" in w.name),), predicted)


def stepwise_bic(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Add words while BIC falls, every unit taken as white noise and independent."""
    white = np.einsum("uii->ui", riddle.train.covariance).min(axis=0)
    session = replace(
        riddle.train,
        covariance=np.broadcast_to(np.diag(white), riddle.train.covariance.shape),
        wander=np.zeros_like(riddle.train.wander),
    )
    fit = Whitened(session, _nuisance(words))
    return _forward(riddle, words, fit, lambda gain, free, n: gain - free * np.log(n), single=True)


def knows_the_laws(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Test spans of the simulation's own laws with the true covariance.

    A ceiling for whoever takes the laws as linear; strong play and friction are not.
    """
    fit = Whitened(riddle.train, _nuisance(words))
    allowed = ALPHA / max(len(words), 1)

    def evidence(gain: float, free: int, n: int) -> float:
        return float(np.log(allowed) - chi2.logsf(gain, free))

    return _forward(riddle, words, fit, evidence, single=False)


def gaussian_process(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Interpolate the residual over the conditions; it compensates and names nothing."""
    train, test = riddle.train, riddle.test
    factor, factor_test = (np.linalg.cholesky(each.covariance) for each in (train, test))
    centred = Whitened(train, _nuisance(words)).without_nuisance(train)
    values = np.linalg.solve(factor, centred[..., None])[..., 0]
    # What a sensor wandered with the time of one session says nothing about another.
    here, there = (np.delete(each.conditions, TIME, axis=1) for each in (train, test))
    trials = [
        (_gp_cost(here, values, length, height), length, height)
        for length in (0.5, 1.0, 2.0)
        for height in (0.3, 1.0, 3.0, 10.0, 30.0)
    ]
    best, length, height = min(trials)
    if _gp_cost(here, values, 1.0, 0.0) - best < GP_EVIDENCE:
        return always_none(riddle, words)
    kernel = height**2 * _kernel(here, here, length)
    weights = np.linalg.solve(kernel + np.eye(len(kernel)), values)
    across = height**2 * _kernel(there, here, length)
    return Answer("unknown", (), np.einsum("uij,uj->ui", factor_test, across @ weights))


BASELINES: dict[str, Solver] = {
    "always_none": always_none,
    "told_the_answer": told_the_answer,
    "geometry_only": geometry_only,
    "stepwise_bic": stepwise_bic,
    "gaussian_process": gaussian_process,
    "knows_the_laws": knows_the_laws,
}


class Whitened:
    """Least squares on one session with the nuisances marginalised by their wide priors."""

    def __init__(self, session: Session, nuisance: Sequence[Word]) -> None:
        units = len(session.residual)
        total = np.zeros((6 * units, 6 * units))
        for i, covariance in enumerate(session.covariance):
            total[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = covariance
        total += session.wander
        self._columns = np.concatenate(
            [word.train.reshape(6 * units, -1) for word in nuisance], axis=1
        )
        self._columns *= NUISANCE_SCALE / np.sqrt(np.mean(self._columns**2, axis=0))
        self._columns *= np.sqrt(np.trace(total) / len(total))
        total += self._columns @ self._columns.T
        self._factor = np.linalg.cholesky(total)
        self.rest = self.white(session.residual)

    def white(self, values: Array) -> Array:
        """Whiten (u, 6) or (u, 6, r) to (6u,) or (6u, r)."""
        flat = values.reshape(len(self._factor), *values.shape[2:])
        return np.linalg.solve(self._factor, flat)

    def fit(self, words: Sequence[Word]) -> tuple[Array, float, int]:
        """Return coefficients, fall of chi-square and number of coefficients."""
        design = np.concatenate([self.white(word.train) for word in words], axis=1)
        values, _, rank, _ = np.linalg.lstsq(design, self.rest, rcond=1e-6)
        left = self.rest - design @ values
        return values, float(self.rest @ self.rest - left @ left), int(rank)

    def without_nuisance(self, session: Session) -> Array:
        """Return the residual (u, 6) less its best explanation by nuisances."""
        flat = session.residual.reshape(-1)
        inner = np.linalg.solve(self._factor.T, self.rest)
        return (flat - self._columns @ (self._columns.T @ inner)).reshape(session.residual.shape)


def _nuisance(words: Sequence[Word]) -> list[Word]:
    return [word for word in words if word.name in nuisance_names()]


def predict(words: Sequence[Word], values: Array) -> Array:
    """Return the change of the second session's residual by words with coefficients, (u, 6)."""
    return np.concatenate([word.test for word in words], axis=2) @ values


def _forward(
    riddle: Riddle,
    words: Sequence[Word],
    fit: Whitened,
    evidence: Callable[[float, int, int], float],
    single: bool,
) -> Answer:
    """Enter words while the evidence for the best is positive; `single`: classes of one."""
    candidates = [word for word in words if word.name not in nuisance_names()]
    n = len(fit.rest)
    chosen: list[Word] = []
    classes: list[tuple[str, ...]] = []
    values, gained, used = np.zeros(0), 0.0, 0
    excess = float(fit.rest @ fit.rest) - n
    while len(chosen) < MOST_FINDINGS:
        trials = []
        for word in candidates:
            if word in chosen:
                continue
            found, gain, rank = fit.fit([*chosen, word])
            if rank > used:
                score = evidence(gain - gained, rank - used, n)
                trials.append((score, gain, rank, found, word))
        if not trials:
            break
        trials.sort(key=lambda trial: -trial[0])
        score, gain, rank, found, word = trials[0]
        if score <= 0.0:
            break
        rivals = [
            other[4].name
            for other in trials[1:]
            if not single and (gain - other[1]) - (rank - other[2]) < INDISTINGUISHABLE
        ]
        classes.append((word.name, *rivals))
        chosen.append(word)
        values, gained, used = found, gain, rank
    if not chosen:
        verdict = "unknown" if not single and chi2.sf(excess + n, n) < ALPHA else "none"
        return Answer(verdict, (), np.zeros_like(riddle.test.residual))
    left = excess - gained + used
    unknown = not single and left > STRUCTURE * excess and chi2.sf(left + n, n) < ALPHA
    return Answer("unknown" if unknown else "effect", tuple(classes), predict(chosen, values))


def _kernel(x: Array, y: Array, length: float) -> Array:
    distance = np.sum((x[:, None] - y[None]) ** 2, axis=-1)
    return np.exp(-0.5 * distance / length**2)


def _gp_cost(conditions: Array, values: Array, length: float, height: float) -> float:
    """Return the negative log evidence of all six components with unit noise."""
    covariance = height**2 * _kernel(conditions, conditions, length) + np.eye(len(conditions))
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, values)
    return float(0.5 * np.sum(white**2) + 6.0 * np.sum(np.log(np.diag(factor))))
