"""Commands and trajectories on their way to the motors; never worse than no correction."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from math import isfinite
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.belief import Supervision
from wrist_stiffness.compensation.corrected import (
    CorrectedBlock,
    CorrectedCommand,
    CorrectedTrajectory,
)
from wrist_stiffness.compensation.correction import correction_of
from wrist_stiffness.compensation.corrector import Corrected, Corrector
from wrist_stiffness.compensation.intake import COMMAND
from wrist_stiffness.compensation.load_history import NANOSECONDS, Zero
from wrist_stiffness.compensation.payload import Thresholds
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.safety import require_within_limits, within_limits
from wrist_stiffness.compensation.scales import Held
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.compensation.supervisor import Supervisor
from wrist_stiffness.compensation.trajectory_plan import PlanCorrector, PlannedPoint
from wrist_stiffness.errors import InputError, LoadRangeError, WristError
from wrist_stiffness.mechanism.compiled import (
    CompiledCommands,
    CompiledWrist,
    CorrectedRows,
    Flags,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.topics import CORRECTED_FRAME

SCATTERS = 5.0
"""A load departs when it does so by this many standard deviations of the tare's loads, at least."""

PLAN_WINDOW_NS = 2 * NANOSECONDS
"""Of the loads before a plan so many are judged: twice what it takes to know a payload [ns]."""

TWICE = "command is marked 'wrist_corrected': passed on unchanged, not corrected twice"


class CorrectionStream(Stream):
    """Corrected motor angles for every command; never worse than no correction.

    `model`: may be replaced between samples; without one commands pass unchanged.  `enabled`:
    whether commands are corrected; else they pass unchanged.
    """

    def __init__(self, model: ErrorModel | None, settings: StreamSettings, enabled: bool) -> None:
        super().__init__(model, settings)
        self.supervisor = Supervisor()  # judges what of the load is a payload
        # False where a correction, though enabled, is to fade out: of a node that is not active
        self.active = True
        self._corrector = Corrector()
        self._enabled = enabled
        # last stamp [ns], with the angles and speeds that were commanded first at it
        self._commanded: tuple[int, Array, Array] | None = None

    def _used(self, model: ErrorModel) -> ErrorModel:
        """Leave out what is wrong with a measurement alone: commands are no measurement."""
        model = super()._used(model)
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
        """What is believed of the load."""
        return self.supervisor.supervision

    @property
    def correcting(self) -> bool:
        """Whether commands are corrected now."""
        return self._enabled and self.active

    @property
    def applied(self) -> Array:
        """What is added to the commands now (2,) [rad]."""
        return self._corrector.applied

    def resume(self, paused_s: float) -> None:
        """Correct again after a pause [s]: the correction faded, and what is held is seen anew."""
        self._corrector.fade(paused_s, self.settings.safety)
        self._corrector.release()
        self.supervisor.lost()
        self.active = True

    def use_zero(self, zero: Zero | None) -> None:
        """Tare, and judge the load anew."""
        super().use_zero(zero)
        self.supervisor.forget()
        self.supervisor.declare_payload(None)
        scatter = np.zeros(6) if zero is None else SCATTERS * zero.scatter
        self.supervisor.scatter = Thresholds(*scatter.reshape(2, 3).max(axis=1).tolist())

    def on_command(
        self,
        stamp_ns: int,
        frame_id: str,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
        came_ns: int = 0,
    ) -> CorrectedCommand:
        """Correct a command.

        `stamp_ns`: its stamp [ns], 0 for none: no load belongs to it, and the correction fades out.
        `frame_id`: its header's frame; `wrist_corrected` marks a command that was corrected
        already.  `names`, `positions`, `velocities`: as in sensor_msgs/JointState [rad, rad/s];
        speeds that are absent or not finite are taken as differences of commands.  `came_ns`:
        when it came [ns], the time of a command without a stamp.  Gives `CorrectedCommand`:
        with the fault, and on the way to no correction, wherever one cannot be had safely.  Raises
        `InputError` if a motor is missing, an angle is not finite or beyond the joint limits: such
        a command is not to be forwarded.
        """
        theta = self._motor_angles(names, positions)
        theta_dot = self._speeds(stamp_ns, theta, self.settings.motors.speeds(names, velocities))
        if frame_id == CORRECTED_FRAME:
            self._corrector.reset()
            self._remember(stamp_ns, theta, None, theta_dot)
            twice = InputError(TWICE) if self.correcting else None
            return CorrectedCommand(frame_id, np.array(positions, float), theta, None, twice)
        if self._running is None:
            fault = self._judged(stamp_ns, theta)[1] if self.correcting else None
            one = Corrected(np.zeros(2), None, fault, None)
        else:
            one = self._corrected(self._running, stamp_ns, theta, theta_dot, came_ns)
        driven = theta + one.delta
        forgotten = self._remember(stamp_ns, driven, one.load, theta_dot)
        sent = list(positions)
        first, second = self.settings.motors.places(names)
        sent[first], sent[second] = driven.tolist()
        marked = self.correcting or any(one.delta.tolist())
        return CorrectedCommand(
            CORRECTED_FRAME if marked else frame_id,
            np.array(sent, float),
            driven,
            one.correction,
            one.fault or (forgotten if self.correcting else None),
            one.correction is not None and self.supervisor.valid,
        )

    @property
    def in_blocks(self) -> bool:
        """Whether `on_commands` is one compiled loop: correcting, each command for itself."""
        running = self._running
        if running is None or running.compiled is None or not self.correcting:
            return False
        return running.model.certain and not running.model.constants.warnings

    def within_limits(self, theta: Array) -> bool:
        """Tell whether all commands (n, 2) [rad] are within the joint limits."""
        return self.model is None or within_limits(theta, self.model.table.geometry.limits)

    def on_commands(
        self, stamps: NDArray[np.int64], theta: Array, theta_dot: Array | None = None
    ) -> CorrectedBlock:
        """Correct many commands, to the bit as `on_command` would one by one.

        `stamps` (n,): not falling [ns]; `theta` (n, 2): motor angles, finite and within the joint
        limits [rad]; `theta_dot` (n, 2): their speeds [rad/s].
        """
        running, n = self.running_model(), len(stamps)
        compiled = running.compiled
        if compiled is None or not self.in_blocks:
            speeds = [()] * n if theta_dot is None else theta_dot.tolist()
            each = zip(stamps.tolist(), theta.tolist(), speeds, strict=True)
            names = self.settings.motors.motor_1, self.settings.motors.motor_2
            ones = (self.on_command(at, "", names, angles, speed) for at, angles, speed in each)
            return CorrectedBlock.of(ones, n)
        commands = CompiledCommands(stamps, theta, *self.loads.block_at(stamps), np.ones(n))
        found, valid = CorrectedRows.room(n, compiled.sectors), np.zeros(n, dtype=bool)
        faults: dict[int, WristError] = {}
        place = 0
        while place < n:
            load: Load | None = None
            if commands.wanted[place]:
                place, load = self._compiled(running, compiled, commands, found, valid, place)
            if place < n:
                one = self._searched(running, int(stamps[place]), theta[place], None, load)
                if one.fault is not None:
                    faults[place] = one.fault
                found.applied[place] = one.delta
                if one.correction is not None:
                    at = one.correction.prediction
                    found.put(place, one.correction.after, at.twist, at.configuration)
                valid[place] = self.supervisor.valid
                place += 1
        corrected = np.ones(n, dtype=bool)
        corrected[list(faults)] = False
        there = Configuration.of_row(np.ascontiguousarray(found.configuration))
        covariance = running.model.table_covariance(there, np.ascontiguousarray(found.twist))
        return CorrectedBlock(
            theta + found.applied,
            corrected,
            np.ascontiguousarray(found.after),
            covariance,
            faults,
            there.platform,
            valid,
        )

    def on_trajectory(self, *plan: Any) -> CorrectedTrajectory:
        """Correct a trajectory at one go (see `trajectory_work`)."""
        work = self.trajectory_work(*plan)
        while True:
            try:
                next(work)
            except StopIteration as finished:
                return cast(CorrectedTrajectory, finished.value)

    def trajectory_work(
        self,
        stamp_ns: int,
        frame_id: str,
        names: Sequence[str],
        points: Sequence[PlannedPoint],
    ) -> Generator[None, None, CorrectedTrajectory]:
        """Correct every point of a trajectory under the load at its start.

        In small steps, between which commands may be corrected.  Model, memory, settings and load
        are those of the first step.  A trajectory is a plan: it is neither slewed nor held by the
        hysteresis, and not remembered.

        `stamp_ns`: its start [ns]; `points`: of all these joints (see `planned_point`).  Gives
        `CorrectedTrajectory`: unchanged as a whole, with the fault, if one point cannot be
        corrected.  Raises `InputError` if a motor is missing, named twice or driven beyond its
        joint limits: it is not to be forwarded.
        """
        motors, model, correcting = self.settings.motors, self.model, self.correcting
        places = motors.places(names, "trajectory")
        corrector: PlanCorrector | None = None
        done, fault = tuple(points), None
        if correcting:
            try:
                if frame_id == CORRECTED_FRAME:
                    raise InputError(TWICE)
                first = points[0].positions[list(places)] if points else None
                held = self._held_by(stamp_ns, first)
                running = self.running_model().snapshot()
                corrector = PlanCorrector(running, self.settings, stamp_ns, held)
            except WristError as error:
                fault = error
        if model is not None:
            limits = model.table.geometry.limits
            for point in points:
                require_within_limits("trajectory", point.positions[list(places)], limits, motors)
                yield
        if corrector is not None:
            try:
                done = yield from corrector.work(points, places)
            except WristError as error:
                fault = error
        known = corrector is not None and fault is None and corrector.known
        return CorrectedTrajectory(CORRECTED_FRAME if correcting else frame_id, done, fault, known)

    def residuals(self, answer: CorrectedCommand | CorrectedBlock) -> list[tuple[Array, Array]]:
        """Return what corrections leave at O, and at the geometry's tool point if that is not O."""
        geometry = None if self.model is None else self.model.table.geometry
        return [] if geometry is None else answer.residuals(geometry.platform.tool_point)

    def _motor_angles(self, names: Sequence[str], positions: Sequence[float]) -> Array:
        theta = self.settings.motors.angles(names, positions, COMMAND)
        if not all(map(isfinite, positions)):
            raise InputError(f"{COMMAND}: position {list(positions)} is not finite")
        if self.model is not None:
            limits = self.model.table.geometry.limits
            require_within_limits(COMMAND, theta, limits, self.settings.motors)
        return theta

    def _speeds(self, stamp_ns: int, theta: Array, said: Array | None) -> Array:
        """Return the speeds of a command (2,) [rad/s]: those it says, else the way from the last.

        A correction that is tried is no part of that way: it would be driven in no time.  Where no
        time passed, as before: a clock may stand still, and a command may come twice.
        """
        last_ns, last, speed = self._commanded or (stamp_ns, theta, np.zeros(2))
        passed_ns = stamp_ns - last_ns if stamp_ns else 0
        if passed_ns:
            way = theta - last
            speed = way * (NANOSECONDS / passed_ns) if passed_ns > 0 else np.zeros(2)
        if said is not None:
            speed = said
        if passed_ns or self._commanded is None:
            self._commanded = stamp_ns, theta, speed
        return speed

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

    def _corrected(
        self,
        running: RunningModel,
        stamp_ns: int,
        theta: Array,
        theta_dot: Array | None,
        came_ns: int,
    ) -> Corrected:
        """Correct one command: as a block of one, else in Python."""
        compiled, load = running.compiled, None
        if (
            compiled is not None
            and self.correcting
            and (commands := self._block_of_one(stamp_ns, theta)) is not None
        ):
            found, valid = CorrectedRows.room(1, compiled.sectors), np.empty(1, dtype=bool)
            end, load = self._compiled(running, compiled, commands, found, valid)
            if end == 1 and load is not None:
                correction = correction_of(found, 0, running.model, load)
                return Corrected(correction.delta, correction, None, load)
        return self._searched(running, stamp_ns, theta, theta_dot, load, came_ns)

    def _block_of_one(self, stamp_ns: int, theta: Array) -> CompiledCommands | None:
        """Return a command with its load, None where no load is known."""
        try:
            _, load = self.loads.at(stamp_ns)
        except WristError:
            return None
        wanted, on_platform = np.ones(1, dtype=bool), np.array([load.on_platform])
        stamps, wrench = np.array([stamp_ns]), load.wrench[None]
        return CompiledCommands(stamps, theta[None], wrench, on_platform, wanted, np.ones(1))

    def _compiled(
        self,
        running: RunningModel,
        compiled: CompiledWrist,
        commands: CompiledCommands,
        found: CorrectedRows,
        valid: Flags,
        begin: int = 0,
    ) -> tuple[int, Load | None]:
        """Judge and correct commands from a place on.

        Gives the first that this cannot serve, and the load to correct for of the last command that
        was judged: of that one if any.
        """
        supervisor, settings = self.supervisor, self.settings
        scales = supervisor.scales(running.model.table.geometry)
        rules = settings.supervisor, settings.correction_limit
        judging = supervisor.compiled(scales, *rules, valid)
        corrector = self._corrector
        end = corrector.correct(running, compiled, settings, commands, found, judging, begin)
        judged = supervisor.go_on()
        last = min(end, len(valid) - 1) if judged else end - 1
        if settings.supervisor.follow and last >= begin:
            supervisor.followed = _load_at(commands, last)
        return end, _load_at(commands, last) if judged else None

    def _searched(
        self,
        running: RunningModel,
        stamp_ns: int,
        theta: Array,
        theta_dot: Array | None,
        load: Load | None,
        came_ns: int = 0,
    ) -> Corrected:
        """Correct one command in Python, for a load that was judged or, if None, is to be."""
        fault: WristError | None = None
        if load is None and self.correcting:
            load, fault = self._judged(stamp_ns, theta)
        share, own = self.supervisor.share, self._corrector
        at_ns = stamp_ns or came_ns
        one = own.searched(running, self.settings, at_ns, theta, theta_dot, load, share)
        return one._replace(fault=fault or one.fault)

    def _judged(self, stamp_ns: int, theta: Array) -> tuple[Load | None, WristError | None]:
        """Return the load to correct for, or why there is none."""
        try:
            _, measured = self.loads.at(stamp_ns)
        except WristError as error:
            self.supervisor.lost()
            return None, error
        try:
            load = self._load_for(stamp_ns, theta, measured)
        except WristError as error:
            return None, error
        if self.supervisor.stamps[1] == stamp_ns:
            # With another payload the hysteresis begins anew.
            self._corrector.release()
        return load, None

    def _load_for(self, stamp_ns: int, theta: Array, measured: Load) -> Load:
        """Return what the supervisor makes of a measured load at a command (2,) [rad].

        Raises `WristError` if the angles or the measured load are beyond the table.
        """
        supervisor, settings = self.supervisor, self.settings
        table = self.running_model().model.table
        if settings.supervisor.follow:
            supervisor.follow(stamp_ns, measured)
            return measured
        try:
            reading = supervisor.scales(table.geometry).read(table, theta, measured)
        except LoadRangeError:
            supervisor.overloaded(stamp_ns, theta.tolist())
            raise
        judged = supervisor.judge(
            stamp_ns, theta.tolist(), reading, settings.supervisor, settings.correction_limit
        )
        return Load(np.zeros(6) if judged is None else np.array(judged))

    def _held_by(self, stamp_ns: int, first: Array | None) -> Held:
        """Return what a plan is corrected for, that begins at motor angles (2,) [rad].

        Where no commands come, the loads before the plan are judged as at its first point.
        """
        self.loads.at(stamp_ns)
        start_ns = max(int(self.supervisor.stamps[0]), stamp_ns - PLAN_WINDOW_NS)
        if first is not None:
            for load_ns, load in self.loads.since(start_ns, stamp_ns):
                self._load_for(load_ns, first, load)
        return self.supervisor.held(self.settings.supervisor)


def _load_at(commands: CompiledCommands, place: int) -> Load:
    return Load(commands.load[place].copy(), bool(commands.on_platform[place]))
