"""The virtual cell: motors, wrist, load, load sensor and pose sensor, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import UnreachablePoseError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.kinematics import angles_text, first_where
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.simulation.base import base_laws
from wrist_stiffness.simulation.block import Rate, taken
from wrist_stiffness.simulation.catalogue import HiddenEffect, build
from wrist_stiffness.simulation.experiment import experiment
from wrist_stiffness.simulation.heat import HEATED
from wrist_stiffness.simulation.instrument import LoadSensor, NoiseSource, PoseView, instrument
from wrist_stiffness.simulation.laws.law import Law
from wrist_stiffness.simulation.program import Program
from wrist_stiffness.simulation.wrist import TrueState, TrueWrist

SENSED = (*HEATED, "ambient")
"""Bodies whose temperature the cell knows."""


@dataclass(frozen=True)
class CellSettings:
    """What the cell does and with which sensors; the seed of its noise is not part of it.

    Raises `InputError` if the instrument or its view is not known.
    """

    rate_hz: float = 100.0  # samples per second, positive
    # about how long the program takes before it repeats, positive [s]
    program_seconds: float = 120.0
    program_seed: int = 0  # chooses poses and loads of the program
    experiment: str = "rich"  # design of the program, one of `experiment.EXPERIMENTS`
    instrument: str = "interferometer"  # pose sensor: `interferometer`, `tracker`, `cmm` or `ideal`
    sees: str = "pose"  # what of the pose it measures, one of `instrument.VIEWS`
    lost_beams: float = 0.0  # share of its samples that are missing or wild
    load_sensor: LoadSensor = LoadSensor()  # noise of the load estimate
    hidden: tuple[HiddenEffect, ...] = ()  # what the true wrist has besides its base
    # `base`, `base_seed`: `exact`, or `wrong` as the seed draws it
    base: str = "exact"
    base_seed: int = 0
    session: int = 0  # number of the session: registrations of a wrong base differ between them

    def __post_init__(self) -> None:
        """Check the instrument and its view."""
        instrument(self.instrument)
        PoseView(self.sees, self.lost_beams, np.random.default_rng(0))


class Drive:
    """Both motors with their position loops and encoders.

    A loop is satisfied as soon as the shaft lies within half a count of what was sent: where it
    stops there differs from move to move, and no encoder shows it.

    `step`: encoder step [rad]; `rng`: belongs to the drive alone.
    """

    SETTLING_S = 0.1
    """Time constant with which the shaft goes to another place within the count."""

    SPEED_UNIT = float(np.radians(0.01))
    """In which a drive tells its speed [rad/s]."""

    def __init__(self, step: float, rng: np.random.Generator) -> None:
        self._step = step
        self._rng = rng
        self._time_s: float | None = None
        self._sent = np.zeros(2)
        self._moving = np.zeros(2, dtype=bool)
        self._goal = self._draw()
        self._rest = self._goal

    def shaft(self, time_s: Array, sent: Array) -> Array:
        """Return the shaft angles (n, 2) for the next n times (n,) [s] and angles sent [rad]."""
        out = np.empty_like(sent)
        for i, angles in enumerate(sent):
            if self._time_s is not None:
                moving = angles != self._sent
                started = moving & ~self._moving
                if started.any():
                    self._goal = np.where(started, self._draw(), self._goal)
                stay = np.exp(-max(time_s[i] - self._time_s, 0.0) / self.SETTLING_S)
                self._rest = self._goal + stay * (self._rest - self._goal)
                self._moving = moving
            self._time_s, self._sent = float(time_s[i]), angles
            out[i] = angles + self._rest
        return out

    def read(self, shaft: Array) -> Array:
        """Return what the encoders show for shaft angles (n, 2) [rad]."""
        return self._step * np.round(shaft / self._step)

    def tell(self, speed: Array) -> Array:
        """Return the speeds that the drives tell for those (n, 2) that they see [rad/s]."""
        return self.SPEED_UNIT * np.round(speed / self.SPEED_UNIT)

    def _draw(self) -> Array:
        return self._step * self._rng.uniform(-0.5, 0.5, 2)


@dataclass(frozen=True)
class CellSample:
    """What happened and what the sensors said, for one sample or n of them."""

    encoder: Array  # (..., 2), motor angles as measured [rad]
    speed: Array  # (..., 2), motor speeds as the drives tell them [rad/s]
    wrench: Array  # (..., 6), load on the platform at O in F as measured [N, N m]
    pose_rotation: Array  # (..., 3, 3), True rotation U -> F of the platform
    pose_shift: Array  # (..., 3), True position of the platform's point O in F [m]
    measured_rotation: Array  # (..., 3, 3), rotation as measured; NaN where it is not
    measured_shift: Array  # (..., 3), position as measured [m]; NaN where it is not
    temperature: Array  # (..., 8), of `SENSED` [degC]


def true_laws(table: Table, settings: CellSettings) -> list[Law]:
    """Return all laws by which the true wrist departs from its table.

    The base first: a soft drive beside a soft bushing is no softer for it.
    """
    return [
        *base_laws(settings.base, table, settings.base_seed, settings.session),
        *(build(hidden, table) for hidden in settings.hidden),
    ]


class VirtualCell:
    """A wrist at work.

    `table`: its elastic base: what the true wrist is made of.  `settings`: program and sensors.
    `rng`: all noise comes from it; the same state gives the same samples to the bit.
    """

    def __init__(self, table: Table, settings: CellSettings, rng: np.random.Generator) -> None:
        self.table = table
        self.settings = settings
        self.program: Program = experiment(
            settings.experiment,
            table.workspace,
            np.random.default_rng(settings.program_seed),
            settings.program_seconds,
        )
        self._laws = true_laws(table, settings)
        for law in self._laws:
            law.told(self.program)
        self._wrist = TrueWrist(table, self._laws)
        drive_rng, load_rng, pose_rng, view_rng = rng.spawn(4)
        sensor, pose_sensor = settings.load_sensor, instrument(settings.instrument)
        self._static = pose_sensor.static
        self._view = PoseView(settings.sees, settings.lost_beams, view_rng)
        self._drive = Drive(table.geometry.limits.encoder_step, drive_rng)
        self._departs = Rate()
        self._load_noise = NoiseSource(sensor.force, sensor.moment, load_rng)
        self._pose_noise = NoiseSource(pose_sensor.shift, pose_sensor.rotation, pose_rng)

    def desired(self, time_s: float | Array) -> Array:
        """Return the nominal motor command (..., 2) [rad] at times since the start (...) [s]."""
        return self.program.sent(np.asarray(time_s))

    def step(self, time_s: float, sent: Array) -> CellSample:
        """Advance to a time.

        `time_s`: time since the start, later than that of the step before [s]; `sent` (2,): motor
        angles that the motors are to follow [rad].  Gives `CellSample`: arrays without a leading
        axis.  Raises `UnreachablePoseError` if an angle is beyond the end stops, or the loop does
        not close.
        """
        return taken(self.run(np.array([time_s]), np.asarray(sent, dtype=float)[None]), 0)

    def run(self, time_s: Array, sent: Array) -> CellSample:
        """Advance through a block of samples; as `step` one by one, and faster.

        `time_s` (n,): increasing times since the start [s]; `sent` (n, 2): motor angles that the
        motors are to follow [rad].  Gives `CellSample`: arrays with a leading axis of n.  Raises
        `UnreachablePoseError` if an angle is beyond the end stops, or the loop does not close.
        """
        self._stop_at_ends(sent)
        shaft = self._drive.shaft(time_s, sent)
        phase = self.program.phase(time_s)
        load, room = self.program.load(phase), self.program.ambient(phase)[:, 0]
        true = self._wrist.run(time_s, shaft, load, room)
        encoder, wrench, rotation, shift = self._readings(time_s, shaft, load, true)
        noise = self._pose_noise(time_s)
        # A tracker's errors in position and orientation are separate, not one rigid motion.
        wobble, _ = exp_twist(noise)
        rotation, shift = self._view(wobble @ rotation, shift + noise[:, :3])
        if self._static:
            unseen = ~self._rest_ends(time_s)
            rotation[unseen], shift[unseen] = np.nan, np.nan
        return CellSample(
            encoder=encoder,
            speed=self._told_speed(time_s, sent),
            wrench=wrench + self._load_noise(time_s),
            pose_rotation=true.rotation,
            pose_shift=true.shift,
            measured_rotation=rotation,
            measured_shift=shift,
            temperature=self.table.geometry.reference_temperature
            + np.column_stack([true.block.temperature, room]),
        )

    def _rest_ends(self, time_s: Array) -> NDArray[np.bool_]:
        """Return which samples (n,) are the last of a rest under a steady load."""
        step = 1.0 / self.settings.rate_hz
        before, now, after = (
            np.concatenate([self.program.angles(phase), self.program.load(phase)], axis=1)
            for phase in (self.program.phase(time_s + k * step) for k in (-1, 0, 1))
        )
        return np.all(before == now, axis=1) & np.any(after != now, axis=1)

    def _readings(
        self, time_s: Array, shaft: Array, load: Array, true: TrueState
    ) -> tuple[Array, Array, Array, Array]:
        """Return what error-free noise-free sensors with the hidden laws say."""
        wrench, rotation, shift = load, true.rotation, true.shift
        for law in self._laws:
            shaft = law.read_shaft(time_s, shaft)
            wrench = law.read_load(true.block, wrench)
            rotation, shift = law.read_pose(true.block, rotation, shift)
        return self._drive.read(shaft), wrench, rotation, shift

    def _told_speed(self, time_s: Array, sent: Array) -> Array:
        """Return what the drives say of their speeds: the program's, and how that is departed from.

        What an encoder counts wrong is so small a part of a speed that it is left out.
        """
        departure = sent - self.desired(time_s)
        speed = self.program.speed(time_s) + self._departs(time_s, departure)
        for law in self._laws:
            speed = law.read_speed(time_s, speed)
        return self._drive.tell(speed)

    def _stop_at_ends(self, sent: Array) -> None:
        limits = self.table.geometry.limits
        inside = np.all((sent >= limits.joint_lower) & (sent <= limits.joint_upper), axis=-1)
        if not inside.all():
            low, high = np.degrees(limits.joint_lower), np.degrees(limits.joint_upper)
            raise UnreachablePoseError(
                f"motor angles {angles_text(first_where(sent, ~inside))}: beyond the end stops "
                f"({low[0]:g} to {high[0]:g}, {low[1]:g} to {high[1]:g})"
            )
