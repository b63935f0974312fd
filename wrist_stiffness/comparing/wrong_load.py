"""A load of wrong sign, unit or frame, on a wrist that was fitted under it.

A fit takes such a load up in parts as stiff or as soft as can be, in the sensor's scale and tare,
and in axes off their drawing.  Beside all these a load that is put right explains only part of what
is left.  So where it explains some, the wrist is fitted anew under the load put right.
"""

from __future__ import annotations

from collections.abc import Sequence

from wrist_stiffness.comparing.compare import suspicion_in
from wrist_stiffness.comparing.wiring import LOAD_MISTAKES
from wrist_stiffness.identification.calibration import Calibration, calibrate
from wrist_stiffness.identification.free_effects import answering_as
from wrist_stiffness.identification.result import FittedParameter
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.refitted import ANSWERS_LOAD

VERY_STRONG = 5.0
"""Gain of log evidence from which a load is told to be wrong (Kass and Raftery 1995, section 3.2).
"""


def wrong_load(
    model: ErrorModel,
    fitted: ErrorModel,
    sessions: Sequence[MeasuredSession],
    found: Calibration | None = None,
    progress: Progress = silent,
) -> str:
    """Return the mistake that a fit hides, in a sentence for a technician; empty for none.

    `model`, `fitted`: before and after the fit; `found`: the fit, if it was one, else it is made.
    Raises `InputError` if there is too little to compare.
    """
    suspicion = suspicion_in(answering_as(model, fitted), sessions, LOAD_MISTAKES)
    if suspicion is None:
        return ""
    before = found or calibrate(model, sessions)
    right = tuple(suspicion.mistake.measured_right(session) for session in sessions)
    after = calibrate(model, right, progress)
    if _gain(before, after) < VERY_STRONG:
        return ""
    left = " and ".join(
        f"{after.after[q.key]:.3g} {q.unit} of {q.name}, not {before.after[q.key]:.3g},"
        for q in before.fit.problem.table.reported
    )
    return suspicion.told(f"a fit leaves {left} and parts nearer to their drawing")


def answers_load(parameter: FittedParameter) -> bool:
    """Tell whether a parameter says how much a load does."""
    return parameter.effect.partition("@")[0] in ANSWERS_LOAD


def doubts_load(found: Calibration) -> bool:
    """Tell whether the wrist answers loads so unusually that these may be wrong."""
    return any(each.far or each.at_bound for each in found.parameters if answers_load(each))


def _gain(before: Calibration, after: Calibration) -> float:
    """Return the gain of log evidence; under another load other units may lie in the range."""
    found = [each.fit.fit.evidence for each in (before, after)]
    counts = [len(each.point.left) for each in found]
    first, second = (each.log / count for each, count in zip(found, counts, strict=True))
    return (second - first) * min(counts)
