"""Commands and trajectories on their way to the motors; never worse than no correction."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.correction import Correction
from wrist_stiffness.compensation.corrector import Correcting, Corrector, faded, search
from wrist_stiffness.compensation.intake import COMMAND
from wrist_stiffness.compensation.load_history import NANOSECONDS, Zero
from wrist_stiffness.compensation.monitor_stream import NOT_MEASURED
from wrist_stiffness.compensation.payload import Held, Payload, Thresholds
from wrist_stiffness.compensation.perishable import require_within_limits
from wrist_stiffness.compensation.pose import seen_from
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.safety import within_joint_limits
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream, as_rows
from wrist_stiffness.compensation.supervisor import Supervision, Supervisor
from wrist_stiffness.compensation.trajectory import PlannedPoint, corrected_point, neighbours
from wrist_stiffness.errors import (
    InputError,
    SingularPoseError,
    StaleLoadError,
    UnreachablePoseError,
    WristError,
)
from wrist_stiffness.mechanism.compiled import CompiledCommands, Flags
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.topics import CORRECTED_FRAME

SCATTERS = 5.0
"""A load departs when it does so by this many standard deviations of the tare's loads, at least."""

PLAN_WINDOW_NS = 2 * NANOSECONDS
"""Of the loads before a plan so many are judged: twice what it takes to know a payload [ns]."""

TWICE = "command is marked 'wrist_corrected': passed on unchanged, not corrected twice"

NOTHING = np.zeros(2)


@dataclass(frozen=True)
class CorrectedCommand:
    """What to send to the motors for one command.

    Parameters
    ----------
    frame_id : str
        For the header: `wrist_corrected` where correction is on or still fades out.
    positions : (n,) float
        All joints of the command, the motors corrected [rad].
    theta : (2,) float
        Corrected motor angles [rad].
    correction : Correction or None
        As it is applied, with the residual that remains; None while none can be had.
    fault : WristError or None
        Why none can be had although correction is on (what was applied before then fades out), or
        why the model could not remember the command.
    valid : bool
        Whether the residual holds: the load is known and corrected for in full
        (`Supervisor.valid`).
    """

    frame_id: str
    positions: Array
    theta: Array
    correction: Correction | None
    fault: WristError | None
    valid: bool = False


@dataclass(frozen=True)
class CorrectedTrajectory:
    """What to send for a whole trajectory.

    Parameters
    ----------
    frame_id : str
        For the header: `wrist_corrected` where correction is on.
    points : tuple of PlannedPoint
        The motors' angles, speeds and accelerations corrected.
    fault : WristError or None
        Why it passes unchanged although correction is on.
    valid : bool
        As of a command, at its start.
    """

    frame_id: str
    points: tuple[PlannedPoint, ...]
    fault: WristError | None
    valid: bool = False


@dataclass(frozen=True)
class CorrectedBlock:
    """What to send to the motors for n commands.

    Parameters
    ----------
    theta : (n, 2) float
        Corrected motor angles [rad].
    corrected : (n,) bool
        Which of them have a correction; residual and covariance of the others are undefined.
    after : (n, 6) float
        Residual with the correction as it is applied, at O in F [m, rad].
    covariance : (n, 6, 6) float
        Of the prediction behind it.
    faults : dict of int to WristError
        Why a command has none.
    platform : (n, 3, 3) float
        U -> F of the rigid platform at the corrected angles.
    valid : (n,) bool
        As `CorrectedCommand.valid`.
    """

    theta: Array
    corrected: Flags
    after: Array
    covariance: Array
    faults: dict[int, WristError]
    platform: Array
    valid: Flags


class CorrectionStream(Stream):
    """Corrected motor angles for every command; never worse than no correction.

    Parameters
    ----------
    model : ErrorModel or None
        May be replaced between samples; without one commands pass unchanged.
    settings : StreamSettings
        Names, frames, objective, limits.
    enabled : bool
        Whether commands are corrected; else they pass unchanged.

    Attributes
    ----------
    supervisor : Supervisor
        Judges what of the load is a payload.
    active : bool
        False where a correction, though enabled, is to fade out: of a node that is not active.
    """

    def __init__(self, model: ErrorModel | None, settings: StreamSettings, enabled: bool) -> None:
        super().__init__(model, settings)
        self.supervisor = Supervisor()
        self.active = True
        self._corrector = Corrector()
        self._enabled = enabled

    def _used(self, model: ErrorModel) -> ErrorModel:
        """Leave out what is wrong with a measurement alone: commands are no measurement."""
        of_wrist = [each for each in model.effects if not each.law.of_measurement(each.component)]
        return model if len(of_wrist) == len(model.effects) else model.with_effects(*of_wrist)

    @property
    def enabled(self) -> bool:
        """Whether commands are corrected; switching it judges the load anew."""
        return self._enabled

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        self._enabled = enabled
        self.supervisor.forget()

    @property
    def supervision(self) -> Supervision:
        """What is believed of the load, to be shown and stored."""
        return self.supervisor.supervision

    def declare_payload(self, payload: Payload | None) -> None:
        """Take over what a gripper holds; None for nothing (see `Supervisor`)."""
        self.supervisor.declare_payload(payload)

    def restore(self, payload: Payload | None) -> None:
        """Expect a payload that was stored (see `Supervisor`)."""
        self.supervisor.restore(payload)

    def forget(self) -> None:
        """Judge the load anew."""
        self.supervisor.forget()

    @property
    def correcting(self) -> bool:
        """Whether commands are corrected now."""
        return self._enabled and self.active

    @property
    def applied(self) -> Array:
        """What is added to the commands now (2,) [rad]."""
        return self._corrector.applied.value

    def resume(self, paused_s: float) -> None:
        """Correct again after a pause [s], in which the correction faded as time passed."""
        self._corrector.applied.fade(paused_s, self.settings.safety)
        self._corrector.release()
        self.active = True

    def use_zero(self, zero: Zero | None) -> None:
        """Tare, and judge the load anew."""
        super().use_zero(zero)
        self.supervisor.restore(None)
        scatter = np.zeros(6) if zero is None else SCATTERS * zero.scatter
        self.supervisor.scatter = Thresholds(*scatter.reshape(2, 3).max(axis=1).tolist())

    def on_command(
        self,
        stamp_ns: int,
        frame_id: str,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
    ) -> CorrectedCommand:
        """Correct a command.

        Parameters
        ----------
        stamp_ns : int
            Its stamp [ns].
        frame_id : str
            Its header's frame; `wrist_corrected` marks a command that was corrected already.
        names, positions, velocities : sequence
            As in sensor_msgs/JointState [rad, rad/s]; speeds that are absent or not finite are
            taken as differences of the angles.

        Returns
        -------
        CorrectedCommand
            With the fault, and on the way to no correction, wherever one cannot be had safely.

        Raises
        ------
        InputError
            If a motor is missing, an angle is not finite or beyond the joint limits: such a command
            is not to be forwarded.
        """
        theta = self._motor_angles(names, positions)
        theta_dot = self.settings.motors.speeds(names, velocities)
        sent = np.array(positions, dtype=float)
        if frame_id == CORRECTED_FRAME:
            self._corrector.reset()
            self._remember(stamp_ns, theta, None, theta_dot)
            twice = InputError(TWICE) if self.correcting else None
            return CorrectedCommand(frame_id, sent, theta, None, twice)
        load: Load | None = None
        fault: WristError | None = None
        if self.correcting:
            try:
                load = self._load(stamp_ns, theta)
                if self.supervisor.since_ns == stamp_ns:
                    # With another payload the hysteresis begins anew.
                    self._corrector.release()
            except WristError as error:
                fault = error
                if isinstance(error, StaleLoadError):
                    self.supervisor.lost()
        delta, correction = NOTHING, None
        if self._running is not None:
            corrected = self._corrector.command(
                self._running,
                self.settings,
                stamp_ns,
                theta,
                theta_dot,
                load,
                self.supervisor.share,
            )
            delta, correction = corrected.delta, corrected.correction
            fault = fault or corrected.fault
        forgotten = self._remember(stamp_ns, theta + delta, load, theta_dot)
        if self.correcting:
            fault = fault or forgotten
        first, second = self.settings.motors.places(names)
        sent[first], sent[second] = (theta + delta).tolist()
        marked = self.correcting or bool(np.any(delta))
        return CorrectedCommand(
            CORRECTED_FRAME if marked else frame_id,
            sent,
            theta + delta,
            correction,
            fault,
            correction is not None and self.supervisor.valid,
        )

    @property
    def in_blocks(self) -> bool:
        """Whether `on_commands` can be asked: compiled, correcting, each command for itself."""
        running = self._running
        if running is None or running.compiled is None or not self.correcting:
            return False
        return running.model.certain and not running.model.constants.warnings

    def within_limits(self, theta: Array) -> bool:
        """Tell whether all commands (n, 2) [rad] are within the joint limits."""
        if self.model is None:
            return True
        limits = self.model.table.geometry.limits
        step = limits.encoder_step
        inside = (limits.joint_lower - step <= theta) & (theta <= limits.joint_upper + step)
        return bool(inside.all())

    def on_commands(self, stamps: NDArray[np.int64], theta: Array) -> CorrectedBlock:
        """Correct many commands, to the bit as `on_command` would one by one.

        Parameters
        ----------
        stamps : (n,) int
            Not falling [ns].
        theta : (n, 2) float
            Motor angles, finite and within the joint limits [rad].

        Returns
        -------
        CorrectedBlock
            For all of them.
        """
        running, settings, supervisor = self.running_model(), self.settings, self.supervisor
        compiled = running.compiled
        if compiled is None:
            raise InputError("this model is corrected command by command")
        measured = self.loads.block_at(stamps)
        wrench, on_platform, known = as_rows(measured)
        table, n = running.model.table, len(stamps)
        limits = table.geometry.limits
        at, inside = compiled.forward(theta)
        usable = inside & (np.linalg.norm(wrench[:, :3], axis=1) <= 0.999 * limits.force)
        usable &= np.linalg.norm(wrench[:, 3:], axis=1) <= 0.999 * limits.moment
        commands = CompiledCommands(stamps, theta, wrench, on_platform, known.copy())
        block = Correcting(self._corrector, running, compiled, settings, commands)
        angles, platforms, begin = theta.tolist(), at.platform, 0
        valid = np.zeros(n, dtype=bool)
        for i, stamp_ns in enumerate(stamps.tolist()):
            try:
                found = measured[i]
                if found is None or not usable[i]:
                    load = self._load(stamp_ns, theta[i])
                else:
                    load = supervisor.judge(
                        stamp_ns,
                        angles[i],
                        found,
                        platforms[i],
                        table.geometry,
                        settings.supervisor,
                        settings.correction_limit,
                    )
                commands.wanted[i] = True
                wrench[i], on_platform[i] = load.wrench, load.on_platform
            except WristError as error:
                block.faults[i] = error
                commands.wanted[i] = False
                if isinstance(error, StaleLoadError):
                    supervisor.lost()
            if not supervisor.undisturbed:
                block.correct(begin, i)
                block.correct(i, i + 1, supervisor.share)
                begin = i + 1
            valid[i] = supervisor.valid
        block.correct(begin, n)
        corrected = commands.wanted.copy()
        corrected[list(block.faults)] = False
        predicted = block.found.predicted
        there = Configuration.of_row(np.ascontiguousarray(predicted.configuration))
        twist = np.ascontiguousarray(predicted.twist)
        covariance = running.model.table_covariance(there, twist)
        return CorrectedBlock(
            theta + block.found.applied,
            corrected,
            np.ascontiguousarray(block.found.rows[:, 2:8]),
            covariance,
            block.faults,
            there.platform,
            valid,
        )

    def on_trajectory(
        self,
        stamp_ns: int,
        frame_id: str,
        names: Sequence[str],
        points: Sequence[PlannedPoint],
    ) -> CorrectedTrajectory:
        """Correct every point of a trajectory under the load at its start.

        A trajectory is a plan: it is neither slewed nor held by the hysteresis, and not remembered.

        Parameters
        ----------
        stamp_ns : int
            Its start [ns].
        frame_id : str
            Its header's frame.
        names : sequence of str
            Joint names.
        points : sequence of PlannedPoint
            Of all these joints (see `planned_point`).

        Returns
        -------
        CorrectedTrajectory
            Unchanged as a whole, with the fault, if one point cannot be corrected.

        Raises
        ------
        InputError
            If a motor is missing, named twice or driven beyond its joint limits: it is not to be
            forwarded.
        """
        work = self.trajectory_work(stamp_ns, frame_id, names, points)
        while True:
            try:
                next(work)
            except StopIteration as finished:
                result: CorrectedTrajectory = finished.value
                return result

    def trajectory_work(
        self,
        stamp_ns: int,
        frame_id: str,
        names: Sequence[str],
        points: Sequence[PlannedPoint],
    ) -> Generator[None, None, CorrectedTrajectory]:
        """Do what `on_trajectory` does in small steps, between which commands may be corrected.

        Model, memory, settings and load are those of the first step.
        """
        motors, settings, model = self.settings.motors, self.settings, self.model
        places = motors.places(names, "trajectory")
        running: RunningModel | None = None
        fault: WristError | None = None
        correcting = self.correcting
        if correcting:
            try:
                if frame_id == CORRECTED_FRAME:
                    raise InputError(TWICE)
                held = self._held_by(stamp_ns, points, places)
                running = self.running_model().snapshot()
            except WristError as error:
                fault = error
        done = []
        for point in points:
            if model is not None:
                limits = model.table.geometry.limits
                require_within_limits("trajectory", point.positions[list(places)], limits, motors)
            yield
            if running is None or fault is not None:
                continue
            speed = point.velocities[list(places)] if len(point.velocities) else None
            corrected: list[Array] = []
            try:
                for theta in neighbours(point, places):
                    try:
                        found = self._planned(running, settings, stamp_ns, held, theta, speed)
                    except (UnreachablePoseError, SingularPoseError):
                        if not corrected:
                            raise
                        # Beside the point, at the border, the correction has faded to none.
                        found = theta
                    corrected.append(found)
                    yield
            except WristError as error:
                fault = error
            else:
                done.append(corrected_point(point, places, corrected))
        if running is None or fault is not None:
            mark = CORRECTED_FRAME if correcting else frame_id
            return CorrectedTrajectory(mark, tuple(points), fault)
        return CorrectedTrajectory(CORRECTED_FRAME, tuple(done), None, held.valid)

    def residuals(self, command: CorrectedCommand) -> list[tuple[Array, Array]]:
        """Return what a correction leaves: actual minus desired pose.

        Parameters
        ----------
        command : CorrectedCommand
            With its correction.

        Returns
        -------
        list of ((6,) float, (6, 6) float)
            Twist in F at O and its covariance, and the same at the geometry's tool point where that
            is not O; empty without a correction.  Where the residual does not hold, the covariance
            says so as that of a pose does that is not measured.
        """
        if command.correction is None:
            return []
        twist, prediction = command.correction.after, command.correction.prediction
        platform = prediction.configuration.platform
        return self._left(twist, prediction.covariance, platform, command.valid)

    def block_residuals(self, block: CorrectedBlock) -> list[tuple[Array, Array]]:
        """Return the same of the commands of a block that have a correction, k of them.

        Returns
        -------
        list of ((k, 6) float, (k, 6, 6) float)
            As `residuals`.
        """
        own = np.flatnonzero(block.corrected)
        rows = block.after[own], block.covariance[own], block.platform[own], block.valid[own]
        if not self.running_model().model.table.geometry.platform.tool_point.any():
            doubt = np.where(rows[3], 0.0, NOT_MEASURED)[:, None, None] * np.eye(6)
            return [(rows[0], rows[1] + doubt)]
        # One by one: a stack of products may round otherwise.
        each = [self._left(*row) for row in zip(*rows, strict=True)]
        return [
            (
                np.array([residuals[place][0] for residuals in each]).reshape(-1, 6),
                np.array([residuals[place][1] for residuals in each]).reshape(-1, 6, 6),
            )
            for place in range(2)
        ]

    def _left(
        self, twist: Array, covariance: Array, platform: Array, valid: bool
    ) -> list[tuple[Array, Array]]:
        doubt = (0.0 if valid else NOT_MEASURED) * np.eye(6)
        found = [(twist, covariance + doubt)]
        tool_point = self.running_model().model.table.geometry.platform.tool_point
        if tool_point.any():
            there = seen_from(platform @ tool_point)
            found.append((there @ twist, there @ covariance @ there.T + doubt))
        return found

    def _motor_angles(self, names: Sequence[str], positions: Sequence[float]) -> Array:
        theta = self.settings.motors.angles(names, positions, COMMAND)
        if not all(map(isfinite, positions)):
            raise InputError(f"{COMMAND}: position {list(positions)} is not finite")
        if self.model is not None:
            limits = self.model.table.geometry.limits
            require_within_limits(COMMAND, theta, limits, self.settings.motors)
        return theta

    def _remember(
        self, stamp_ns: int, theta: Array, load: Load | None, theta_dot: Array | None
    ) -> WristError | None:
        """Remember what the motors are told, corrected or not; return why that is not possible.

        The load is the one that is corrected for, else the measured one: a contact that is not
        followed must not come back by way of the memory.
        """
        running = self._running
        if running is None or not running.remembers:
            return None
        try:
            if load is None:
                _, load = self.loads.at(stamp_ns)
            running.advance(stamp_ns, theta, load, theta_dot)
        except WristError as error:
            return error
        return None

    def _load(self, stamp_ns: int, theta: Array) -> Load:
        """Return the load to correct for."""
        _, measured = self.loads.at(stamp_ns)
        return self._judged(stamp_ns, theta, measured)

    def _judged(self, stamp_ns: int, theta: Array, measured: Load) -> Load:
        table = self.running_model().model.table
        # A payload may stand in for it, but a load beyond the table is a fault in any case; turning
        # a wrench changes neither of its sizes, so its frame does not matter.
        table.check_load(measured.wrench)
        return self.supervisor.judge(
            stamp_ns,
            theta.tolist(),
            measured,
            table.workspace.configuration(theta).platform,
            table.geometry,
            self.settings.supervisor,
            self.settings.correction_limit,
        )

    def _held_by(
        self, stamp_ns: int, points: Sequence[PlannedPoint], places: Sequence[int]
    ) -> Held:
        """Return what a plan is corrected for.

        Where no commands come, the loads before the plan are judged as at its first point.
        """
        self.loads.at(stamp_ns)
        start_ns = max(self.supervisor.supervision.stamp_ns, stamp_ns - PLAN_WINDOW_NS)
        for load_ns, load in self.loads.since(start_ns, stamp_ns) if points else ():
            self._judged(load_ns, points[0].positions[list(places)], load)
        return self.supervisor.held()

    @staticmethod
    def _planned(
        running: RunningModel,
        settings: StreamSettings,
        stamp_ns: int,
        held: Held,
        theta: Array,
        theta_dot: Array | None,
    ) -> Array:
        """Return the corrected angles for planned ones."""
        load = held.load(running.model.table.workspace.configuration(theta).platform)
        found = search(running, settings, stamp_ns, load, theta, theta_dot)
        delta = held.share * faded(running, settings, found)
        return within_joint_limits(theta, delta, running.model.table.geometry.limits)
