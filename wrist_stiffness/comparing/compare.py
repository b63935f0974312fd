"""Compare models with measured sessions: the whole way from sessions to sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from wrist_stiffness.comparing.comparison import ComparedModel, Comparison
from wrist_stiffness.comparing.explained import Explained, explain
from wrist_stiffness.comparing.set_up import without_set_up
from wrist_stiffness.comparing.wiring import (
    LOAD_MISTAKES,
    MISTAKES,
    Mistake,
    Suspicion,
    load_too_large,
    suspected,
    told_mistake,
)
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.base_fit import unexplained_units, without_units
from wrist_stiffness.identification.calibration import Calibration, calibrate, said_calibrated
from wrist_stiffness.identification.free_effects import answering_as
from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.noise import FEWEST_REPEATS, replicate_variance
from wrist_stiffness.inference.observations import Mask
from wrist_stiffness.inference.outliers import FEWEST_UNITS, OUTLIER_LIMIT
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.numerals import number
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.observing import Observed, side_by_side
from wrist_stiffness.sessions.refitted import ANSWERS_LOAD
from wrist_stiffness.sessions.unit_session import UnitSession, all_units

VERY_STRONG = 5.0
"""Gain of log evidence from which a load is told to be wrong (Kass and Raftery 1995, section 3.2).
"""


def compare_models(
    models: Sequence[tuple[str, ErrorModel]],
    sessions: Sequence[MeasuredSession],
    progress: Progress = silent,
) -> Comparison:
    """Say how far models are off from measured sessions, where and under which condition.

    `models`: name of each for the report, and the model; `sessions`: in the order of time.  Raises
    `InputError` if there is too little to compare, or the models are not of one wrist.
    """
    steps = len(models) + 1
    progress(0, steps)
    first = models[0][1]
    cuts = all_units(first, sessions)
    calibrated = said_calibrated(sessions)
    for name, model in models:
        if not _same_wrist(model, first):
            raise InputError(
                f"model {name} is of another wrist than {models[0][0]}: its axes differ"
            )
    lost = _lost_by_all([model for _, model in models], cuts, calibrated)
    cuts = without_units(cuts, lost)
    compared = []
    for name, model in models:
        observed, left, absorbed = _prepared(model, sessions, cuts, calibrated)
        compared.append(ComparedModel(name, observed.observations, left, absorbed))
        progress(len(compared), steps)
    suspicion = suspected(model, observed, calibrated, left)
    progress(steps, steps)
    table = compared[0].refitted
    return Comparison(
        tuple(each.name for each in cuts),
        tuple(compared),
        repeatability(table),
        repeatability(by_side(table)),
        load_too_large(model, sessions) or told_mistake(suspicion),
        int(lost.sum()),
    )


def _lost_by_all(
    models: Sequence[ErrorModel], cuts: tuple[UnitSession, ...], calibrated: Sequence[str]
) -> Mask:
    """Return which measured units (u,) no model, set-up and smooth law explains: lost beams.

    What only some of the models leave far off is their error.
    """
    noise = [np.broadcast_to(np.nan_to_num(each.white), each.values.shape) for each in cuts]
    used = np.concatenate([each.measured for each in cuts])
    lost = np.ones(int(used.sum()), dtype=bool)
    for model in models:
        _, left, set_ups = without_set_up(model, cuts, calibrated)
        if left.n_units != len(lost) or len(lost) < FEWEST_UNITS:
            return np.zeros(len(lost), dtype=bool)
        columns = side_by_side([each.columns for each in set_ups])[used]
        lost &= unexplained_units(left, columns)
        # Exact data scatter by rounding: what is lost is far beyond the noise as well.
        limit = OUTLIER_LIMIT * np.concatenate(noise)[used]
        lost &= (np.abs(np.nan_to_num(left.values)) > limit).any(axis=1)
    return lost


def suspicion_in(
    model: ErrorModel, sessions: Sequence[MeasuredSession], mistakes: Sequence[Mistake] = MISTAKES
) -> Suspicion | None:
    """Return the mistake of signs, units or names that explains most of an error; None for none.

    Raises `InputError` if there is too little to compare.
    """
    cuts = all_units(model, sessions)
    calibrated = said_calibrated(sessions)
    observed, left, _ = _prepared(model, sessions, cuts, calibrated)
    return suspected(model, observed, calibrated, left, mistakes)


def _prepared(
    model: ErrorModel,
    sessions: Sequence[MeasuredSession],
    cuts: tuple[UnitSession, ...],
    calibrated: Sequence[str],
) -> tuple[Observed, Explained, tuple[TakenUp, ...]]:
    """Return what a model leaves, what the set-up leaves of that, and where this stands."""
    observed, refitted, set_ups = without_set_up(model, cuts, calibrated)
    if refitted.n_units < FEWEST_UNITS:
        names = ", ".join(session.name for session in sessions)
        # A recording that was cut short says so itself.
        why = "".join(f"; {remark}" for session in sessions for remark in session.remarks)
        raise InputError(
            f"{names}: {refitted.n_units} dwells and moments are too few to compare with, it needs "
            f"{FEWEST_UNITS}{why}"
        )
    used = np.concatenate([each.measured for each in cuts])
    columns = side_by_side([each.columns for each in set_ups])[used]
    z = np.concatenate([each.moved for each in set_ups])
    weights = np.concatenate([each.weights for each in set_ups])[used]
    left = explain(refitted, cuts, columns, z, weights)
    table, own = observed.observations, np.split(columns, len(set_ups), axis=2)
    taken = (each.taken_up(table, part) for each, part in zip(set_ups, own, strict=True))
    return observed, left, tuple(chain.from_iterable(taken))


def _same_wrist(one: ErrorModel, other: ErrorModel) -> bool:
    """Tell whether the rigid wrists are the same; parts may differ, they are what is compared."""
    first, second = one.table.geometry, other.table.geometry
    return all(np.array_equal(first.axes[joint], second.axes[joint]) for joint in first.axes)


def wrong_load(
    model: ErrorModel,
    fitted: ErrorModel,
    sessions: Sequence[MeasuredSession],
    found: Calibration | None = None,
    progress: Progress = silent,
) -> str:
    """Return the mistake of a load that a fit hides, in a sentence; empty for none.

    A fit takes such a load up in parts as stiff or as soft as can be, in the sensor's scale and
    tare, and in axes off their drawing.  Beside all these a load that is put right explains only
    part of what is left.  So where it explains some, the wrist is fitted anew under that load.

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
        f"{q.told(after.after[q.key])}, not {number(before.after[q.key])},"
        for q in before.fit.problem.table.reported
    )
    return suspicion.told(f"a fit leaves {left} and parts nearer to their drawing")


def doubts_load(found: Calibration) -> bool:
    """Tell whether the wrist answers loads so unusually that these may be wrong."""
    answering = (p for p in found.parameters if p.effect.partition("@")[0] in ANSWERS_LOAD)
    return any(each.far or each.at_bound for each in answering)


def _gain(before: Calibration, after: Calibration) -> float:
    """Return the gain of log evidence; under another load other units may lie in the range."""
    found = [each.fit.evidence for each in (before, after)]
    counts = [len(each.point.left) for each in found]
    first, second = (each.log / count for each, count in zip(found, counts, strict=True))
    return (second - first) * min(counts)


def by_side(observations: Observations) -> Observations:
    """Return the table with replicates only of dwells that both motors approached alike."""
    if observations.replicate is None:
        return observations
    sides = [np.sign(observations.covariate(f"approach_{motor}")) for motor in (1, 2)]
    keys = np.column_stack([observations.replicate, *sides])
    _, label = np.unique(keys, axis=0, return_inverse=True)
    return replace(observations, replicate=np.where(observations.replicate >= 0, label, -1))


def repeatability(observations: Observations) -> dict[str, float]:
    """Scatter (RMS) of repeated dwells by the key of the quantity; empty with too few."""
    values = np.where(observations.measured, observations.values, 0.0)
    variance, freedom = replicate_variance(values, np.empty((*values.shape, 0)), observations)
    if freedom < FEWEST_REPEATS:
        return {}
    return observations.rms(np.broadcast_to(variance, values.shape))
