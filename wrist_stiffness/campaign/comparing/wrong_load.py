"""A load of wrong sign, unit or frame, on a wrist that was fitted under it.

A fit takes such a load up in parts as stiff or as soft as can be, in the sensor's scale and tare,
and in axes off their drawing.  Beside all these a load that is put right explains only part of what
is left.  So where it explains some, the wrist is fitted anew under the load put right.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wrist_stiffness.campaign.comparing.compare import suspicion_in
from wrist_stiffness.campaign.comparing.set_up import INDEPENDENT
from wrist_stiffness.campaign.comparing.wiring import CLEAR, LOAD_MISTAKES
from wrist_stiffness.campaign.fitting.calibrate import Calibration, calibrate
from wrist_stiffness.campaign.fitting.free_effects import answering_as
from wrist_stiffness.campaign.fitting.result import FittedParameter
from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.refitted import ANSWERS_LOAD
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.progress import Progress, silent


def wrong_load(
    model: ErrorModel,
    fitted: ErrorModel,
    sessions: Sequence[MeasuredSession],
    rng: np.random.Generator,
    found: Calibration | None = None,
    hold_out: bool = False,
    progress: Progress = silent,
) -> str:
    """Return the mistake that a fit hides, in a sentence for a technician; empty for none.

    Parameters
    ----------
    model : ErrorModel
        Before the fit.
    fitted : ErrorModel
        After it.
    sessions : sequence of MeasuredSession
        To which it was fitted, in the order of time.
    rng : numpy.random.Generator
        For the noise floor.
    found : Calibration, optional
        The fit, if it was one; else it is made.
    hold_out : bool
        Whether it was judged by a part that it has not seen: then the other one is, too.
    progress : callable, optional
        Told steps of the fit without the mistake, done and at most.

    Raises
    ------
    InputError
        If there is too little to compare.
    """
    suspicion = suspicion_in(answering_as(model, fitted), sessions, rng, LOAD_MISTAKES)
    if suspicion is None:
        return ""
    before = found or calibrate(model, sessions, hold_out)
    right = tuple(suspicion.mistake.measured_right(session) for session in sessions)
    after = calibrate(model, right, hold_out, progress)
    if _cost(after) >= CLEAR * _cost(before):
        return ""
    left = " and ".join(
        f"{after.after[q.key]:.3g} {q.unit} of {q.name}, not {before.after[q.key]:.3g},"
        for q in before.judged.observations.reported
    )
    return suspicion.told(f"a fit leaves {left} and parts nearer to their drawing")


def answers_load(parameter: FittedParameter) -> bool:
    """Tell whether a parameter says how much a load does."""
    return parameter.effect.partition("@")[0] in ANSWERS_LOAD


def doubts_load(found: Calibration) -> bool:
    """Tell whether the wrist answers loads so unusually that these may be wrong."""
    return any(each.far or each.at_bound for each in found.parameters if answers_load(each))


def _cost(found: Calibration) -> float:
    """Return what a fit leaves beyond noise, and how far parts went so that it is no more."""
    floor = found.floor.rms(found.judged.observations)
    over = [found.after[key] / level for key, level in floor.items() if level > 0.0]
    beyond = max(max(over, default=1.0) ** 2 - 1.0, 0.0)
    strain = sum(each.moved**2 for each in found.parameters if answers_load(each))
    return INDEPENDENT * beyond + strain
