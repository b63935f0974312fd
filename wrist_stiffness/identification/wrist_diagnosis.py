"""Find the physical effects that are missing in a model of this wrist."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.base_fit import BaseFit, fit_base, fit_cleaned
from wrist_stiffness.identification.candidates import compensable, turns_normal
from wrist_stiffness.identification.held_out import ANOTHER_SESSION, MUCH, Judge
from wrist_stiffness.identification.problem import require_units
from wrist_stiffness.identification.proposal import Proposals
from wrist_stiffness.identification.proposing import propose
from wrist_stiffness.identification.strained import Strain, strain
from wrist_stiffness.identification.taken_up import TakenUp, taken_up
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.answer import Diagnosis, Finding, NotExcited
from wrist_stiffness.inference.evidence import Evidence
from wrist_stiffness.inference.giving import told
from wrist_stiffness.inference.held_out import HeldOut, bought, refuted
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.reading import (
    NAMING,
    Class,
    Reading,
    not_shown,
    read,
    settled,
    standings,
)
from wrist_stiffness.inference.search import TIME_OVER, Search, State
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.registry import catalogue, find_law
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.observing import without_mounting
from wrist_stiffness.sessions.refitted import TOLERATED
from wrist_stiffness.sessions.unit_session import UnitSession, all_units

Tell = Callable[[str], None]


def silent(text: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True, eq=False)
class WristDiagnosis:
    """Answer of a diagnosis on the wrist."""

    diagnosis: Diagnosis  # what is missing, and how sure that is
    effects: tuple[Effect, ...]  # most probable member of each finding, fitted with its own law
    # the model with its tolerances as fitted without any effect, and with those
    nominal: BaseFit
    fitted: BaseFit
    # what calibration took up: the set-up first, then tolerances, furthest from its prior first
    absorbed: tuple[TakenUp, ...]
    search: Search  # with every set that was fitted, for what each rival would explain
    classes: tuple[Class, ...]  # of the most probable set
    # laws for what no effect of the catalogue explains; asked where the verdict is `unknown`
    proposals: Proposals | None = None
    # how far all tolerances together are from the drawing; None beside a proposed law
    strain: Strain | None = None

    @property
    def observations(self) -> Observations:
        """What the nominal model leaves of each unit."""
        table = self.nominal.problem.table
        return table.with_values(without_mounting(table, self.nominal.residual))

    def change_by(self, name: str) -> Array:
        """Return what the best set with a rival explains of each unit, (u, 6) [m, rad].

        Raises `InputError` if no set with it was fitted.
        """
        change = self.nominal.residual - self.search.best_with(name).fit.base.residual
        return without_mounting(self.nominal.problem.table, change)


def diagnose_sessions(
    model: ErrorModel,
    sessions: Sequence[MeasuredSession],
    naming: float = NAMING,
    seconds: float = np.inf,
    tell: Tell = silent,
    problem: WristProblem | None = None,
) -> WristDiagnosis:
    """Find the effects of the catalogue that a model misses.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    sessions : sequence of MeasuredSession
        In the order of time.  Of several the last one judges what the others show; of one its end
        judges the values, and the whole of it chooses the effects.
    naming : float, optional
        Probability from which an effect is named.
    seconds : float, optional
        Time after which no further fit is begun and no further law is judged.
    tell : callable, optional
        Told what is being done.
    problem : WristProblem, optional
        Of this model and its only session, where it is known.

    Returns
    -------
    WristDiagnosis
        The answer, and the fits that it rests on.

    Raises
    ------
    InputError
        If there is no session, or one without any measured pose, or a setting is out of range.
    """
    end = time.monotonic() + seconds
    _require_poses(sessions)
    require_limits(naming, seconds)
    units = all_units(model, sessions)
    problem = problem or WristProblem(model, units[:-1] if len(units) > 1 else units)
    require_units(problem.begin().base.problem)
    search = Search(problem, seconds, tell)
    search.run()
    reading = _settled(read(search, naming), search, naming)
    tell("judging by what was held out")
    judge = _Judged(model, units, search, reading.state.fit.base)
    if refuted(judge.before, judge.after):
        # What the held-out part speaks against is not handed over.
        judge.after = judge.before
        reading = _settled(reading.refute(search.base), search, naming)
    proposals = None
    if search.ended != TIME_OVER and (reading.verdict == "unknown" or reading.depends_on):
        left = end - time.monotonic()
        proposals = propose(problem, reading.state.fit, naming, tell, left)
    state = reading.state
    absorbed = taken_up(state.fit.base, [session.name for session in sessions])
    findings = [_finding(each, reading, judge) for each in reading.named]
    suspects = [
        _finding(each, reading, None) for each in reading.classes if each not in reading.named
    ]
    table = state.fit.table
    reported = table.observations.reported
    noise = judge.noise(state.evidence, drift=True)
    unforeseen = {} if reading.unexplained else _much(judge.after.rms(reported), noise)
    together = judge.together(state.fit.base).rms(reported) if unforeseen else {}
    verdict, sure = reading.verdict, reading.probability
    if (contradicted := _much(together, noise)) and verdict in ("none", "undecided"):
        # So much above the noise is no chance.
        verdict, sure = "unknown", 1.0
    diagnosis = Diagnosis(
        verdict,
        sure,
        table.noise(state.evidence),
        table.above(state.evidence),
        judge.before.rms(reported),
        judge.after.rms(reported),
        tuple(findings),
        tuple(suspects),
        reading.depends_on,
        reading.unexplained,
        standings(search, reading),
        _not_excited(search, reading),
        tuple(each.sentence for each in absorbed),
        judge.scope,
        ended=search.ended,
        held_out_noise=judge.noise(state.evidence),
        unforeseen=unforeseen,
        contradicted=contradicted,
        noise_known=table.background.noise_known,
    )
    # Tolerances that give way to an unknown law, or one not asked yet, say nothing of the drawing.
    asked = search.ended != TIME_OVER and (proposals is None or proposals.complete)
    tense = strain(state.fit) if asked and not (proposals and proposals.terms) else None
    beyond = state.fit.base.beyond()
    effects = tuple(beyond[each.name] for each in reading.named)
    return WristDiagnosis(
        diagnosis,
        effects,
        search.base.fit.base,
        state.fit.base,
        absorbed,
        search,
        reading.classes,
        proposals,
        tense,
    )


def _settled(reading: Reading, search: Search, naming: float) -> Reading:
    """Return a reading with its set as it is handed over."""
    found = reading.state.fit.settled()
    state = replace(reading.state, fit=found, evidence=found.evidence)
    return settled(reading, state, search, naming)


def require_limits(naming: float, seconds: float) -> None:
    """Refuse a probability from which to name, or a time, that is out of range (InputError)."""
    if not 0.0 < naming < 1.0:
        raise InputError(f"naming probability {100.0 * naming:g} %: must be between 0 and 100 %")
    if not seconds > 0.0:
        raise InputError(f"{seconds:g} seconds for a diagnosis: must be above 0")


def _require_poses(sessions: Sequence[MeasuredSession]) -> None:
    if not sessions:
        raise InputError("no session to diagnose")
    for session in sessions:
        if not session.measured.any():
            raise InputError(f"{session.name}: no measured pose in the whole session")


class _Judged:
    """An answer, judged by what was not seen."""

    def __init__(
        self, model: ErrorModel, whole: tuple[UnitSession, ...], search: Search, near: BaseFit
    ) -> None:
        nominal: BaseFit = search.base.fit.base
        if len(whole) > len(nominal.problem.sessions):
            nominal, _ = fit_cleaned(replace(nominal.problem, sessions=whole))
        self._model, self._judge, self._near = model, Judge(nominal), near
        self.scope = self._judge.by
        self.before = self._left([])
        effects = list(near.beyond().values())
        self.after = self._left(effects) if effects else self.before

    def noise(self, found: Evidence, drift: bool = False) -> dict[str, float]:
        """Return the noise of another session that judges; nothing where there is none."""
        return self._judge.noise(found, drift) if self.scope == ANOTHER_SESSION else {}

    def _left(self, effects: Sequence[Effect]) -> HeldOut:
        """Return what is left by the model with some effects."""
        judge = self._judge
        # A pin that rests where it does leads back there; from the nominal model it may not.
        near = self._near if effects else judge.whole
        return judge.left(fit_base(self._model, judge.seen, effects, near))

    def together(self, near: BaseFit) -> HeldOut:
        """Return what a fit to all sessions with the same effects leaves there."""
        effects, whole = list(near.beyond().values()), self._judge.whole
        if effects:
            whole = fit_base(self._model, whole.problem.sessions, effects, whole)
        return self._judge.of_fit(whole)

    def without(self, fitted: BaseFit, name: str) -> HeldOut:
        """Return what is left without one of the effects."""
        others = [each for own, each in fitted.beyond().items() if own != name]
        return self._left(others) if others else self.before


def _much(errors: Mapping[str, float], noise: Mapping[str, float]) -> dict[str, float]:
    """Return errors by quantity in times noise and drift, where they are far above them."""
    return {
        key: errors[key] / size
        for key, size in noise.items()
        if errors.get(key, 0.0) > MUCH * size > 0.0
    }


def _finding(found: Class, reading: Reading, judge: _Judged | None) -> Finding:
    state = reading.state if judge is not None else found.within
    fit: WristFit = state.fit
    law, place = _law_and_place(found.name)
    effect = fit.base.beyond()[found.name]
    quantities = fit.table.observations.reported
    buys = {}
    if judge is not None:
        before = judge.without(fit.base, found.name)
        seen = judge.after.rms(quantities)
        buys = {q.key: bought(before, judge.after, q) for q in quantities if q.key in seen}
    normal = fit.base.problem.model.table.mechanism
    theta = np.concatenate([s.still.theta[s.measured] for s in fit.base.problem.sessions])
    points = turns_normal(fit.twist(found.name)[:, :, None], normal.normal(normal.forward(theta)))
    explained = 1.0 - found.left
    gives = {g.way: size for g, size in state.evidence.given.items() if g.name == found.name}
    sentences = [
        f"{find_law(law).sentence.format(place=place)}.",
        _shown_by(found),
        *(told(way, *size) for way, size in gives.items()),
    ]
    return Finding(
        tuple((*_law_and_place(name), share) for name, share in found.members.items()),
        found.probability,
        _values(state, found.name, effect),
        found.log_gain,
        explained,
        buys,
        compensable(find_law(law), place, points),
        " ".join(sentences),
        find_law(law).check,
        gives,
    )


def _shown_by(found: Class) -> str:
    """Return what shows an effect, in a sentence."""
    tense = None if found.without.rough else strain(found.without.fit)
    if tense and tense.rare:
        return f"Without it the wrist is outside its tolerances ({tense.how})."
    return f"Explains {100.0 * (1.0 - found.left):.3g} % of the error above the noise."


def _law_and_place(name: str) -> tuple[str, str]:
    law, _, place = name.partition("@")
    return law, place


def _values(state: State, name: str, effect: Effect) -> dict[str, tuple[float, float]]:
    """Return the parameters of an effect and their standard uncertainties, in their units."""
    fit: WristFit = state.fit
    places = fit.places[name]
    sigma = np.sqrt(np.diag(fit.covariance_by(state.evidence))[places])
    parameters = [fit.problem.unknowns[place].parameter for place in places]
    return {
        each.key: (effect.estimates[each.key].value, float(own * each.scale))
        for each, own in zip(parameters, sigma, strict=True)
    }


def _not_excited(search: Search, reading: Reading) -> tuple[NotExcited, ...]:
    found = [_law_and_place(name) for name in not_shown(search, reading)]
    return tuple(
        NotExcited(law, place, catalogue()[law].excited_by)
        for law, place in found
        if law not in TOLERATED
    )
