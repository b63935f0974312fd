"""Commissioning: registrations, zeros, tare, and the tolerances of one wrist, from recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.base_fit import BaseFit, best_valley, fit_cleaned
from wrist_stiffness.identification.free_effects import commissioning, unfitted
from wrist_stiffness.identification.held_out import MUCH, Judge
from wrist_stiffness.identification.likelihood import likelihood_of
from wrist_stiffness.identification.problem import FitProblem, require_units
from wrist_stiffness.identification.result import FittedParameter
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.inference.held_out import refuted
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.numerals import number
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import all_units

NEGLIGIBLE = 0.01
"""Of a prior's standard deviation: a smaller move of a parameter that the data do not tell is none.
"""

STEPS = 3
"""That are told of."""

CALIBRATED = "calibrated"
"""Key of the recording's notes that lists ids of effects which need no fit."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A model fitted to a wrist as it was set up last."""

    fit: WristFit  # to all recordings
    # error of the model as it stood and of a calibrated one on the units that judge, RMS by the key
    # of the quantity
    before: Mapping[str, float]
    after: Mapping[str, float]
    judged_by: str  # see `judge`
    calibrated: tuple[str, ...]  # ids of effects that the recordings say need no fit
    # error of what was found of the wrist, where it made those units worse and only the set-up is
    # handed over; else empty
    refused: Mapping[str, float]

    @cached_property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted."""
        return self.fit.parameters

    @property
    def warnings(self) -> tuple[str, ...]:
        """That what was found of the wrist is not handed over, and why."""
        if not self.refused:
            return ()
        worse = " and ".join(
            f"{number(self.refused[q.key])} instead of {q.told(self.after[q.key])}"
            for q in self.fit.problem.table.reported
            if self.refused.get(q.key, 0.0) > self.after.get(q.key, 0.0)
        )
        why = (
            "An effect is missing ('wrist-stiffness diagnose' finds out which), or it is not the "
            "same wrist."
        )
        if all(error <= MUCH * self.fit.noise[key] for key, error in self.refused.items()):
            why = "Both are about noise and drift: longer recordings would tell more."
        return (
            "only the set-up was fitted. With what these recordings say of the wrist, the part "
            f"that judges comes out worse: {worse}. {why}",
        )

    @cached_property
    def model(self) -> ErrorModel:
        """The model of the newest session; effects of which the data say nothing are left out."""
        return told_model(self.fit)


def calibrate(
    model: ErrorModel,
    sessions: Sequence[MeasuredSession],
    progress: Progress = silent,
    again: bool = False,
) -> Calibration:
    """Fit what differs from session to session and from wrist to wrist.

    Parameters
    ----------
    model : ErrorModel
        Its effects are starts of what is fitted, or stay as they are.
    sessions : sequence of MeasuredSession
        In the order of time.  Of several the last one judges what the others tell, of one its end;
        what is handed over is fitted to all.  What makes that part worse is not: then the wrist
        stays as the model has it.
    progress : callable
        Told steps done and steps at most.
    again : bool
        Whether the model was fitted to one of these sessions before: then what it found is no
        knowledge to begin with.

    Returns
    -------
    Calibration
        Fit to all sessions, judged.

    Raises
    ------
    InputError
        If too little is measured, or nothing is free.
    """
    calibrated = said_calibrated(sessions)
    start = unfitted(model) if again else model
    free, held = commissioning(start, calibrated)
    if not free:
        raise InputError(
            f"nothing is left to calibrate: the notes of the recordings say under {CALIBRATED!r} "
            f"that {', '.join(calibrated)} need no fit"
        )
    units = all_units(model, sessions)
    problem = FitProblem(start.with_effects(*held), units, free)
    require_units(problem)
    progress(0, STEPS)
    first, lost = fit_cleaned(problem, best_valley(problem).z)
    progress(1, STEPS)
    judge, set_up = Judge(first), _set_up_of(first.problem, start)
    after, without = (
        judge.left(fit_cleaned(replace(own, sessions=judge.seen), z)[0])
        for own, z in ((problem, first.z), (set_up, None))
    )
    reported, refused = first.problem.table.reported, {}
    if refuted(without, after):
        refused, after = after.rms(reported), without
        first = fit_cleaned(set_up)[0]
    progress(2, STEPS)
    found = fitted(first, lost)
    before = judge.of_model(model)
    progress(STEPS, STEPS)
    return Calibration(
        found,
        before.rms(reported),
        after.rms(reported),
        judge.by,
        calibrated,
        refused,
    )


def _set_up_of(problem: FitProblem, model: ErrorModel) -> FitProblem:
    """Return the problem of the set-up of each session, beside the wrist as a model has it."""
    free = tuple(each for each in problem.free if each.per_session)
    fitted = {each.effect.name for each in free}
    wrist = (each for each in model.effects if each.name not in fitted)
    return replace(problem, model=model.with_effects(*wrist), free=free)


def fitted(base: BaseFit, lost: int) -> WristFit:
    """Return what is known after a fit without effects beside it."""
    return WristFit(base, likelihood_of(base, lost)).settled()


def said_calibrated(sessions: Sequence[MeasuredSession]) -> tuple[str, ...]:
    """Return the ids of effects that every recording says were calibrated otherwise.

    Raises `InputError` if a note is no list of names.
    """
    said = []
    for session in sessions:
        names = session.notes.get(CALIBRATED, [])
        if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
            raise InputError(f"{session.name}: note {CALIBRATED!r} is {names!r}, no list of names")
        said.append(set(names))
    return tuple(sorted(set.intersection(*said))) if said else ()


def told_model(found: WristFit, keep: Sequence[str] = ()) -> ErrorModel:
    """Return a fitted model as it is written, of the newest session.

    An effect of which the data say nothing is left out where it stayed at nothing, unless it is
    among those to keep.
    """
    problem = found.problem
    newest = problem.sessions[-1].name
    told = {
        parameter.effect
        for parameter in found.parameters
        if parameter.session in (None, newest)
        and (parameter.excited or abs(parameter.moved) > NEGLIGIBLE)
    }
    effects = list(problem.model.effects)
    for free, fitted in zip(problem.free, found.effects(), strict=True):
        plain = Effect(free.effect.law, free.effect.component)
        if fitted.name in (*told, *keep) or free.effect.si != plain.si:
            effects.append(fitted)
    names = {effect.name for effect in effects}
    joint = found.joint
    kept = tuple(name for name in joint.effects if name in names)
    model = problem.model.with_effects(*effects)
    return replace(model, joint=replace(joint, effects=kept))
