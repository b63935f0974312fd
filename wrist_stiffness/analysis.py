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
from dataclasses import dataclass, replace
from threading import Event

import numpy as np

from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.comparison import Comparison
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.identification.extension import extend
from wrist_stiffness.identification.free_effects import unfitted
from wrist_stiffness.identification.held_out import Judge
from wrist_stiffness.identification.proposal import Proposals
from wrist_stiffness.identification.proposing import propose
from wrist_stiffness.identification.result import Fit
from wrist_stiffness.identification.wrist_diagnosis import WristDiagnosis, diagnose_sessions
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.answer import NAMING
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.planning.earlier import as_experiment
from wrist_stiffness.planning.plan import Conditions, Plan, plan
from wrist_stiffness.planning.question import between
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.refitted import SET_UP, names_of
from wrist_stiffness.sessions.unit_session import as_units


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
    fit : Fit or None
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
    fit: Fit | None = None
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
    change: Array
    log_gain: float
    explains: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class View:
    """What one version says of each unit, and what it leaves.

    Parameters
    ----------
    left : Observations
        Measured less predicted once set-up and tolerances are fitted, and the conditions.
    predicted : (u, 6) float
        Error of the pose by this version, without the set-up of instrument and motors [m, rad].
    noise : dict of str to float
        Noise of one unit and drift of the instrument, RMS by the key of the quantity.
    """

    left: Observations
    predicted: Array
    noise: Mapping[str, float]

    @property
    def measured(self) -> Array:
        """Measured error of the pose, the set-up taken out, (u, 6) [m, rad]."""
        return np.asarray(self.left.values + self.predicted)


@dataclass(frozen=True, eq=False)
class Contents:
    """What one recording holds.

    Parameters
    ----------
    name, instrument : str
        Of the recording, and of its pose sensor.
    duration_s, rate_hz : float
        Duration [s], and measured poses in a second [Hz].
    measured, dwells : int
        Measured poses, and poses that were held.
    angles : (2, 2) float
        Lowest and highest angle of each motor [rad].
    speed, force : (float, float)
        Lowest and highest [rad/s], [N].
    signals : tuple of str
        What was recorded beside angles, load and pose.
    registered : dict of str to float
        Remaining error once it is known where instrument and target stand, RMS by the key of the
        quantity.
    """

    name: str
    instrument: str
    duration_s: float
    rate_hz: float
    measured: int
    dwells: int
    angles: Array
    speed: tuple[float, float]
    force: tuple[float, float]
    signals: tuple[str, ...]
    registered: Mapping[str, float]


class Analysis:
    """Models of one wrist against its recordings.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    sessions : sequence of MeasuredSession
        In the order of time; the last one judges where there are several, else the end of it.
    progress : callable, optional
        Told steps done and in all.
    tell : callable, optional
        Told in words what is being done.

    Raises
    ------
    InputError
        If there is no session, or nothing of one lies in the model's range.
    """

    def __init__(
        self,
        model: ErrorModel,
        sessions: Sequence[MeasuredSession],
        progress: Progress = silent,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        if not sessions:
            raise InputError("an analysis needs a session")
        self.sessions = tuple(sessions)
        self._progress, self._tell = progress, tell
        self._stop = Event()
        self._problems: dict[int, WristProblem] = {}
        self._versions = [Version("as given", model, {})]
        base = self._problem().begin().base
        error = Judge(base).of_model(model)
        held_out = {q.key: error.rmse(q) for q in base.problem.table.reported}
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
        version = self._versions[number]
        # What the version was fitted with is known; only the model as given needs a fit for this.
        fit = self._problem(number).begin() if version.fit is None else version.fit.fit
        base, predicted = fit.base, []
        for n, session in enumerate(base.problem.sessions):
            model = base.model(n)
            own = tuple(each for each in model.effects if each.name not in names_of(SET_UP))
            predicted.append(model.predicted([own])[0][session.measured])
        left = base.problem.table.with_values(base.residual)
        return View(left, np.concatenate(predicted), fit.table.noise_and_drift(fit.evidence))

    def contents(self) -> tuple[Contents, ...]:
        """Return what each recording holds, the instrument registered by the model as given."""
        base = self._problem(0).begin().base
        table, found = base.problem.table, []
        squares = np.nan_to_num(base.residual) ** 2
        for n, (session, units) in enumerate(
            zip(self.sessions, base.problem.sessions, strict=True)
        ):
            block, cut, warm = session.block, units.cut, len(session.block.temperatures)
            seconds, measured = float(np.ptp(block.time)), int(session.measured.any(axis=1).sum())
            speed = np.abs(cut.mean_speed).max(axis=1)
            force = np.linalg.norm(block.load[:, :3], axis=1)
            own = table.sessions == n
            found.append(
                Contents(
                    session.name,
                    str(session.notes.get("pose_sensor", "not told")),
                    seconds,
                    measured / seconds if seconds > 0.0 else 0.0,
                    measured,
                    int(cut.dwell[units.measured].sum()),
                    np.stack([block.theta.min(axis=0), block.theta.max(axis=0)], axis=1),
                    (float(speed.min()), float(speed.max())),
                    (float(force.min()), float(force.max())),
                    (*block.covariates, *([f"{warm} temperatures"] if warm else ())),
                    table.take(own).rms(squares[own]),
                )
            )
        return tuple(found)

    def cancel(self) -> None:
        """Let what is being done end with `Cancelled` at its next step; call it from anywhere."""
        self._stop.set()

    def compare(self) -> Comparison:
        """Say how far every version is off, where and under which condition."""
        models = [(each.name, each.model) for each in self._versions]
        return compare_models(models, self.sessions, self._watched())

    def calibrate(self) -> Version:
        """Fit set-up and tolerances of the newest model; it becomes a version."""
        now = self._versions[-1]
        known = self._known()
        found = calibrate(known, self.sessions, self._watched())
        step = Step("calibrate", "", "", {})
        child = replace(found.model, lineage=(*now.model.lineage, step))
        return self._became(Version("calibrated", child, found.after, found.fit))

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
        tell = self._watched_words()
        return diagnose_sessions(self._known(), self.sessions, naming, seconds, tell)

    def propose(self, naming: float = NAMING) -> Proposals:
        """Ask for a law where no effect of the catalogue explains what the newest model leaves.

        Parameters
        ----------
        naming : float
            Probability from which there is a law at all.

        Returns
        -------
        Proposals
            Each of its `terms` has a `sentence`, a `formula`, and an `effect()` for `add`.
        """
        problem = self._problem()
        return propose(problem, problem.begin(), naming, self._watched_words())

    def preview(self, candidate: str | Effect) -> Preview:
        """Return what a candidate would explain, without adding it.

        Parameters
        ----------
        candidate : str or Effect
            `law@component` of the catalogue, or an effect of any law.

        Raises
        ------
        InputError
            If there is no such law or component, or it finds no equilibrium here.
        """
        self._watched()(0, 1)
        problem, effect = self._problem(), _effect(candidate)
        begun = problem.begin()
        grown = problem.extended(begun, effect)
        before, after = begun.base.residual, grown.base.residual
        table = problem.table.table
        errors = [table.rms(np.nan_to_num(each) ** 2) for each in (before, after)]
        return Preview(
            grown.base.beyond()[effect.name],
            before - after,
            grown.evidence.log - begun.evidence.log,
            {q.key: (errors[0][q.key], errors[1][q.key]) for q in table.reported},
        )

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
        now, effect = self._versions[-1], _effect(candidate)
        watched, known = self._watched(), self._problem()
        found = extend(self._known(), effect, self.sessions, watched, known)
        step = Step("extend", "", "", {}, added=effect.name)
        child = replace(found.model, lineage=(*now.model.lineage, step))
        held_out = {q.key: found.after.rmse(q) for q in found.quantities}
        own = next(each for each in child.effects if each.name == effect.name)
        name = f"+ {effect.name}"
        return self._became(Version(name, child, held_out, found.fit, own, found.warnings))

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
        self._problems.pop(len(self._versions), None)
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
        question = between(
            [[_effect(each) for each in rivals]], (), np.random.default_rng(conditions.seed)
        )
        earlier = [as_experiment(self.model, each) for each in self.sessions]
        return plan(self.model, question, conditions, earlier, self._watched())

    def _became(self, version: Version) -> Version:
        self._versions.append(version)
        return version

    def _known(self, number: int = -1) -> ErrorModel:
        """Return a version's model without what fits to these recordings found of its base."""
        last = range(len(self._versions))[number]
        model = self._versions[last].model
        fitted = any(each.fit is not None for each in self._versions[: last + 1])
        return unfitted(model) if fitted else model

    def _problem(self, number: int = -1) -> WristProblem:
        """Return the problem of a version, fitted once."""
        key = range(len(self._versions))[number]
        if key not in self._problems:
            known, fit = self._known(key), self._versions[key].fit
            if fit is None:
                units = tuple(as_units(known, each) for each in self.sessions)
            else:
                units = fit.problem.sessions
            self._problems[key] = WristProblem(known, units)
        return self._problems[key]

    def _watched(self) -> Progress:
        """Return the progress, which ends what is being done once that was cancelled."""
        self._stop.clear()

        def told(done: int, total: int) -> None:
            self._check()
            self._progress(done, total)

        return told

    def _watched_words(self) -> Callable[[str], None]:
        self._stop.clear()

        def told(text: str) -> None:
            self._check()
            self._tell(text)

        return told

    def _check(self) -> None:
        if self._stop.is_set():
            raise Cancelled("cancelled")


def _effect(candidate: str | Effect) -> Effect:
    if isinstance(candidate, Effect):
        return candidate
    law, _, place = candidate.rpartition("@")
    if not law or not place:
        raise InputError(f"effect {candidate!r}: write law@component, such as backlash@motor_2")
    return Effect(find_law(law), place)
