"""Correct commanded motor angles for the predicted error, as far as two motors can."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign
from typing import NamedTuple

import numpy as np

from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.compiled import CorrectedRows
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.mechanism.workspace import Workspace
from wrist_stiffness.model.error_model import ErrorModel, Load, Prediction

TOLERANCE = 1e-10
"""The search ends where the angles are known to this [rad]; 1e-6 of an encoder step."""

MAX_ITERATIONS = 40

UNCHECKED = 0.05
"""A step up to this share of the play is not tried: even if nothing answers, no more is left than
the play and it, and the next command finds it."""

ANSWERS = 0.5
"""A motor whose error changes by less than this share of its step is crossing a lost motion."""


class Correction(NamedTuple):
    """Corrected motor angles and what remains."""

    delta: Array  # (2,), to be added to the command [rad]
    # (6,), residual twist with the correction, actual minus desired, at O in F [m, rad]
    after: Array
    prediction: Prediction  # at the corrected angles, or so near to them that the twist is the same
    jacobian: Array  # (3, 2), of the platform's angular velocity, at the command


def correct(
    predict: Callable[[Array], Prediction],
    workspace: Workspace,
    command: Array,
    objective: Objective,
    held: Array | None = None,
    play: float = 0.0,
) -> Correction:
    """Find the angles at which the predicted pose meets the objective of the commanded one.

    The error depends on the corrected angles, so this is a fixed point: task(T_pred(theta + delta)
    FK(theta + delta)) = task(FK(theta)), stepped by the pseudo-inverse of the task's Jacobian.

    The hysteresis is one of the error: a motor moves when it would otherwise leave more than
    `play`.  For most effects that is the same as a hysteresis of the correction; but the error of a
    motor with backlash at its reversal grows from nothing, while the correction must jump.

    `predict`: the pose error at motor angles (2,) [rad], under the load of the moment; a load in F
    stays fixed while the angles are iterated, one in U turns with them.  `workspace`: the rigid
    wrist and the table's domain.  `command` (2,): commanded motor angles [rad].  `held` (2,): the
    correction so far; zero if None [rad].  `play`: what a motor may leave before its correction
    moves [rad].  Raises `UnreachablePoseError`, `SingularPoseError` or `LoadRangeError` if the
    command or the corrected angles are outside the table's domain or load range; `InputError` if
    the fixed point is not reached.
    """
    desired = workspace.configuration(command)
    jacobian = workspace.mechanism.jacobian(desired)
    cancelling = objective.cancelling(desired, jacobian)

    def at(delta: Array) -> Correction:
        prediction = predict(command + delta)
        after = residual_twist(prediction, desired.platform)
        return Correction(delta, after, prediction, jacobian)

    reached = at(np.zeros(2) if held is None else held)
    size = np.inf
    steps, missing = [0.0, 0.0], [0.0, 0.0]
    for _ in range(MAX_ITERATIONS):
        last_missing, missing = missing, cancelling.dot(reached.after).tolist()
        steps = list(map(_step, missing, last_missing, steps, (play, play)))
        last, size = size, max(map(abs, steps))
        if size < TOLERANCE:
            return reached
        # The steps shrink by a constant factor, so the last two of them bound what is missing.
        shrinking = size < last < np.inf and size**2 < TOLERANCE * (last - size)
        if shrinking or size < UNCHECKED * play:
            return as_applied(reached, reached.delta + steps)
        reached = at(reached.delta + steps)
    raise InputError(
        f"correction: no fixed point after {MAX_ITERATIONS} steps, last step "
        f"{np.degrees(size):.2e} deg"
    )


def _step(missing: float, last_missing: float, last_step: float, play: float) -> float:
    """Return by how much a motor should go on, given what is missing before and after a step [rad].

    Inside a lost motion the error does not answer: there the steps grow until it does.
    """
    beyond = missing - min(max(missing, -play), play)
    if beyond and abs(missing - last_missing) < ANSWERS * abs(last_step):
        return -copysign(max(abs(missing), 2.0 * abs(last_step)), missing)
    return -beyond


def correction_of(found: CorrectedRows, place: int, model: ErrorModel, load: Load) -> Correction:
    """Return one of n compiled corrections, under its load."""
    row = found.rows[place]
    prediction = model.prediction_of(row[8:14], row[20:], found.active[place], load)
    return Correction(row[:2], row[2:8], prediction, row[14:20].reshape(3, 2))


def as_applied(correction: Correction, delta: Array) -> Correction:
    """Return what a correction leaves where only another one near it is applied.

    `delta` (2,): what is applied instead [rad].  Gives `Correction`: with the residual moved by the
    rigid Jacobian; the error's own change between the two poses is smaller than that by the ratio
    of error to pose, 1e-3.
    """
    if delta.tolist() == correction.delta.tolist():
        return correction
    after = correction.after.copy()
    after[3:] += correction.jacobian.dot(delta - correction.delta)
    return Correction(delta, after, correction.prediction, correction.jacobian)


def residual_twist(prediction: Prediction, desired: Array) -> Array:
    """Return log(T_err T_nominal T_desired^-1), actual minus desired.

    `prediction`: predicted error at the angles that are driven; `desired` (3, 3): desired rotation
    U -> F of the platform, its point at O resting at O.  Gives (6,): twist at O in F [m, rad].
    """
    rotation, shift = prediction.motion
    return log_motion(rotation.dot(prediction.configuration.platform).dot(desired.T), shift)
