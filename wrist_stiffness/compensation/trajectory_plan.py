"""A plan on its way to the motors: every point corrected for what is held at its start."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.compensation.corrector import Corrector, faded, search
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.safety import guard_weight, within_joint_limits
from wrist_stiffness.compensation.scales import Held, Scales
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.trajectory import PlannedPoint, corrected_point, neighbours
from wrist_stiffness.errors import SingularPoseError, UnreachablePoseError
from wrist_stiffness.mechanism.compiled import CompiledCommands, CorrectedRows, CorrectorState
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.model.block import Load

AT_ONCE = 8
"""Points that are corrected in one step: up to 40 searches, in a millisecond."""


@dataclass
class PlanCorrector:
    """Corrects motor angles of one plan, each for itself: neither slewed nor held by hysteresis."""

    running: RunningModel  # a model with its memory at the plan's start
    settings: StreamSettings
    stamp_ns: int  # the plan's start [ns]
    held: Held
    known: bool = True  # whether what is held was known at every pose that was corrected

    def __post_init__(self) -> None:
        """Leave the hysteresis away."""
        safety = replace(self.settings.safety, deadband_steps=0.0)
        self.settings = replace(self.settings, safety=safety)
        self._task, _ = Corrector().compiled_settings(self.running.model, self.settings)
        self._scales = Scales(self.running.model.table.geometry)

    def work(
        self, points: Sequence[PlannedPoint], places: Sequence[int]
    ) -> Generator[None, None, tuple[PlannedPoint, ...]]:
        """Correct points whose motors stand at two places of the joints, some at a step.

        Raises `WristError` if one of them cannot be corrected.
        """
        done: list[PlannedPoint] = []
        for start in range(0, len(points), AT_ONCE):
            some = points[start : start + AT_ONCE]
            around = [neighbours(point, places) for point in some]
            found = iter(self._compiled(np.array([each for group in around for each in group])))
            for point, group in zip(some, around, strict=True):
                speed = point.velocities[list(places)] if len(point.velocities) else None
                own: list[Array] = []
                for theta in group:
                    sent = next(found)
                    if sent is None:
                        sent = self._searched(theta, speed, bool(own))
                        yield
                    own.append(sent)
                done.append(corrected_point(point, places, own))
            if self.running.compiled is not None:
                yield
        return tuple(done)

    def _compiled(self, theta: Array) -> list[Array | None]:
        """Return corrected angles for n planned ones (n, 2), None where the other search must."""
        compiled, n = self.running.compiled, len(theta)
        if compiled is None:
            return [None] * n
        table = self.running.model.table
        at, inside = compiled.forward(theta)
        loads = [self._load(rotation) for rotation in at.platform]
        wrench = np.array([load.wrench for load in loads])
        on_platform = np.array([load.on_platform for load in loads])
        inside &= self._scales.rows_of(table, theta, wrench, on_platform)[1]
        commands = CompiledCommands(
            np.zeros(n, np.int64), theta, wrench, on_platform, inside, np.ones(n)
        )
        found = CorrectedRows.room(n, compiled.sectors)
        for i in np.flatnonzero(inside).tolist():
            # From nothing, so that no point depends on the one before.
            state = CorrectorState(np.zeros(2), self.running.contact, np.zeros(2), np.zeros(1, int))
            end = compiled.correct(self._task, None, commands, state, found, None, i, i + 1)
            inside[i] = end > i
        there = Configuration.of_row(np.ascontiguousarray(found.configuration))
        weight = guard_weight(table.workspace, there, self.settings.safety)
        delta = self.held.share * weight[:, None] * found.applied
        sent = within_joint_limits(theta, delta, table.geometry.limits)
        return [row if known else None for row, known in zip(sent, inside.tolist(), strict=True)]

    def _searched(self, theta: Array, theta_dot: Array | None, beside: bool) -> Array:
        """Return corrected angles for planned ones; beside a point, beyond the border, those."""
        table = self.running.model.table
        try:
            load = self._load(table.workspace.configuration(theta).platform)
            found = search(self.running, self.settings, self.stamp_ns, load, theta, theta_dot)
        except (UnreachablePoseError, SingularPoseError):
            if not beside:
                raise
            return theta
        delta = self.held.share * faded(self.running, self.settings, found)
        return within_joint_limits(theta, delta, table.geometry.limits)

    def _load(self, rotation: Array) -> Load:
        self.known = self.known and self.held.known(rotation)
        return self.held.load(rotation)
