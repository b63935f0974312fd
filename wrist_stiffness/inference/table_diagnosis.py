"""Which physical effect is missing, in a plain table of any mechanism."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.answer import Diagnosis, Finding, NotExcited
from wrist_stiffness.inference.candidates import Candidate, Nuisance, nuisance_columns
from wrist_stiffness.inference.held_out import HeldOut, bought, speak_for
from wrist_stiffness.inference.linear import LinearFit, LinearProblem
from wrist_stiffness.inference.noise import in_each_component
from wrist_stiffness.inference.observations import Array, Mask, Observations
from wrist_stiffness.inference.outliers import FEWEST_UNITS, OUTLIER_LIMIT, lost_units
from wrist_stiffness.inference.plain_table import Table
from wrist_stiffness.inference.predictor import LEAST, PredictedSet, Predictor, predicted_set
from wrist_stiffness.inference.reading import (
    NAMING,
    Class,
    Reading,
    not_shown,
    probabilities,
    read,
    standings,
)
from wrist_stiffness.inference.search import NEGLIGIBLE, Search, State
from wrist_stiffness.inference.shared import component_factors, own_covariance
from wrist_stiffness.inference.smooth import questions

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
        change: Array = self.search.best_with(name).fit.change(name)
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
        name, columns are unusable, or a variance is not above 0.
    """
    if not 0.0 < naming < 1.0:
        raise InputError(f"naming must be a probability between 0 and 1, not {naming:g}")
    _refuse(observations, candidates, nuisances)
    observations = replace(observations, row=None)
    base = nuisance_columns(observations, tuple(nuisances)).columns
    away = _lost(observations, base, candidates)
    whole = observations.take(~away)
    names = np.unique(whole.sessions)
    aside = np.asarray((whole.sessions == names[-1]) & (len(names) > 1))
    seen = whole.take(~aside) if aside.any() else whole
    tell("looking at the table")
    problem = LinearProblem(seen, candidates, nuisances, ordered)
    search = Search(problem, seconds, tell, MOST_EFFECTS, costly=False)
    search.run()
    reading = read(search, naming)
    tell("judging by what was held out")
    judge = _Judge(problem, whole, aside, nuisances, _noise(reading.state, problem.table))
    before, after = judge.left(search.base.fit), judge.left(reading.state.fit)
    refused = bool(reading.named) and judge.refutes(search.base.fit, reading.state.fit)
    if refused:
        after = before
        reading = reading.refute(search.base)
    suspects = [each for each in reading.classes if each not in reading.named]
    table = problem.table
    return TableDiagnosis(
        reading.verdict,
        reading.probability,
        seen.rms(_noise(reading.state, table)),
        table.above(reading.state.evidence),
        before.rms(seen.reported),
        after.rms(seen.reported),
        tuple(
            _finding(each, reading.state, judge.left(reading.state.fit, each.name), after)
            for each in reading.named
        ),
        tuple(_finding(each, each.within) for each in suspects),
        reading.depends_on,
        reading.unexplained,
        standings(search, reading),
        _not_excited(problem, search, reading),
        scope="another session" if aside.any() else "a part of this session",
        ended=search.ended,
        noise_known=reading.state.evidence.background.noise_known,
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
    if observations.covariance is not None:
        own = own_covariance(observations, observations.covariance)
        component_factors(own, observations.measured)


def _lost(observations: Observations, base: Array, candidates: Sequence[Candidate]) -> Mask:
    """Return which units lie far from everything together, (n,)."""
    if observations.n_units < FEWEST_UNITS:
        return np.zeros(observations.n_units, dtype=bool)
    smooth = [each.features(observations.covariates) for each in questions(observations)]
    columns = [in_each_component(smooth, observations)]
    columns += [each.evaluate(observations, s) for each in candidates for s in each.shapes]
    return lost_units(observations, base, np.concatenate(columns, axis=2), OUTLIER_LIMIT)


def _spread(whole: Observations) -> Mask:
    """Return every so manyth unit as their conditions sort them, (n,): row order has no part."""
    keys = [whole.covariates[name] for name in sorted(whole.covariates)] or [whole.times]
    place = np.empty(whole.n_units, dtype=np.int64)
    place[np.lexsort(keys)] = np.arange(whole.n_units)
    return np.asarray(place % HELD_OUT == min(HELD_OUT // 2, whole.n_units - 1))


class _Judge:
    """Fits to what was seen, judged by what was not."""

    def __init__(
        self,
        problem: LinearProblem,
        whole: Observations,
        aside: Mask,
        nuisances: Sequence[Nuisance],
        variance: Array,
    ) -> None:
        self._nuisances, self._size = nuisances, np.sqrt(variance)
        alone = not aside.any()
        if alone:
            aside = _spread(whole)
        laws, other = list(problem.laws.values()), whole.take(~aside) if alone else whole
        second = LinearProblem(other, laws, nuisances, problem.table.ordered)
        self._problem, self._all = (second, problem) if alone else (problem, second)
        self._aside, self._unseen = aside, whole.take(aside)
        free = nuisance_columns(self._unseen, tuple(nuisances))
        new = [session is not None and not alone for _, session, _ in free.keys]
        self._set_up = free.columns[:, :, new]
        self._prior = free.prior_std[new]

    def refutes(self, nominal: LinearFit, found: LinearFit) -> bool:
        """Tell whether what was not seen speaks against a set."""
        problem = self._all
        with_it, without = (problem.fitted(each.terms).point for each in (found, nominal))
        taken = problem.table.without(self._aside)
        return speak_for(with_it, without, problem.background, taken) < -NEGLIGIBLE

    def left(self, found: LinearFit, without: str = "") -> HeldOut:
        """Return what a set, or that without an effect, leaves of the unseen units.

        Set up anew in another session.
        """
        problem, unseen = self._problem, self._unseen
        fit = problem.without(found, without)
        values = predicted_set(fit, evidence(fit.point, problem.background), 1.0)
        laws = list(problem.laws.values())
        residual = unseen.values - Predictor((values,), laws, self._nuisances).predict(unseen)
        columns = self._set_up / self._size[:, None]
        rows = unseen.measured.ravel()
        flat = columns.reshape(len(rows), -1)[rows]
        target = (residual / self._size).ravel()[rows]
        gram = flat.T @ flat + np.diag(1.0 / self._prior**2)
        set_up = np.linalg.lstsq(gram, flat.T @ target, rcond=1e-12)[0]
        return HeldOut(residual - self._set_up @ set_up, target - flat @ set_up)


def _noise(state: State, table: Table) -> Array:
    """Variance (m,) of a unit by the noise alone."""
    return table.variance * state.evidence.noise


def _finding(
    found: Class, state: State, before: HeldOut | None = None, after: HeldOut | None = None
) -> Finding:
    """Return an effect of a set; what it buys, where the held-out error without it is known."""
    fit: LinearFit = state.fit
    candidate, known = fit.terms[found.name].candidate, fit.problem.laws
    buys = {}
    if before is not None and after is not None:
        buys = {q.key: bought(before, after, q) for q in fit.problem.observations.reported}
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
    _, values = predicted_set(fit, state.evidence, 1.0).effects[name]
    term, sizes = fit.terms[name], fit.problem.sizes[name]
    sigma = np.sqrt(np.diag(fit.covariance_by(state.evidence)))
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


def _not_excited(
    problem: LinearProblem, search: Search, reading: Reading
) -> tuple[NotExcited, ...]:
    """Return the candidates of which a plausible size would not show."""
    laws = problem.laws
    return tuple(
        NotExcited(laws[name].effect, laws[name].component, laws[name].needs)
        for name in not_shown(search, reading)
    )


def _sets(search: Search, refused: bool) -> tuple[PredictedSet, ...]:
    """Return the sets that predict, with their probabilities."""
    known = probabilities(search)
    weights = {n: known[n] for n in search.states if known[n] >= LEAST} or {search.best.names: 1.0}
    if refused:
        weights = {search.base.names: 1.0}
    total, sets = sum(weights.values()), []
    for names, weight in weights.items():
        state = search.states[names]
        sets.append(predicted_set(state.fit, state.evidence, weight / total, whole=True))
    return tuple(sets)
