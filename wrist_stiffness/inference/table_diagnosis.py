"""Which physical effect is missing, in a plain table of any mechanism."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.answer import (
    NAMING,
    Class,
    Diagnosis,
    Finding,
    NotExcited,
    not_shown,
    probabilities,
    read,
    standings,
)
from wrist_stiffness.inference.candidates import Candidate
from wrist_stiffness.inference.held_out import HeldOut, bought, refuted
from wrist_stiffness.inference.linear import LinearFit, LinearProblem, linear_problem
from wrist_stiffness.inference.nuisance import Nuisance, nuisance_columns
from wrist_stiffness.inference.observations import Array, Mask, Observations
from wrist_stiffness.inference.plain_table import Table, lost
from wrist_stiffness.inference.predictor import LEAST, PredictedSet, Predictor, predicted_set
from wrist_stiffness.inference.search import Search, State

HELD_OUT = 5
"""One unit of so many judges where there is one session only."""

MOST_EFFECTS = 8
"""Effects of a set."""


@dataclass(frozen=True)
class TableDiagnosis(Diagnosis):
    """Answer for a plain table.

    Parameters
    ----------
    predictor : Predictor
        What was learned, averaged over the sets of effects, the discrepancy included; without
        effects where what was found made the held-out part worse.
    search : Search
        With every set that was fitted.
    lost : tuple of int
        Rows that lie far from everything together, left out.
    """

    predictor: Predictor = field(kw_only=True, repr=False)
    search: Search = field(kw_only=True, repr=False)
    lost: tuple[int, ...] = field(kw_only=True)

    def change_by(self, name: str) -> Array:
        """Return what the best set with a candidate says that it does to each unit, (n, m).

        Raises
        ------
        InputError
            If no set with it was fitted.
        """
        states = [each for each in self.search.states.values() if name in each.names]
        if not states:
            raise InputError(
                f"{name}: was not fitted; slopes alone told that it explains too little"
            )
        change: Array = max(states, key=lambda each: each.log).fit.change(name)
        return change


def diagnose(
    observations: Observations,
    candidates: Sequence[Candidate],
    nuisances: Sequence[Nuisance] = (),
    naming: float = NAMING,
    seconds: float = np.inf,
    ordered: bool = True,
    tell: Callable[[str], None] = lambda text: None,
) -> TableDiagnosis:
    """Find the effects that a model misses.

    Parameters
    ----------
    observations : Observations
        Measured minus predicted, with the conditions.  Of several sessions the last one judges what
        the others show; of one, a fifth of its units judges the values, and all of them choose the
        effects.
    candidates : sequence of Candidate
        The catalogue.
    nuisances : sequence of Nuisance, optional
        What is refitted in any case.
    naming : float, optional
        Probability from which an effect is named.
    seconds : float, optional
        Time after which no further fit is begun.
    ordered : bool, optional
        Whether the rows follow each other in time; False for a table that was sorted or shuffled.
        An instrument drifts only where they do and `time_s` tells when.
    tell : callable, optional
        Told what is being done.

    Returns
    -------
    TableDiagnosis
        The answer and a predictor.

    Raises
    ------
    InputError
        If nothing was measured, `naming` is no probability, two candidates or nuisances have one
        name, or columns are unusable.
    """
    if not 0.0 < naming < 1.0:
        raise InputError(f"naming must be a probability between 0 and 1, not {naming:g}")
    _refuse(observations, candidates, nuisances)
    observations = replace(observations, row=None)
    base = nuisance_columns(observations, tuple(nuisances)).columns
    away = lost(observations, base, candidates)
    whole = observations.take(~away)
    aside = _another_session(whole)
    seen = whole.take(~aside) if aside.any() else whole
    tell("looking at the table")
    problem = linear_problem(seen, candidates, nuisances, ordered)
    search = Search(problem, seconds, tell, MOST_EFFECTS, costly=False)
    search.run()
    reading = read(search, naming)
    tell("judging by what was held out")
    judge = _Judge(problem, whole, aside, nuisances, _noise(reading.state, problem.table))
    before, after = judge.left(search.base), judge.left(reading.state)
    refused = bool(reading.named) and refuted(before, after)
    if refused:
        after = before
        reading = reading.refute(search.base)
    suspects = [each for each in reading.classes if each not in reading.named]
    table = problem.table
    answer = Diagnosis(
        reading.verdict,
        reading.probability,
        seen.rms(_noise(reading.state, table)),
        seen.rms(_discrepancy(reading.state, table)),
        {q.key: before.rmse(q) for q in seen.reported},
        {q.key: after.rmse(q) for q in seen.reported},
        tuple(
            _finding(search, each, reading.state, _buys(judge, reading.state, each, after))
            for each in reading.named
        ),
        tuple(_finding(search, each, search.best, {}) for each in suspects),
        reading.depends_on,
        reading.unexplained,
        standings(search, reading),
        _not_excited(problem, search),
        scope="another session" if aside.any() else "a part of this session",
        complete=search.in_time,
    )
    return TableDiagnosis(
        **{each.name: getattr(answer, each.name) for each in fields(answer)},
        predictor=Predictor(_sets(search, refused), candidates, nuisances),
        search=search,
        lost=tuple(np.flatnonzero(away).tolist()),
    )


def _refuse(
    observations: Observations, candidates: Sequence[Candidate], nuisances: Sequence[Nuisance]
) -> None:
    for kind, group in (("candidate", candidates), ("nuisance", nuisances)):
        name, times = Counter(each.name for each in group).most_common(1)[0] if group else ("", 1)
        if times > 1:
            raise InputError(f"{kind} {name} is listed twice")
    if not observations.measured.any():
        raise InputError("nothing was measured: every value is NaN")
    if observations.n_units < 2:
        raise InputError("a table of one row: at least two are needed, one of them judges")


def _another_session(whole: Observations) -> Mask:
    """Return which units belong to the last of several sessions, (n,)."""
    names = np.unique(whole.sessions)
    return np.asarray((whole.sessions == names[-1]) & (len(names) > 1))


def _spread(whole: Observations) -> Mask:
    """Return every so manyth unit as their conditions sort them, (n,): row order has no part."""
    keys = [whole.covariates[name] for name in sorted(whole.covariates)] or [whole.times]
    place = np.empty(whole.n_units, dtype=np.int64)
    place[np.lexsort(keys)] = np.arange(whole.n_units)
    return np.asarray(place % HELD_OUT == min(HELD_OUT // 2, whole.n_units - 1))


class _Judge:
    """Fits to what was seen, judged by what was not, in units of one noise."""

    def __init__(
        self,
        problem: LinearProblem,
        whole: Observations,
        aside: Mask,
        nuisances: Sequence[Nuisance],
        variance: Array,
    ) -> None:
        self._problem, self._nuisances = problem, nuisances
        self._size = np.sqrt(variance)
        self._alone = not aside.any()
        if self._alone:
            aside = _spread(whole)
            candidates, ordered = problem.candidates, problem.table.ordered
            self._problem = linear_problem(whole.take(~aside), candidates, nuisances, ordered)
        self._unseen = whole.take(aside)
        free = nuisance_columns(self._unseen, tuple(nuisances))
        new = [session is not None and not self._alone for _, session, _ in free.keys]
        self._set_up = free.columns[:, :, new]
        self._prior = free.prior_std[new]

    def left(self, state: State) -> HeldOut:
        """Return what a set leaves of the unseen units, set up anew in another session."""
        problem = self._problem
        fit = problem.fitted(state.fit.terms)
        found = evidence(fit.point, problem.background)
        own = State(fit, found, found.log)
        values = predicted_set(own, 1.0)
        unseen = self._unseen
        change = Predictor((values,), problem.candidates, self._nuisances).predict(unseen)
        residual = unseen.values - change
        columns = self._set_up / self._size[:, None]
        rows = unseen.measured.ravel()
        flat = columns.reshape(len(rows), -1)[rows]
        target = (residual / self._size).ravel()[rows]
        gram = flat.T @ flat + np.diag(1.0 / self._prior**2)
        values_of = np.linalg.lstsq(gram, flat.T @ target, rcond=1e-12)[0]
        residual = residual - self._set_up @ values_of
        return HeldOut(residual, target - flat @ values_of)

    def without(self, state: State, name: str) -> HeldOut:
        """Return what is left without one of the effects."""
        fit = self._problem.without(state.fit, name)
        return self.left(State(fit, state.evidence, state.log))


def _noise(state: State, table: Table) -> Array:
    """Variance (m,) of a unit by the noise alone."""
    known = float(np.exp(3.0 * table.noise_width))
    return table.variance * (state.evidence.excess if state.evidence.excess <= known else 1.0)


def _discrepancy(state: State, table: Table) -> Array:
    """Variance (m,) above that noise."""
    share = state.evidence.unexplained / max(len(state.evidence.point.left), 1)
    return table.variance * share


def _buys(
    judge: _Judge, state: State, found: Class, after: HeldOut
) -> dict[str, tuple[float, float]]:
    """Return by how much the held-out error falls by an effect of a set."""
    before = judge.without(state, found.name)
    quantities = state.fit.problem.table.observations.reported
    return {quantity.key: bought(before, after, quantity) for quantity in quantities}


def _finding(
    search: Search, found: Class, state: State, buys: dict[str, tuple[float, float]]
) -> Finding:
    fit: LinearFit = state.fit
    candidate = fit.terms[found.name].candidate
    known = {each.name: each for each in fit.problem.candidates}
    explained = 1.0 - found.left
    return Finding(
        tuple((known[n].effect, known[n].component, share) for n, share in found.members.items()),
        found.probability,
        _values(state, found.name),
        found.log_gain,
        explained,
        buys,
        candidate.compensable,
        candidate.evidence or f"explains {100.0 * explained:.3g} % of the error above the noise",
        candidate.check,
    )


def _values(state: State, name: str) -> dict[str, tuple[float, float]]:
    """Return parameters and shapes of an effect with their standard uncertainties."""
    fit: LinearFit = state.fit
    _, values = predicted_set(state, 1.0).effects[name]
    term, sizes = fit.terms[name], fit.problem.sizes[name]
    sigma = np.sqrt(np.diag(state.evidence.covariance))
    own = sigma[fit.places[name]] * sizes
    found = {
        parameter.name: (float(value), float(error))
        for parameter, value, error in zip(term.candidate.parameters, values, own, strict=True)
    }
    first = len(fit.z)
    for other, each in fit.terms.items():
        for shape, value in zip(each.candidate.shape, each.shape, strict=True):
            if other == name:
                width = (shape.grid[-1] - shape.grid[0]) / np.sqrt(2.0 * np.pi)
                found[shape.name] = (value, float(sigma[first] * width))
            first += 1
    return found


def _not_excited(problem: LinearProblem, search: Search) -> tuple[NotExcited, ...]:
    """Return the candidates of which a plausible size would not show."""
    laws = {each.name: each for each in problem.candidates}
    return tuple(
        NotExcited(laws[name].effect, laws[name].component, laws[name].needs)
        for name in not_shown(search)
    )


def _sets(search: Search, refused: bool) -> tuple[PredictedSet, ...]:
    """Return the sets that predict, with their probabilities."""
    if refused:
        return (predicted_set(search.base, 1.0, whole=True),)
    known = probabilities(search)
    weights = {n: known[n] for n in search.states if known[n] >= LEAST}
    if not weights:
        return (predicted_set(search.best, 1.0, whole=True),)
    total = sum(weights.values())
    return tuple(predicted_set(search.states[n], w / total, True) for n, w in weights.items())
