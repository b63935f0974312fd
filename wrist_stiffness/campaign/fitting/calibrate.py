"""Commissioning: registrations, zeros, tare, and the tolerances of one wrist, from recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wrist_stiffness.campaign.fitting.fit import fit, start_of
from wrist_stiffness.campaign.fitting.free_effects import commissioning, unfitted
from wrist_stiffness.campaign.fitting.judge import Judged, judged, judged_by_itself
from wrist_stiffness.campaign.fitting.problem import FitProblem, require_units
from wrist_stiffness.campaign.fitting.result import Fit, FittedParameter
from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.noise_floor import NoiseFloor, noise_floor
from wrist_stiffness.campaign.unit_session import UnitSession, as_units
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.held_out import HeldOut
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.progress import Progress, silent

NEGLIGIBLE = 0.01
"""Of a prior's standard deviation: a smaller move of a parameter that the data do not tell is none.
"""

CALIBRATED = "calibrated"
"""Key of the recording's notes that lists ids of effects which need no fit."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A model fitted to a wrist as it was set up last.

    Parameters
    ----------
    fit : Fit
        To all recordings.
    before : dict of str to float
        Error of the model as it stood on the units that judge, RMS by the key of the quantity.
    judged : Judged
        What is left of those units.
    calibrated : tuple of str
        Ids of effects that the recordings say need no fit.
    """

    fit: Fit
    before: dict[str, float]
    judged: Judged
    calibrated: tuple[str, ...]

    @property
    def after(self) -> dict[str, float]:
        """Error that is left of the units that judge, RMS by the key of the quantity."""
        return self.judged.rms

    @cached_property
    def floor(self) -> NoiseFloor:
        """Scatter of the units that judge."""
        return noise_floor(self.judged.observations)

    @cached_property
    def parameters(self) -> tuple[FittedParameter, ...]:
        """All that was fitted."""
        return self.fit.parameters

    @cached_property
    def model(self) -> ErrorModel:
        """The model of the newest session; effects of which the data say nothing are left out."""
        return told_model(self.fit)


def calibrate(
    model: ErrorModel,
    sessions: Sequence[MeasuredSession],
    hold_out: bool = False,
    progress: Progress = silent,
    again: bool = False,
) -> Calibration:
    """Fit what differs from session to session and from wrist to wrist.

    Parameters
    ----------
    model : ErrorModel
        Its effects are starts of what is fitted, or stay as they are.
    sessions : sequence of MeasuredSession
        In the order of time.
    hold_out : bool
        Whether to judge by units that a first fit has not seen: the last session's, or the last
        fifth of the only one.
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
    units = tuple(as_units(model, session) for session in sessions)
    problem = FitProblem(start.with_effects(*held), units, free)
    require_units(problem)
    if hold_out:
        seen = judged(problem, progress=progress)
        found = fit(problem, start_of(problem, seen.fit.problem, seen.fit.z), progress=progress)
    else:
        found = fit(problem, progress=progress)
        seen = judged_by_itself(found)
    return Calibration(found, as_it_stands(model, units, seen), seen, calibrated)


def said_calibrated(sessions: Sequence[MeasuredSession]) -> tuple[str, ...]:
    """Return the ids of effects that every recording says were calibrated otherwise.

    Raises
    ------
    InputError
        If a note is no list of names.
    """
    said = []
    for session in sessions:
        names = session.notes.get(CALIBRATED, [])
        if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
            raise InputError(f"{session.name}: note {CALIBRATED!r} is {names!r}, no list of names")
        said.append(set(names))
    return tuple(sorted(set.intersection(*said))) if said else ()


def as_it_stands(
    model: ErrorModel, units: tuple[UnitSession, ...], seen: Judged
) -> dict[str, float]:
    """Return the error of a model on the units that judge, RMS by the key of the quantity."""
    problem = FitProblem(model, units, ())
    residual = problem.table.with_values(problem.residual(np.empty(0)))
    rows = np.isin(problem.table.rows, seen.rows)
    values = np.where(seen.observations.measured, residual.values[rows], np.nan)
    left = HeldOut(values, np.empty(0))
    return {q.key: left.rmse(q) for q in seen.observations.reported}


def told_model(found: Fit, keep: Sequence[str] = ()) -> ErrorModel:
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
    return replace(model, joint=JointUncertainty(kept, joint.sigma))
