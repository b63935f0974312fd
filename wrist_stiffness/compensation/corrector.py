"""From a command and its load to what is added to it: search, hysteresis, guards and slew.

Where the model remembers nothing, a block of commands is one compiled loop, and a live command is a
block of one: so live nodes and replay agree to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wrist_stiffness.compensation.correction import (
    Correction,
    as_applied,
    compiled_task,
    correct,
    correction_of,
)
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.safety import AppliedCorrection, guard_weight
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.mechanism.compiled import (
    CompiledCommands,
    CompiledSupervisor,
    CompiledWrist,
    CorrectedRows,
    CorrectorState,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel, Load

WANTED = np.ones(1, dtype=bool)

Share = Callable[[list[float]], float] | float
"""Which part of a correction is applied, or a function of the platform's turn (3,) [rad]."""


class Corrected(NamedTuple):
    """What is added to one command (2,) [rad], its correction as applied, or why there is none."""

    delta: Array
    correction: Correction | None
    fault: WristError | None


class Corrector:
    """What one stream of commands remembers of its corrections."""

    def __init__(self) -> None:
        self.applied = AppliedCorrection()  # what is added to the commands
        self.held = np.zeros(2)  # (2,), the correction that was found last [rad]
        self._settings_of: tuple[StreamSettings, ErrorModel] | None = None
        self._task = self._safety = np.zeros(0)
        self._one: Correcting | None = None

    def release(self) -> None:
        """Search the next correction from nothing."""
        self.held[:] = 0.0

    def reset(self) -> None:
        """Begin at zero again."""
        self.release()
        self.applied.reset()

    def command(
        self,
        running: RunningModel,
        settings: StreamSettings,
        stamp_ns: int,
        theta: Array,
        theta_dot: Array | None,
        load: Load | None,
        share: Share,
    ) -> Corrected:
        """Correct one command.

        `stamp_ns`: of the command [ns].  `theta` (2,): commanded motor angles [rad].  `theta_dot`
        (2,): their speeds [rad/s].  `load`: to correct for; None where there shall be no
        correction, and what is applied fades out.  `share`: which part of a correction is applied,
        by the platform's turn (3,) [rad].
        """
        compiled = running.compiled
        if load is not None and compiled is not None:
            block = self._one
            if block is None or not block.is_of(running, settings):
                own = np.zeros(1, np.int64), np.zeros(2), np.zeros(6), np.zeros(1, bool)
                commands = CompiledCommands(*own, WANTED, np.ones(1))
                block = self._one = Correcting(self, running, compiled, settings, commands)
            if block.only_one(stamp_ns, theta, load, share):
                applied = correction_of(block.found, 0, running.model, load)
                return Corrected(applied.delta, applied, None)
        return self.searched(running, settings, stamp_ns, theta, theta_dot, load, share)

    def compiled_settings(self, model: ErrorModel, settings: StreamSettings) -> tuple[Array, Array]:
        """Return what the compiled search and the compiled guards must know."""
        if self._settings_of is None or not (
            self._settings_of[0] is settings and self._settings_of[1] is model
        ):
            task = compiled_task(objective_of(model, settings), play_of(model, settings))
            self._task = np.append(task, settings.correction_limit)
            self._safety = settings.safety.compiled(model.table.geometry.limits)
            self._settings_of = settings, model
        return self._task, self._safety

    def searched(
        self,
        running: RunningModel,
        settings: StreamSettings,
        stamp_ns: int,
        theta: Array,
        theta_dot: Array | None,
        load: Load | None,
        share: Share,
    ) -> Corrected:
        """Do the same in Python: for models with a memory, and to say what is wrong."""
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
                wanted = (share(turn) if callable(share) else share) * faded(
                    running, settings, found
                )
            except WristError as error:
                fault = error
        limits = running.model.table.geometry.limits
        delta = self.applied.advance(stamp_ns, theta, wanted, limits, settings.safety)
        return Corrected(delta, None if found is None else as_applied(found, delta), fault)


class Correcting:
    """A block of commands of a model that remembers nothing, on its way through a corrector.

    `corrector`: goes on from the command before; `running`: predicts; `compiled`: its compiled
    formulas; `settings`: objective and limits; `commands`: n of them.
    """

    def __init__(
        self,
        corrector: Corrector,
        running: RunningModel,
        compiled: CompiledWrist,
        settings: StreamSettings,
        commands: CompiledCommands,
    ) -> None:
        self._corrector = corrector
        self._running = running
        self._compiled = compiled
        self._settings = settings
        self._task, self._safety = corrector.compiled_settings(running.model, settings)
        self.commands = commands
        self.found = CorrectedRows.room(len(commands.wanted), compiled.sectors)  # the corrections
        self.faults: dict[int, WristError] = {}  # why a command has no correction, by its place
        applied = corrector.applied
        self._state = CorrectorState(
            corrector.held, running.contact, applied.value, applied.stamp_ns
        )

    def correct(self, begin: int, supervisor: CompiledSupervisor | None = None) -> int:
        """Judge and correct commands from a place on; return the first that this cannot serve."""
        return self._compiled.correct(
            self._task, self._safety, self.commands, self._state, self.found, supervisor, begin
        )

    def correct_in_python(self, place: int, load: Load | None, share: Share) -> None:
        """Correct one command, for a load or none, and say why it cannot be."""
        one = self._corrector.searched(
            self._running,
            self._settings,
            int(self.commands.stamp_ns[place]),
            self.commands.theta[place],
            None,
            load,
            share,
        )
        self.found.applied[place] = one.delta
        if one.fault is not None:
            self.faults[place] = one.fault
        elif one.correction is not None:
            at = one.correction.prediction
            self.found.put(place, one.correction.after, at.twist, at.configuration)

    def is_of(self, running: RunningModel, settings: StreamSettings) -> bool:
        """Tell whether this goes by a model and settings."""
        return self._running is running and self._settings is settings

    def only_one(self, stamp_ns: int, theta: Array, load: Load, share: Share) -> bool:
        """Correct one command as the only one; tell whether the compiled formulas serve.

        What was found for the one before stays its own.
        """
        own, state = self.commands, self._state
        own.stamp_ns[0], own.on_platform[0] = stamp_ns, load.on_platform
        own.theta[:], own.load[:] = theta, load.wrench
        found = self.found = CorrectedRows.room(1, self._compiled.sectors)
        if not callable(share):
            own.share[0] = share
            return self._compiled.correct(self._task, self._safety, own, state, found) > 0
        if not self._compiled.correct(self._task, None, own, state, found):
            return False
        row = found.rows[0].tolist()
        own.share[0] = share(turned(row[14:20], row[:2]))
        self._compiled.correct(None, self._safety, own, state, found)
        return True


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
