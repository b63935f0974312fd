"""A plan on its way to the motors: every point corrected for what is held at its start.

Each point is taken with its speeds and accelerations through a correction of its angles.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.compensation.corrector import Corrector, faded, search
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.safety import guard_weight, within_joint_limits
from wrist_stiffness.compensation.scales import Held, Scales
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError, SingularPoseError, UnreachablePoseError
from wrist_stiffness.mechanism.compiled import CompiledCommands, CorrectedRows, CorrectorState
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.model.block import Load

STEP = 5e-3
"""Half width of the central differences [rad].  The search error of a correction, 1e-10 rad, gives
2e-8 of a speed and 2e-5 of a speed squared in an acceleration; corrections vary over degrees."""

LARGEST = 1e9
"""No joint is so far or so fast, in any unit; its square is still a number."""


@dataclass(frozen=True)
class PlannedPoint:
    """One point of a trajectory."""

    positions: Array  # (n,), of all joints [rad]
    # `velocities`, `accelerations`: (n,) or (0,), empty where the plan has none [rad/s, rad/s^2]
    velocities: Array
    accelerations: Array


def planned_point(
    count: int,
    positions: Sequence[float],
    velocities: Sequence[float] = (),
    accelerations: Sequence[float] = (),
) -> PlannedPoint:
    """Return a point of a trajectory from what a message says of it.

    `positions`, `velocities`, `accelerations`: one a joint; the last two may be empty [rad, rad/s,
    rad/s^2].  Raises `InputError` if a number of values is wrong or a value is not finite or beyond
    all bounds.
    """
    named = {"positions": positions, "velocities": velocities, "accelerations": accelerations}
    for name, values in named.items():
        if len(values) != count and (name == "positions" or len(values)):
            raise InputError(f"trajectory: {len(values)} {name} for {count} names")
        if not np.all(np.abs(values) < LARGEST):
            raise InputError(
                f"trajectory: {name} {list(values)} are not finite or beyond {LARGEST:g}"
            )
    return PlannedPoint(*(np.array(values, dtype=float) for values in named.values()))


def neighbours(point: PlannedPoint, places: Sequence[int]) -> list[Array]:
    """Return the motor angles whose corrections say how a point of the corrected path moves.

    `places` (2,) sequence of int: where the motors stand among the joints.  Gives list of (2,)
    float: the point itself, then one step ahead and one back along its speed and along its
    acceleration, where the plan has them and they are not zero [rad].
    """
    at = list(places)
    theta = point.positions[at]
    found = [theta]
    for derivative in (point.velocities, point.accelerations):
        if len(derivative) and derivative[at].any():
            # Unlike the root of a sum of squares, `hypot` is not zero for the smallest numbers.
            step = STEP * (derivative[at] / np.hypot(*derivative[at]))
            found += [theta + step, theta - step]
    return found


def corrected_point(
    point: PlannedPoint, places: Sequence[int], corrected: Sequence[Array]
) -> PlannedPoint:
    """Return a point of the corrected path with the derivatives that belong to it.

    Where a plan runs through theta(t), the motors run through c(theta(t)), at the speed
    c' theta_dot and the acceleration c' theta_ddot + c'' (theta_dot, theta_dot), by central
    differences.

    `places` (2,) sequence of int: where the motors stand among the joints; `corrected` sequence of
    (2,): corrected motor angles at the point's `neighbours` [rad].  Gives `PlannedPoint`: other
    joints unchanged; speeds and accelerations where the plan has them.
    """
    at = list(places)
    there, beside = corrected[0], iter(corrected[1:])
    slopes, bends = np.zeros((2, 2)), np.zeros((2, 2))
    for i, derivative in enumerate((point.velocities, point.accelerations)):
        if len(derivative) and derivative[at].any():
            size = float(np.hypot(*derivative[at]))
            after, before = next(beside), next(beside)
            slopes[i] = (after - before) * (0.5 * size / STEP)
            bends[i] = (after - 2.0 * there + before) * (size / STEP) ** 2
    positions = point.positions.copy()
    positions[at] = there
    velocities, accelerations = point.velocities.copy(), point.accelerations.copy()
    if len(velocities):
        velocities[at] = slopes[0]
    if len(accelerations):
        accelerations[at] = slopes[1] + bends[0]
    return replace(point, positions=positions, velocities=velocities, accelerations=accelerations)


AT_ONCE = 8
"""Points that are corrected in one step: up to 40 searches, in a millisecond."""


@dataclass
class PlanCorrector:
    """Corrects motor angles of one plan, each for itself: neither slewed nor held by hysteresis.

    The motors rest until it begins.  Raises `WristError` if they cannot rest where they are.
    """

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
        self.running.rest(self.stamp_ns, self.held.load)

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
        # The other rows hold whatever was in memory.
        done = np.flatnonzero(inside)
        there = Configuration.of_row(found.configuration[done])
        weight = guard_weight(table.workspace, there, self.settings.safety)
        delta = self.held.share * weight[:, None] * found.applied[done]
        sent = iter(within_joint_limits(theta[done], delta, table.geometry.limits))
        return [next(sent) if known else None for known in inside.tolist()]

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
