"""A wrist, its recordings and a model that grows: the commands as an object, all in memory.

    analysis = Analysis(model, sessions)
    analysis.calibrate()
    answer = analysis.rank(seconds=30)
    print(analysis.preview("backlash@motor_2").explains)
    analysis.add("backlash@motor_2")
    for version in analysis.versions:
        print(version.name, version.held_out)
    analysis.undo()

A method that fails, or is cancelled, leaves everything as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np

from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.comparison import Comparison
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.identification.base_fit import BaseFit, free_base
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.identification.extension import base_beside, extend
from wrist_stiffness.identification.free_effects import unfitted
from wrist_stiffness.identification.held_out import Judge
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.identification.proposal import Proposals
from wrist_stiffness.identification.proposing import propose
from wrist_stiffness.identification.wrist_diagnosis import WristDiagnosis, diagnose_sessions
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.reading import NAMING
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.planning.plan import Conditions, Plan, plan
from wrist_stiffness.planning.question import between
from wrist_stiffness.planning.timeline import as_experiment
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.contents import Contents, contents_of
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.observing import without_mounting
from wrist_stiffness.sessions.refitted import SET_UP, names_of
from wrist_stiffness.sessions.unit_session import all_units

PREVIEW_STEPS = 3
"""That are told of."""


class Cancelled(WristError):
    """Somebody cancelled what was being done."""


@dataclass(frozen=True, eq=False)
class Version:
    """A model of the wrist on its way.

    Parameters
    ----------
    name : str
        What was done last: `as given`, `calibrated` or `+ law@component`.
    model : ErrorModel
        As it may be saved.
    held_out : dict of str to float
        Error on units that a fit has not seen, RMS by the key of the quantity (`s_um`, `phi_mdeg`).
    fit : WristFit or None
        To all recordings, with noise, discrepancy and every parameter; None where nothing was
        fitted.
    added : Effect or None
        Effect of the step.
    warnings : tuple of str
        What speaks against it.
    """

    name: str
    model: ErrorModel
    held_out: Mapping[str, float]
    fit: WristFit | None = None
    added: Effect | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Preview:
    """What a candidate would explain if it were added.

    Parameters
    ----------
    effect : Effect
        As fitted.
    change : (u, 6) float
        What it and the tolerances beside it take away from each unit [m, rad].
    log_gain : float
        Natural logarithm of the evidence with it over that without it.
    explains : dict of str to float
        Error before and after on the recordings themselves, RMS by the key of the quantity.
    """

    effect: Effect
    change: Array = field(repr=False)
    log_gain: float
    explains: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class View:
    """What one version says of each unit, and what it leaves.

    Parameters
    ----------
    left : Observations
        Measured less predicted once set-up and tolerances are fitted, and the conditions.
    predicted : (u, m) float
        Error of the pose by this version, or of what gauges read, without the set-up of instrument
        and motors [m, rad].
    noise : dict of str to float
        Noise of one unit and drift of the instrument, RMS by the key of the quantity.
    span : (u, 2) float
        First and last moment of each unit [s].
    noise_known : bool
        Whether anything tells the noise; else it is at most so large.
    """

    left: Observations
    predicted: Array
    noise: Mapping[str, float]
    span: Array
    noise_known: bool

    @property
    def measured(self) -> Array:
        """Measured error of the same, the set-up taken out, (u, m) [m, rad]."""
        return np.asarray(self.left.values + self.predicted)


class Analysis:
    """Models of one wrist against its recordings.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    sessions : sequence of MeasuredSession, or dict of them
        As `read_sessions` returns them, in the order of time; the last one judges where there are
        several, else the end of it.
    progress : callable, optional
        Told steps done and in all.
    tell : callable, optional
        Told in words what is being done.
    again : bool
        Whether the model was fitted to one of these sessions before: then what it found of the base
        is no knowledge to begin with.

    Raises
    ------
    InputError
        If there is no session, or nothing of one lies in the model's range.
    """

    def __init__(
        self,
        model: ErrorModel,
        sessions: Sequence[MeasuredSession] | Mapping[Path, MeasuredSession],
        progress: Progress = silent,
        tell: Callable[[str], None] = lambda text: None,
        again: bool = False,
    ) -> None:
        if not sessions:
            raise InputError("an analysis needs a session")
        self.sessions = tuple(sessions.values() if isinstance(sessions, Mapping) else sessions)
        self._progress, self._tell = progress, tell
        self._stop, self._again = Event(), again
        self._units = all_units(model, self.sessions)
        self._problems: list[WristProblem] = []
        self._versions = [Version("as given", model, {})]
        error = Judge(self._problem().begin().base).of_model(model)
        held_out = error.rms(self._shown.table.reported)
        self._versions = [replace(self._versions[0], held_out=held_out)]

    @property
    def versions(self) -> tuple[Version, ...]:
        """All models on the way, the first as it was given."""
        return tuple(self._versions)

    @property
    def model(self) -> ErrorModel:
        """The newest model."""
        return self._versions[-1].model

    @property
    def residual(self) -> Observations:
        """What the newest model leaves once set-up and tolerances are fitted, and conditions."""
        return self.view().left

    def view(self, number: int = -1) -> View:
        """Return what a version says of each unit, for pictures.

        Parameters
        ----------
        number : int
            Place among the versions, the newest by default.
        """
        fit, shown, predicted, spans = self._fit(number), self._shown, [], []
        for n, session in enumerate(shown.sessions):
            model = fit.base.model(n)
            own = tuple(each for each in model.effects if each.name not in names_of(SET_UP))
            predicted.append(session.seen(model.predicted([own])[0])[session.measured])
            spans.append(session.span[session.measured])
        left = shown.table.with_values(self._left(fit.base))
        noise = fit.table.noise_and_drift(fit.evidence)
        known = fit.table.background.noise_known
        return View(left, np.concatenate(predicted), noise, np.concatenate(spans), known)

    def contents(self) -> tuple[Contents, ...]:
        """Return what each recording holds, the instrument registered by the model as given."""
        base = self._problem(0).begin().base
        table, squares, found = base.problem.table, np.nan_to_num(self._left(base)) ** 2, []
        for n, each in enumerate(zip(self.sessions, base.problem.sessions, strict=True)):
            own = table.sessions == n
            found.append(contents_of(*each, table.take(own).rms(squares[own])))
        return tuple(found)

    def cancel(self) -> None:
        """Let what is being done end with `Cancelled` at its next step; call it from anywhere."""
        self._stop.set()

    def compare(self, number: int | None = None) -> Comparison:
        """Say how far every version, or one of them, is off, where and under which condition.

        Parameters
        ----------
        number : int, optional
            Place of the one.
        """
        asked = self._versions if number is None else [self._version(number)]
        models = [(each.name, each.model) for each in asked]
        return compare_models(models, self.sessions, self._watched(self._progress))

    def calibrate(self) -> Version:
        """Fit set-up and tolerances of the newest model; it becomes a version."""
        found = calibrate(self._known(), self.sessions, self._watched(self._progress))
        step = Step("calibrate", "", "", {})
        return self._became(
            "calibrated", found.model, step, found.after, found.fit, None, found.warnings
        )

    def rank(self, naming: float = NAMING, seconds: float = np.inf) -> WristDiagnosis:
        """Ask which effect the newest model misses.

        Parameters
        ----------
        naming : float
            Probability from which an effect is named.
        seconds : float
            Time after which no further fit is begun.

        Returns
        -------
        WristDiagnosis
            Findings, and in `diagnosis.standings` every candidate with its probability.
        """
        tell = self._watched(self._tell)
        known = self._problem() if len(self.sessions) == 1 else None
        return diagnose_sessions(self._known(), self.sessions, naming, seconds, tell, known)

    def propose(self, naming: float = NAMING, seconds: float = np.inf) -> Proposals:
        """Ask for a law where no effect of the catalogue explains what the newest model leaves.

        Parameters
        ----------
        naming : float
            Probability from which there is a law at all.
        seconds : float
            Time after which no further law is judged.

        Returns
        -------
        Proposals
            Each of its `terms` has a `sentence`, a `formula`, and an `effect()` for `add`.
        """
        problem = self._problem()
        tell = self._watched(self._tell)
        return propose(problem, problem.begin(), naming, tell, seconds)

    def preview(self, candidate: str | Effect) -> Preview:
        """Return what a candidate would explain, without adding it.

        Parameters
        ----------
        candidate : str or Effect
            `law@component` of the catalogue, or an effect of any law.

        Raises
        ------
        InputError
            If there is no such law or component, the model has it already, or it finds no
            equilibrium here.
        """
        progress, effect = self._watched(self._progress), self._new(candidate)
        progress(0, PREVIEW_STEPS)
        problem = self._problem()
        progress(1, PREVIEW_STEPS)
        begun = problem.begin()
        grown = problem.extended(begun, effect)
        progress(2, PREVIEW_STEPS)
        table = self._shown.table
        # What a version leaves is told by its own fit, which may have ended in another valley.
        before, after = (self._left(each.base) for each in (self._fit(), grown))
        errors = [table.rms(np.nan_to_num(each) ** 2) for each in (before, after)]
        seen = Preview(
            grown.base.beyond()[effect.name],
            before - after,
            grown.evidence.log - begun.evidence.log,
            {q.key: (errors[0][q.key], errors[1][q.key]) for q in table.reported},
        )
        progress(PREVIEW_STEPS, PREVIEW_STEPS)
        return seen

    def add(self, candidate: str | Effect) -> Version:
        """Add an effect to the newest model and fit both; the result becomes a version.

        Parameters
        ----------
        candidate : str or Effect
            As for `preview`.

        Raises
        ------
        InputError
            If the model has it already, or the recordings lack a signal that it needs.
        """
        effect, watched = self._new(candidate), self._watched(self._progress)
        found = extend(self._known(), effect, self.sessions, watched, self._problem())
        step = Step("extend", "", "", {}, added=effect.name)
        held_out = found.after.rms(found.quantities)
        own = next(each for each in found.model.effects if each.name == effect.name)
        told = held_out, found.fit, own, found.warnings
        return self._became(f"+ {effect.name}", found.model, step, *told)

    def undo(self) -> Version:
        """Take the newest version back, and return the one before it.

        Raises
        ------
        InputError
            If there is only the model as it was given.
        """
        if len(self._versions) == 1:
            raise InputError("nothing to undo: this is the model as it was given")
        self._versions.pop()
        return self._versions[-1]

    def plan(self, rivals: Sequence[str | Effect], conditions: Conditions) -> Plan:
        """Plan the experiment that tells rivals apart.

        Parameters
        ----------
        rivals : sequence of str or Effect
            Two or more, the most probable first.
        conditions : Conditions
            Loads, durations, noise.
        """
        asked = [_effect(each) for each in rivals]
        question = between([asked], (), np.random.default_rng(conditions.seed))
        earlier = [as_experiment(self.model, each) for each in self.sessions]
        return plan(self.model, question, conditions, earlier, self._watched(self._progress))

    def _became(self, name: str, model: ErrorModel, step: Step, *told: Any) -> Version:
        child = replace(model, lineage=(*self.model.lineage, step))
        self._versions.append(Version(name, child, *told))
        return self._versions[-1]

    def _new(self, candidate: str | Effect) -> Effect:
        """Return an effect that the newest model may get."""
        effect = _effect(candidate)
        base_beside(self._known(), effect, self.sessions)
        return effect

    def _version(self, number: int) -> Version:
        count = len(self._versions)
        if not -count <= number < count:
            raise InputError(f"there is no version {number}: the newest is {count - 1}")
        return self._versions[number]

    def _known(self, number: int = -1) -> ErrorModel:
        """Return a version's model without what fits to these recordings found of its base."""
        last = range(len(self._versions))[number]
        model = self._versions[last].model
        fitted = self._again or any(each.fit is not None for each in self._versions[: last + 1])
        return unfitted(model) if fitted else model

    def _problem(self, number: int = -1) -> WristProblem:
        """Return the problem of a version; what asks the same is fitted once."""
        known = self._known(number)
        base = free_base(known)
        for each in self._problems:
            if each.asks(known, base):
                return each
        self._problems.append(WristProblem(known, self._units, base))
        return self._problems[-1]

    def _fit(self, number: int = -1) -> WristFit:
        """Return what a version was fitted with; only the model as given needs a fit for it."""
        fit = self._version(number).fit
        return self._problem(number).begin() if fit is None else fit

    @property
    def _shown(self) -> FitProblem:
        """The model as given on the units that are shown, which another fit may take for lost."""
        return self._problem(0).begin().base.problem

    def _left(self, fitted: BaseFit) -> Array:
        """Return what a fit leaves of the units that are shown, (u, m) [m, rad]."""
        shown, left = self._shown, fitted.residual
        pairs = zip(shown.sessions, fitted.problem.sessions, strict=True)
        if not all(np.array_equal(one.measured, two.measured) for one, two in pairs):
            left = replace(fitted.problem, sessions=shown.sessions).residual(fitted.z)
        return without_mounting(shown.table, left)

    def _watched(self, hears: Callable[..., None]) -> Callable[..., None]:
        """Return who is told, so that what is being done ends once that was cancelled."""
        self._stop.clear()

        def told(*said: object) -> None:
            if self._stop.is_set():
                raise Cancelled("cancelled")
            hears(*said)

        return told


def _effect(candidate: str | Effect) -> Effect:
    return candidate if isinstance(candidate, Effect) else effect_named(candidate)
