"""Who is asked: baselines that need no error model, and solvers that know the laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from bench_wrist import Array
from dictionary import Dictionary, Word
from observe import Riddle
from scipy.stats import chi2
from whitened import Whitened, whitened

ALPHA = 0.01
"""Chance of a false alarm that the tests allow themselves over the whole catalogue."""

INDISTINGUISHABLE = 9.0
"""A rival whose chi-square lies this close to the best one is in its class."""

STRUCTURE = 0.10
"""`unknown` where this share of the excess over the noise is left."""

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
    explained : ((u, 6), (u, 6)) float
        Change of the residuals of both days that the findings explain; the base is calibrated
        afterwards, for all solvers alike.
    not_excited : tuple of str
        What the solver says that this experiment cannot show.
    suspects : dict of str to float
        How much each name may add to the error, in any unit; where empty the classes' order counts.
    explained_with_suspects : ((u, 6), (u, 6)) float, optional
        The same as `explained` with all suspects in the model.
    details : dict
        Further figures for the results file.
    """

    verdict: str
    classes: tuple[tuple[str, ...], ...]
    explained: tuple[Array, Array]
    not_excited: tuple[str, ...] = ()
    suspects: dict[str, float] = field(default_factory=dict)
    explained_with_suspects: tuple[Array, ...] = ()
    details: dict[str, Any] = field(default_factory=dict)


Solver = Callable[[Riddle, Dictionary], Answer]


def nothing(riddle: Riddle, verdict: str = "none") -> Answer:
    """Return an answer that explains nothing."""
    zero = np.zeros_like(riddle.train.residual), np.zeros_like(riddle.test.residual)
    return Answer(verdict, (), zero)


def explained(words: Sequence[Word], values: Array) -> tuple[Array, Array]:
    """Return what words with coefficients do on both days, two (u, 6)."""
    train, test = (
        np.concatenate([getattr(word, day) for word in words], axis=2) @ values
        for day in ("train", "test")
    )
    return train, test


def always_none(riddle: Riddle, words: Dictionary) -> Answer:
    """Say that nothing is missing: the base is calibrated, that is all."""
    return nothing(riddle)


def told_the_answer(riddle: Riddle, words: Dictionary) -> Answer:
    """Know effect, place, form, shape and magnitude."""
    if not riddle.hidden:
        return nothing(riddle)
    names = tuple((f"{h.effect}@{h.component}",) for h in riddle.hidden)
    one, two = riddle.train, riddle.test
    bare = riddle.bare
    return Answer(
        "effect", names, (one.residual - bare[0].residual, two.residual - bare[1].residual)
    )


def geometry_only(riddle: Riddle, words: Dictionary) -> Answer:
    """Calibrate joint axes and zeros without a prior, and believe that this is all."""
    chosen = [word for word in words.words if word.name.split("@")[0] in GEOMETRY]
    values, gain, free = whitened(riddle, words).fit(chosen)
    if chi2.sf(gain, free) > ALPHA:
        return nothing(riddle)
    names = tuple(word.name for word in chosen if "axis" in word.name)
    return Answer("effect", (names,), explained(chosen, values))


def stepwise_bic(riddle: Riddle, words: Dictionary) -> Answer:
    """Add words while BIC falls, every unit taken as white noise and independent."""
    white = np.einsum("uii->ui", riddle.train.covariance).min(axis=0)
    session = replace(
        riddle.train,
        covariance=np.broadcast_to(np.diag(white), riddle.train.covariance.shape),
        wander=np.zeros_like(riddle.train.wander),
    )
    fit = Whitened(session, words)
    return forward(riddle, words, fit, lambda gain, free, n: gain - free * np.log(n), single=True)


def spans_of_the_laws(riddle: Riddle, words: Dictionary) -> Answer:
    """Test spans of the simulation's own laws, linear, with the true covariance.

    No ceiling: strong play and friction are not linear, and a wide span explains more.
    """
    fit = whitened(riddle, words)
    allowed = ALPHA / max(len(words.searched), 1)

    def evidence(gain: float, free: int, n: int) -> float:
        return float(np.log(allowed) - chi2.logsf(gain, free))

    return forward(riddle, words, fit, evidence, single=False)


def gaussian_process(riddle: Riddle, words: Dictionary) -> Answer:
    """Interpolate the residual over the conditions; it compensates and names nothing."""
    train, test = riddle.train, riddle.test
    used = train.measured.any(axis=0)
    factor, factor_test = (np.linalg.cholesky(each.covariance) for each in (train, test))
    centred = whitened(riddle, words).without_nuisance(train.residual)
    values = np.linalg.solve(factor, centred[..., None])[..., 0]
    rows = train.measured[:, used].all(axis=1)
    # What a sensor wandered with the time of one session says nothing about another.
    here, there = (np.delete(each.conditions, TIME, axis=1) for each in (train, test))
    known = here[rows]
    trials = [
        (_gp_cost(known, values[rows], length, height), length, height)
        for length in (0.5, 1.0, 2.0)
        for height in (0.3, 1.0, 3.0, 10.0, 30.0)
    ]
    best, length, height = min(trials)
    if _gp_cost(known, values[rows], 1.0, 0.0) - best < GP_EVIDENCE:
        return nothing(riddle)
    kernel = height**2 * _kernel(known, known, length)
    weights = np.linalg.solve(kernel + np.eye(len(kernel)), values[rows])
    one, two = (
        np.einsum("uij,uj->ui", f, height**2 * _kernel(at, known, length) @ weights)
        for f, at in ((factor, here), (factor_test, there))
    )
    return Answer("unknown", (), (one, two))


def forward(
    riddle: Riddle,
    words: Dictionary,
    fit: Whitened,
    evidence: Callable[[float, int, int], float],
    single: bool,
) -> Answer:
    """Enter words while the evidence for the best is positive; `single`: classes of one."""
    candidates = words.searched
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
                trials.append((evidence(gain - gained, rank - used, n), gain, rank, found, word))
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
        unknown = not single and chi2.sf(excess + n, n) < ALPHA
        return nothing(riddle, "unknown" if unknown else "none")
    left = excess - gained + used
    unknown = not single and left > STRUCTURE * excess and chi2.sf(left + n, n) < ALPHA
    return Answer("unknown" if unknown else "effect", tuple(classes), explained(chosen, values))


def _kernel(x: Array, y: Array, length: float) -> Array:
    distance = np.sum((x[:, None] - y[None]) ** 2, axis=-1)
    return np.exp(-0.5 * distance / length**2)


def _gp_cost(conditions: Array, values: Array, length: float, height: float) -> float:
    """Return the negative log evidence of all six components with unit noise."""
    covariance = height**2 * _kernel(conditions, conditions, length) + np.eye(len(conditions))
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, values)
    return float(0.5 * np.sum(white**2) + 6.0 * np.sum(np.log(np.diag(factor))))
