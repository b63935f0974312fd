"""Drive a virtual wrist with a hidden effect by the corrector's own path, and see the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from closed_loop_restless import Restless, restless
from closed_loop_truth import PerfectStream, TrueRunningModel
from numpy.typing import NDArray

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.vectors import skew
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.simulation.cell import SENSED, CellSettings, VirtualCell
from wrist_stiffness.simulation.program import Track

Array = NDArray[np.float64]

NAMES = ("motor_1_joint", "motor_2_joint")
BASE_FRAME = "wrist_base"
START_NS = 1_700_000_000_000_000_000
THERMOMETER_STEP_K = 0.1

BEGIN_S = 2.0
"""The correction ramps up from zero: what counts begins here."""

SETTLED_S = 0.3
"""A rest counts as one from so long after the command has stopped."""

WARM_UP_TIMES, WARM_UP = np.array([0.0, 0.05, 0.4, 0.6, 1.0]), np.array([0.0, 0.0, 1.0, 1.0, 0.2])
"""How a room warms up and cools down, over the duration and over the whole rise."""

DEADBAND = SafetySettings().deadband_steps
"""A correction that comes back by less has not turned: it may leave as much [encoder steps]."""

SETTINGS = StreamSettings(supervisor=SupervisorSettings(follow=True))


@dataclass(frozen=True)
class Left:
    """True error of one run, RMS.

    Parameters
    ----------
    moving, resting : float
        Pointing over all samples, and over those at rest [rad].
    shift : float
        |s| less the residual that the corrector hands on [m].
    """

    moving: float
    resting: float
    shift: float


@dataclass(frozen=True)
class Corrected:
    """What a corrector sends.

    Parameters
    ----------
    angles : (n, 2) float
        To the motors [rad].
    residual : (n, 3) float
        Shift that it hands on to the manipulator [m].
    faults : tuple of str
        Why commands were not corrected.
    """

    angles: Array
    residual: Array
    faults: tuple[str, ...]


@dataclass(frozen=True)
class Made:
    """What an effect does to a corrected wrist.

    Parameters
    ----------
    pointing, shift : float
        RMS of the error that is there with it and not without it [rad], [m].
    share : float
        Part of the square of the motion of the plate's centre that two motors can cancel; NaN where
        the effect does not move the platform.
    """

    pointing: float
    shift: float
    share: float


class Motion:
    """New motions of a wrist: the same commands and the same chance for every corrector.

    Loads are weights, so that what the sensors say does not depend on the correction.  Where within
    a count a motor stops is chance, and the same for all: the motors of this wrist stop where they
    are told, and the RMS that the counts make is added in squares.

    Parameters
    ----------
    table : Table
        Of the true wrist.
    settings : CellSettings
        Program, sensors and what is hidden.
    seed : int
        Of all chance.
    warm_up_K : float
        By how much the room warms; 0 for the experiment's own drift.
    """

    def __init__(
        self, table: Table, settings: CellSettings, seed: int, warm_up_K: float = 0.0
    ) -> None:
        self.table, self.settings, self._seed = with_fine_counts(table), settings, seed
        self._warm_up_K = warm_up_K
        count = round(settings.program_seconds * settings.rate_hz)
        self.time_s = np.arange(count) / settings.rate_hz
        cell = self._cell()
        self._program = cell.program
        self._phase = cell.program.phase(self.time_s)
        self.wanted = cell.desired(self.time_s)
        self.heard = cell.run(self.time_s, self.wanted)
        platform = table.geometry.platform
        mechanism = table.mechanism
        self._desired = mechanism.forward(self.wanted)
        objective = Objective("pointing", platform.normal, platform.tool_point)
        self._task = np.array([objective.matrix(mechanism.forward(t)) for t in self.wanted])
        moved = np.any(np.diff(self.wanted, axis=0, prepend=self.wanted[:1]) != 0.0, axis=1)
        since = np.maximum.accumulate(np.where(moved, self.time_s, 0.0))
        self._counts = self.time_s >= BEGIN_S
        self._rests = self._counts & (self.time_s - since >= SETTLED_S)
        self._jacobian = mechanism.jacobian(self._desired)
        self._step = table.geometry.limits.encoder_step
        count_rad = self._step / np.sqrt(12.0)
        self._count = count_rad * np.linalg.norm(self._task[:, :, 3:] @ self._jacobian, axis=(1, 2))

    def _cell(self, **changes: object) -> VirtualCell:
        settings = replace(self.settings, **changes)  # type: ignore[arg-type]
        return cell_of(self.table, settings, self._seed, self._warm_up_K)

    # Correctors

    def corrected(self, model: ErrorModel) -> Corrected:
        """Return what the corrector with a model sends for these motions."""
        return self._sent(CorrectionStream(model, SETTINGS, enabled=True), self.heard.wrench)

    def perfect(self, model: ErrorModel) -> Corrected:
        """Return what a corrector that knows the true laws sends, by the same rules.

        It hears the true load, with the sensor's noise.
        """
        well = self._cell(hidden=(), base="exact").run(self.time_s, self.wanted)
        room = self._program.ambient(self._phase)[:, 0]
        truth = TrueRunningModel(
            model,
            self.settings,
            lambda stamp_ns: 1e-9 * (stamp_ns - START_NS),
            lambda time_s: float(np.interp(time_s, self.time_s, room)),
        )
        return self._sent(PerfectStream(model, SETTINGS, truth), well.wrench)

    def _sent(self, stream: CorrectionStream, wrench: Array) -> Corrected:
        stamps = START_NS + np.round(1e9 * self.time_s).astype(np.int64)
        warm = THERMOMETER_STEP_K * np.round(self.heard.temperature / THERMOMETER_STEP_K)
        angles, residual = np.empty_like(self.wanted), np.zeros((len(stamps), 3))
        faults = []
        once_a_second = max(1, round(self.settings.rate_hz))
        for i, stamp in enumerate(stamps.tolist()):
            if i % once_a_second == 0:
                for name, celsius in zip(SENSED, warm[i].tolist(), strict=True):
                    stream.temperatures.add(name, stamp, celsius)
            said = wrench[i].tolist()
            stream.loads.add(stamp, BASE_FRAME, said[:3], said[3:])
            command = stream.on_command(stamp, "", NAMES, self.wanted[i].tolist())
            angles[i] = command.theta
            if command.fault is not None:
                faults.append(f"{self.time_s[i]:.2f} s: {command.fault}")
            if command.correction is not None:
                residual[i] = command.correction.after[:3]
        return Corrected(angles, residual, tuple(faults))

    # Truth

    def error(self, angles: Array) -> Array:
        """Return the true pose error that angles (n, 2) leave, (n, 6) at O in F [m, rad]."""
        sample = self._cell().run(self.time_s, angles)
        return self._twist(sample.pose_rotation, sample.pose_shift, self._desired.platform, 0.0)

    def error_as_registered(self, angles: Array, model: ErrorModel) -> Array:
        """Return the same as the instrument without its noise says it, registered as in a model.

        On a wrist whose base nobody knows exactly, F is where the registration says.
        """
        sample = self._cell(instrument="ideal").run(self.time_s, angles)
        left, right = model.constants.sensor(self._desired)
        wanted, place = self._desired.platform, np.zeros((len(angles), 3))
        if right is not None:
            turn, place = exp_twist(right)
            wanted = turn @ wanted
        if left is not None:
            turn, move = exp_twist(np.broadcast_to(left, (len(angles), 6)))
            wanted, place = turn @ wanted, move + (turn @ place[..., None])[..., 0]
        return self._twist(sample.measured_rotation, sample.measured_shift, wanted, place)

    @staticmethod
    def _twist(rotation: Array, shift: Array, wanted: Array, place: Array | float) -> Array:
        return log_motion(rotation @ np.swapaxes(wanted, -1, -2), shift - place)

    # Judgement

    def left(self, error: Array, handed_on: Array) -> Left:
        """Return the RMS of an error (n, 6) of which a shift (n, 3) is handed on."""
        square = np.sum(self._pointing(error) ** 2, axis=1) + self._count**2
        return Left(
            float(np.sqrt(square[self._counts].mean())),
            float(np.sqrt(square[self._rests].mean())),
            rms((error[:, :3] - handed_on)[self._counts]),
        )

    def floor(self) -> Left:
        """Return what the hidden encoder counts alone leave."""
        nothing = np.zeros((len(self.time_s), 6))
        return self.left(nothing, nothing[:, :3])

    def restless(self, corrected: Corrected) -> Restless:
        """Return what a correction does at reversals."""
        added = (corrected.angles - self.wanted)[self._counts]
        time_s, wanted = self.time_s[self._counts], self.wanted[self._counts]
        return restless(time_s, wanted, added, DEADBAND * self._step)

    def made(self, error: Array) -> Made:
        """Return the size of an error (n, 6) that an effect makes."""
        error = error[self._counts]
        pointing = rms(np.einsum("nij,nj->ni", self._task[self._counts], error))
        arm = self._desired.platform[self._counts] @ self.table.geometry.platform.centre
        motion = error[:, :3] + np.cross(error[:, 3:], arm)
        reach = -np.array([skew(each) for each in arm]) @ self._jacobian[self._counts]
        kept = motion - np.einsum("nij,nj->ni", reach @ np.linalg.pinv(reach), motion)
        size = rms(motion)
        share = 1.0 - (rms(kept) / size) ** 2 if size > 0.0 else float("nan")
        return Made(pointing, rms(error[:, :3]), share)

    def _pointing(self, error: Array) -> Array:
        return np.einsum("nij,nj->ni", self._task, error)


def cell_of(table: Table, settings: CellSettings, seed: int, warm_up_K: float) -> VirtualCell:
    """Return the cell, in a room that warms, stays warm and cools down again."""
    cell = VirtualCell(table, settings, np.random.default_rng(seed))
    if warm_up_K:
        time_s = settings.program_seconds * WARM_UP_TIMES
        room = Track(time_s, warm_up_K * WARM_UP[:, None])
        cell.program = replace(cell.program, ambient=room)
    return cell


def with_fine_counts(table: Table) -> Table:
    """Return the table of a wrist whose motors stop where they are told."""
    geometry = dict(table.header.geometry)
    geometry["limits"] = {**geometry["limits"], "encoder_step_deg": 1e-7}
    return replace(table, header=replace(table.header, geometry=geometry))


def rms(vectors: Array) -> float:
    """Return the root mean square of the norms of (n, d)."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
