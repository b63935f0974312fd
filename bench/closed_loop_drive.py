"""Drive a virtual wrist with a hidden effect by the corrector's own path, and see the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.contact_policy import ContactSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.simulation.cell import SENSED, CellSample, CellSettings, VirtualCell, true_laws
from wrist_stiffness.simulation.wrist import TrueWrist

Array = NDArray[np.float64]

NAMES = ("motor_1_joint", "motor_2_joint")
BASE_FRAME = "wrist_base"
START_NS = 1_700_000_000_000_000_000
THERMOMETER_STEP_K = 0.1

BEGIN_S = 2.0
"""The correction ramps up from zero: what counts begins here."""

SETTLED_S = 0.3
"""A rest counts as one from so long after the command has stopped."""

REFINEMENTS = 8
"""Rounds in which the commands of one who knows the true laws are found."""

TURN_STEPS = 0.5
"""A correction that comes back by this many encoder steps has turned."""


@dataclass(frozen=True)
class Left:
    """True error of one run, RMS.

    Parameters
    ----------
    moving, resting : float
        Pointing over all samples, and over those at rest [rad].
    shift : float
        |s| less the residual that the corrector hands on [m].
    turns : int
        How often the corrections of both motors change their direction.
    faults : int
        Commands for which there was no correction.
    """

    moving: float
    resting: float
    shift: float
    turns: int
    faults: int


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
    seconds : float
        Duration [s].
    seed : int
        Of all chance.
    """

    def __init__(self, table: Table, settings: CellSettings, seconds: float, seed: int) -> None:
        self.table, self.settings, self._seed = with_fine_counts(table), settings, seed
        self.time_s = np.arange(round(seconds * settings.rate_hz)) / settings.rate_hz
        cell = self._cell()
        self._program = cell.program
        self.wanted = cell.desired(self.time_s)
        self.heard = cell.run(self.time_s, self.wanted)
        platform = table.geometry.platform
        mechanism = table.mechanism
        self._desired = mechanism.forward(self.wanted)
        objective = Objective("pointing", platform.normal, platform.tool_point)
        poses = [mechanism.forward(theta) for theta in self.wanted]
        self._task = np.array([objective.matrix(pose) for pose in poses])
        self._cancelling = np.array(
            [objective.cancelling(pose, mechanism.jacobian(pose)) for pose in poses]
        )
        moved = np.any(np.diff(self.wanted, axis=0, prepend=self.wanted[:1]) != 0.0, axis=1)
        since = np.maximum.accumulate(np.where(moved, self.time_s, 0.0))
        self._counts = self.time_s >= BEGIN_S
        self._rests = self._counts & (self.time_s - since >= SETTLED_S)
        jacobian = mechanism.jacobian(self._desired)
        self._step = table.geometry.limits.encoder_step
        count = self._step / np.sqrt(12.0)
        self._count = count * np.linalg.norm(self._task[:, :, 3:] @ jacobian, axis=(1, 2))

    def _cell(self) -> VirtualCell:
        return VirtualCell(self.table, self.settings, np.random.default_rng(self._seed))

    def floor(self) -> Left:
        """Return what the hidden encoder counts alone leave."""
        nothing = np.zeros((len(self.time_s), 6))
        return self._left(nothing, nothing[:, :3])

    def uncorrected(self) -> Left:
        """Return what is there without any correction."""
        return self._left(self._error(self.heard), np.zeros((len(self.time_s), 3)))

    def driven(self, corrected: Corrected) -> Left:
        """Return what commands of a corrector leave."""
        error = self._error(self._cell().run(self.time_s, corrected.angles))
        left = self._left(error, corrected.residual)
        turns = sum(
            turning_points(column, TURN_STEPS * self._step)
            for column in (corrected.angles - self.wanted).T
        )
        return replace(left, turns=turns, faults=len(corrected.faults))

    def ideal(self, start: Corrected) -> Left:
        """Return the least that one who knows the true laws and the future leaves.

        The commands begin at those of a corrector and are mended by what truly remains.
        """
        phase = self._program.phase(self.time_s)
        load, room = self._program.load(phase), self._program.ambient(phase)[:, 0]
        angles, best = start.angles, None
        for _ in range(REFINEMENTS):
            wrist = TrueWrist(self.table, true_laws(self.table, self.settings))
            true = wrist.run(self.time_s, angles, load, room)
            error = self._twist(true.rotation, true.shift)
            size = np.linalg.norm(self._pointing(error))
            if best is None or size < best[0]:
                best = size, replace(start, angles=angles, residual=true.shift)
            angles = angles - np.einsum("nij,nj->ni", self._cancelling, error)
        assert best is not None
        return self.driven(best[1])

    def corrected(self, model: ErrorModel) -> Corrected:
        """Return what the corrector with a model sends for these motions."""
        contact = ContactSettings("gain", gain=1.0)
        stream = CorrectionStream(model, StreamSettings(contact=contact), enabled=True)
        stamps = START_NS + np.round(1e9 * self.time_s).astype(np.int64)
        warm = THERMOMETER_STEP_K * np.round(self.heard.temperature / THERMOMETER_STEP_K)
        angles, residual = np.empty_like(self.wanted), np.zeros((len(stamps), 3))
        faults = []
        once_a_second = max(1, round(self.settings.rate_hz))
        for i, stamp in enumerate(stamps.tolist()):
            if i % once_a_second == 0:
                for name, celsius in zip(SENSED, warm[i].tolist(), strict=True):
                    stream.temperatures.add(name, stamp, celsius)
            wrench = self.heard.wrench[i].tolist()
            stream.loads.add(stamp, BASE_FRAME, wrench[:3], wrench[3:])
            command = stream.on_command(stamp, "", NAMES, self.wanted[i].tolist())
            angles[i] = command.theta
            if command.fault is not None:
                faults.append(f"{self.time_s[i]:.2f} s: {command.fault}")
            if command.correction is not None:
                residual[i] = command.correction.after[:3]
        return Corrected(angles, residual, tuple(faults))

    def _error(self, sample: CellSample) -> Array:
        return self._twist(sample.pose_rotation, sample.pose_shift)

    def _twist(self, rotation: Array, shift: Array) -> Array:
        return log_motion(rotation @ np.swapaxes(self._desired.platform, -1, -2), shift)

    def _pointing(self, error: Array) -> Array:
        return np.einsum("nij,nj->ni", self._task, error)

    def _left(self, error: Array, handed_on: Array) -> Left:
        square = np.sum(self._pointing(error) ** 2, axis=1) + self._count**2
        return Left(
            float(np.sqrt(square[self._counts].mean())),
            float(np.sqrt(square[self._rests].mean())),
            rms((error[:, :3] - handed_on)[self._counts]),
            0,
            0,
        )


def with_fine_counts(table: Table) -> Table:
    """Return the table of a wrist whose motors stop where they are told."""
    geometry = dict(table.header.geometry)
    geometry["limits"] = {**geometry["limits"], "encoder_step_deg": 1e-7}
    return replace(table, header=replace(table.header, geometry=geometry))


def rms(vectors: Array) -> float:
    """Return the root mean square of the norms of (n, d)."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def turning_points(values: Array, least: float) -> int:
    """Return how often (n,) values turn round by at least so much."""
    count, sense, extreme = 0, 0, values[0]
    for value in values.tolist():
        if sense * (value - extreme) >= 0.0 and sense:
            extreme = value
        elif abs(value - extreme) >= least:
            count += sense != 0
            sense, extreme = (1 if value > extreme else -1), value
    return count
