"""From a command and its load to what is added to it: search, hysteresis, guards and slew.

Where the model remembers nothing, a block of commands is one compiled loop, and a live command is a
block of one: so live nodes and replay agree to the bit.  For other models, and to say why a command
cannot be corrected, `Corrector.searched` does the same in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wrist_stiffness.compensation.correction import (
    ANSWERS,
    MAX_ITERATIONS,
    TOLERANCE,
    UNCHECKED,
    Correction,
    as_applied,
    correct,
)
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.objective import DEPENDENT, OBJECTIVES, Objective
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.safety import (
    LONGEST_STEP_S,
    SafetySettings,
    between,
    guard_weight,
    within_joint_limits,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.mechanism.compiled import (
    NEVER_NS,
    CompiledCommands,
    CompiledSupervisor,
    CompiledWrist,
    CorrectedRows,
    CorrectorState,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel, Load


class Corrected(NamedTuple):
    """What is added to one command (2,) [rad], its correction as applied, or why there is none."""

    delta: Array
    correction: Correction | None
    fault: WristError | None
    load: Load | None  # that is corrected for


class Corrector:
    """What one stream of commands remembers of its corrections.

    What is applied begins at zero, so that enabling is a ramp, and moves towards what is wanted at
    the slew limit.
    """

    def __init__(self) -> None:
        self.applied = np.zeros(2)  # (2,), what was added to the last command [rad]
        self.stamp_ns = np.array([NEVER_NS])  # (1,), its stamp [ns]
        self.held = np.zeros(2)  # (2,), the correction that was found last [rad]
        self._settings_of: tuple[StreamSettings, ErrorModel] | None = None
        self._task = self._safety = np.zeros(0)

    def release(self) -> None:
        """Search the next correction from nothing."""
        self.held[:] = 0.0

    def reset(self) -> None:
        """Begin at zero again."""
        self.release()
        self.applied[:] = 0.0

    def fade(self, seconds: float, settings: SafetySettings) -> None:
        """Move towards zero for a time [s] in which no command came."""
        reach = settings.slew * seconds
        self.applied -= between(self.applied, -reach, reach)

    def compiled_settings(self, model: ErrorModel, settings: StreamSettings) -> tuple[Array, Array]:
        """Return what the compiled search and the compiled guards must know."""
        if self._settings_of is None or not (
            self._settings_of[0] is settings and self._settings_of[1] is model
        ):
            own = objective_of(model, settings)
            search = TOLERANCE, UNCHECKED, ANSWERS, DEPENDENT, MAX_ITERATIONS
            vector = own.tool_point if own.name == "tool_point" else own.normal
            limits = play_of(model, settings), settings.correction_limit
            self._task = np.array([*search, OBJECTIVES.index(own.name), *vector, *limits])
            self._safety = settings.safety.compiled(model.table.geometry.limits)
            self._settings_of = settings, model
        return self._task, self._safety

    def correct(
        self,
        running: RunningModel,
        compiled: CompiledWrist,
        settings: StreamSettings,
        commands: CompiledCommands,
        found: CorrectedRows,
        supervisor: CompiledSupervisor | None = None,
        begin: int = 0,
    ) -> int:
        """Judge and correct commands from a place on; return the first that this cannot serve."""
        task, safety = self.compiled_settings(running.model, settings)
        state = CorrectorState(self.held, running.contact, self.applied, self.stamp_ns)
        return compiled.correct(task, safety, commands, state, found, supervisor, begin)

    def searched(
        self,
        running: RunningModel,
        settings: StreamSettings,
        stamp_ns: int,
        theta: Array,
        theta_dot: Array | None,
        load: Load | None,
        share: Callable[[list[float]], float],
    ) -> Corrected:
        """Correct one command in Python.

        `stamp_ns`: of the command [ns].  `theta` (2,): commanded motor angles [rad].  `theta_dot`
        (2,): their speeds [rad/s].  `load`: to correct for; None where there shall be no
        correction, and what is applied fades out.  `share`: which part of a correction is applied,
        by the platform's turn (3,) [rad].
        """
        found: Correction | None = None
        fault: WristError | None = None
        held, wanted = self.held.copy(), np.zeros(2)
        self.release()
        if load is not None:
            try:
                play = play_of(running.model, settings)
                found = search(running, settings, stamp_ns, load, theta, theta_dot, held, play)
                self.held[:] = found.delta
                turn = turned(found.jacobian.ravel().tolist(), found.delta.tolist())
                wanted = share(turn) * faded(running, settings, found)
            except WristError as error:
                fault = error
        last_ns, self.stamp_ns[0] = int(self.stamp_ns[0]), stamp_ns
        passed_ns = 0 if last_ns == NEVER_NS else max(stamp_ns - last_ns, 0)
        reach = settings.safety.slew * min(passed_ns / NANOSECONDS, LONGEST_STEP_S)
        near = self.applied + between(wanted - self.applied, -reach, reach)
        limits = running.model.table.geometry.limits
        self.applied[:] = within_joint_limits(theta, near, limits) - theta
        delta = self.applied.copy()
        applied = None if found is None else as_applied(found, delta)
        return Corrected(delta, applied, fault, load)


def turned(jacobian: list[float], delta: list[float]) -> list[float]:
    """Return how a correction (2,) [rad] turns the platform by its Jacobian (3, 2), row by row."""
    (a, b, c, d, e, f), (x, y) = jacobian, delta
    # Not `dot`, which rounds otherwise from one processor to another.
    return [a * x + b * y, c * x + d * y, e * x + f * y]


def search(
    running: RunningModel,
    settings: StreamSettings,
    stamp_ns: int,
    load: Load,
    theta: Array,
    theta_dot: Array | None,
    held: Array | None = None,
    play: float = 0.0,
) -> Correction:
    """Return the correction that meets the objective; refused beyond the limit.

    Raises `WristError` if there is none, or it is too large.
    """
    predict = running.preview(stamp_ns, load, theta_dot)
    objective = objective_of(running.model, settings)
    workspace = running.model.table.workspace
    correction = correct(predict, workspace, theta, objective, held, play)
    largest = max(map(abs, correction.delta.tolist()))
    if largest > settings.correction_limit:
        raise InputError(
            f"correction of {np.degrees(largest):.4f} deg is larger than the limit "
            f"{np.degrees(settings.correction_limit):g} deg"
        )
    return correction


def faded(running: RunningModel, settings: StreamSettings, correction: Correction) -> Array:
    """Return a correction as the guards let it through, (2,) [rad]."""
    at = correction.prediction.configuration
    weight = guard_weight(running.model.table.workspace, at, settings.safety)
    return weight * correction.delta


def objective_of(model: ErrorModel, settings: StreamSettings) -> Objective:
    """Return what the motors shall make right."""
    platform = model.table.geometry.platform
    return Objective(settings.objective, platform.normal, platform.tool_point)


def play_of(model: ErrorModel, settings: StreamSettings) -> float:
    """Return what a motor may leave before its correction moves [rad]."""
    return settings.safety.deadband_steps * model.table.geometry.limits.encoder_step
