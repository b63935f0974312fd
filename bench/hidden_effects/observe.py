"""From a case to what a solver is given: measured sessions, and their residuals as units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from zlib import crc32

import numpy as np
from bench_wrist import RATE_HZ, Array, Mask, wrist
from cases import WRISTS, Case
from registered import Registration, difference, register
from units import last_sense, lost_samples, unit_labels, unit_means

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Block
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.reading.machine_signals import MachineSignals
from wrist_stiffness.sessions.reading.pose_track import PoseTrack
from wrist_stiffness.sessions.reading.session import session_of
from wrist_stiffness.sessions.reading.signals import Signal
from wrist_stiffness.simulation.catalogue import ALL, HiddenEffect
from wrist_stiffness.simulation.cell import SENSED, CellSample, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise, instrument
from wrist_stiffness.simulation.size import BasePose, Scale, base_pose, sample_covariance

PROGRAM_SEED = 101
"""Of the first session; the second has the next one."""

LEAST_SHARE = 0.5
"""Of the wanted size: effects that can only be smaller are not posed."""

SPREAD = 0.7
"""Of the logarithm of an ordinary wrist's magnitudes about the plausible one."""

QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))

THERMOMETER_STEP_K = 0.1
"""As in the recordings, once a second."""


@dataclass(frozen=True)
class Session:
    """Units of one session: means over dwells, and single samples in motion.

    Parameters
    ----------
    residual : (u, 6) float
        Measured against the table after registration [m, rad]; zero where not measured.
    measured : (u, 6) bool
        Which components were.
    covariance : (u, 6, 6) float
        Of a unit on its own: white noise and hidden encoder counts.
    wander : (6u, 6u) float
        Covariance that the slow wander of the pose sensor adds, between units as well.
    conditions : (u, 14) float
        Motor angles, speeds and senses of the last motion, load, time and temperature of the
        frame, each of the order of one.
    """

    residual: Array
    measured: Mask
    covariance: Array
    wander: Array
    conditions: Array


@dataclass(frozen=True)
class Day:
    """One session in all its forms.

    Parameters
    ----------
    recorded : MeasuredSession
        What a recording would hold, lost beams too; a row for each sample.
    units : Session
        The same as one table.
    base : BasePose
        What the table predicts for each sample, in F.
    registration : Registration
        That was taken off the residuals.
    labels : (n,) int
        Unit of each sample.
    """

    recorded: MeasuredSession
    units: Session
    base: BasePose
    registration: Registration
    labels: np.ndarray

    @cached_property
    def read(self) -> MeasuredSession:
        """What a user has of the session: `recorded` as a recording is read."""
        return as_read(self.recorded)

    def explained(self, rotation: Array, shift: Array) -> Array:
        """Return what predicted poses (n, 3, 3), (n, 3) in F explain of the residual, (u, 6)."""
        seen, base = (
            self.registration.seen(each) for each in (BasePose(rotation, shift), self.base)
        )
        return unit_means(self.labels, difference(seen.rotation, seen.shift, base))


@dataclass(frozen=True, eq=False)
class Riddle:
    """A case as a solver gets it: learn from the first day, be judged by the second.

    Parameters
    ----------
    case : Case
        The answer; only a baseline that is told may look.
    hidden : tuple of HiddenEffect
        With magnitudes; likewise.
    days : (Day, Day)
        Two days of the same wrist.
    bare_days : (Day, Day)
        The same days, noise for noise, of the same wrist without the hidden effects: for scores
        and for the baseline that is told.
    parts : dict of str to (u, 6) float
        Of an ordinary wrist: what each effect alone does to the second day.
    """

    case: Case
    hidden: tuple[HiddenEffect, ...]
    days: tuple[Day, Day]
    bare_days: tuple[Day, Day]
    parts: dict[str, Array] = field(default_factory=dict)

    @property
    def bare(self) -> tuple[Session, Session]:
        """Units of the days without the hidden effects."""
        return self.bare_days[0].units, self.bare_days[1].units

    @property
    def train(self) -> Session:
        """Units of the first day."""
        return self.days[0].units

    @property
    def test(self) -> Session:
        """Units of the second day."""
        return self.days[1].units


def settings_of(case: Case, session: int) -> CellSettings:
    """Return the settings of one session of a case, without its effects."""
    return CellSettings(
        rate_hz=RATE_HZ,
        program_seconds=case.seconds,
        program_seed=PROGRAM_SEED + session,
        experiment=case.experiment,
        instrument=case.instrument,
        sees=case.sees,
        lost_beams=case.lost_beams,
        base=case.base,
        base_seed=case.seed,
        session=session,
        truth=case.path,
    )


def noise_seed(case: Case, session: int) -> int:
    """Return the seed of all noise of one session: cases of one wrist in one design share it."""
    return crc32(f"{case.bare.key}|{session}".encode())


def times(case: Case) -> Array:
    """Return the times of the samples of a session [s]."""
    return np.arange(round(case.seconds * RATE_HZ)) / RATE_HZ


@lru_cache(maxsize=64)
def _scale(settings: CellSettings, seconds: float) -> Scale:
    return Scale(wrist(), settings, seconds)


def scale_of(case: Case) -> Scale:
    """Return the measure of sizes in the first session of a case."""
    # Sizes do not depend on what the sensor sees: cases share the work.
    whole = replace(settings_of(case, 0), sees="pose", lost_beams=0.0, truth="fast")
    return _scale(whole, case.seconds)


def hidden_effects(case: Case) -> tuple[HiddenEffect, ...]:
    """Return the case's effects with their magnitudes: its size in the first session.

    Raises
    ------
    InputError
        If one cannot even be half as large.
    """
    shape = 1000 * case.seed
    drawn = [
        HiddenEffect(*place, ALL[place[0]].plausible, shape + number)
        for number, place in enumerate(case.effects)
    ]
    if case.ordinary:
        factors = np.exp(SPREAD * np.random.default_rng(shape).normal(size=len(drawn)))
        return tuple(
            replace(each, magnitude=min(f * each.magnitude, ALL[each.effect].largest))
            for each, f in zip(drawn, factors, strict=True)
        )
    return tuple(_sized(scale_of(case), each, case.size) for each in drawn)


def _sized(scale: Scale, start: HiddenEffect, size: float) -> HiddenEffect:
    """Return the effect at a size, or at the largest it can have if that is half of it at least."""
    try:
        return scale.sized(start, size)
    except InputError:
        largest = replace(start, magnitude=ALL[start.effect].limit)
        if scale.size(largest) >= LEAST_SHARE * size:
            return largest
        raise


def run_cell(
    case: Case, hidden: tuple[HiddenEffect, ...], session: int, quiet: bool = False
) -> CellSample:
    """Return what the sensors say in one session of a wrist with these effects.

    `quiet`: sensors without noise that always measure, and the same rests within the count.
    """
    settings = replace(settings_of(case, session), hidden=hidden)
    if quiet:
        settings = replace(settings, instrument="ideal", load_sensor=QUIET)
    seed = 0 if quiet else noise_seed(case, session)
    cell = VirtualCell(wrist(), settings, np.random.default_rng(seed))
    time_s = times(case)
    return cell.run(time_s, cell.desired(time_s))


def measured_session(case: Case, session: int, sample: CellSample) -> MeasuredSession:
    """Return a session as a recording would hold it."""
    time_s, name = times(case), f"day_{session + 1}"
    held = np.arange(len(time_s)) // round(RATE_HZ) * round(RATE_HZ)
    shown = THERMOMETER_STEP_K * np.round(sample.temperature / THERMOMETER_STEP_K)
    slow = dict(zip(SENSED, shown[held].T, strict=True))
    pose = instrument(case.instrument)
    white = np.repeat([pose.shift.white, pose.rotation.white], 3)
    return MeasuredSession(
        name,
        Block(time_s, sample.encoder, sample.wrench, sample.speed, temperatures=slow),
        sample.measured_shift,
        sample.measured_rotation,
        np.diag(white**2),
        {"pose_sensor": case.instrument, "session": name, "load_source": "ft"},
    )


def as_read(recorded: MeasuredSession) -> MeasuredSession:
    """Return a session as the product's own reading of its recording gives it.

    Raises
    ------
    InputError
        If reading refuses it.
    """
    block = recorded.block
    time_ns = np.round(block.time * NANOSECONDS).astype(np.int64)
    # A thermometer tells its newest value once a second: the same is held in between.
    slow = {name: Signal(time_ns, values) for name, values in block.temperatures.items()}
    machine = MachineSignals(
        Signal(time_ns, block.theta),
        None if block.theta_dot is None else Signal(time_ns, block.theta_dot),
        Signal(time_ns, block.load),
        False,
        slow,
        {},
    )
    # Of a sample without any reading there is no message.
    told = recorded.measured.any(axis=1)
    track = PoseTrack(
        time_ns[told], recorded.shift[told], recorded.rotation[told], recorded.covariance
    )
    session = session_of(recorded.name, machine, track, wrist())
    return replace(session, notes=recorded.notes)


def observe(
    case: Case, hidden: tuple[HiddenEffect, ...], session: int, bare: Day | None = None
) -> Day:
    """Run one session of a case; `bare` is the same session without what hides."""
    return day_of(case, session, run_cell(case, hidden, session), bare)


@lru_cache(maxsize=2 * WRISTS)
def bare_day(case: Case, session: int) -> Day:
    """Return a session in which nothing hides; cases of one wrist share it."""
    return observe(case, (), session)


def day_of(case: Case, session: int, sample: CellSample, bare: Day | None = None) -> Day:
    """Return a session in all its forms."""
    table, time_s = wrist(), times(case)
    cell = VirtualCell(table, settings_of(case, session), np.random.default_rng(0))
    labels = unit_labels(cell.program, time_s, case.static)
    base = _base_of(sample, bare)
    rotation, shift = sample.measured_rotation.copy(), sample.measured_shift.copy()
    if case.lost_beams:
        lost = lost_samples(difference(rotation, shift, base))
        rotation[lost], shift[lost] = np.nan, np.nan
    found = register(rotation, shift, base)
    left = unit_means(labels, difference(rotation, shift, found.seen(base)))
    return Day(
        measured_session(case, session, sample),
        _session(case, cell, sample, labels, left),
        base,
        found,
        labels,
    )


def _session(
    case: Case, cell: VirtualCell, sample: CellSample, labels: np.ndarray, left: Array
) -> Session:
    """Return units with residuals (u, 6) that are NaN where not measured."""
    time_s = times(case)
    pose = instrument(case.instrument)
    white = np.repeat([pose.shift.white, pose.rotation.white], 3)
    slow = np.repeat([pose.shift.wander, pose.rotation.wander], 3)
    counts = np.bincount(labels[labels >= 0])
    theta, at = unit_means(labels, sample.encoder), unit_means(labels, time_s)
    covariance = sample_covariance(wrist(), theta, case.instrument) - np.diag(slow**2)
    covariance -= (1.0 - 1.0 / counts)[:, None, None] * np.diag(white**2)
    alike = np.exp(-np.abs(at[:, None] - at) / pose.shift.wander_time_s)
    command = cell.desired(time_s)
    speed = np.diff(command, axis=0, prepend=command[:1]) * RATE_HZ
    conditions = np.column_stack(
        [
            theta,
            2.0 * unit_means(labels, speed),
            0.5 * unit_means(labels, last_sense(speed)),
            unit_means(labels, sample.wrench) / np.repeat([1.0, 0.02], 3),
            at / case.seconds,
            unit_means(labels, sample.temperature[:, SENSED.index("frame")]) / 5.0,
        ]
    )
    return Session(
        np.nan_to_num(left),
        np.isfinite(left),
        covariance,
        np.kron(alike, np.diag(slow**2)),
        conditions,
    )


def _base_of(sample: CellSample, bare: Day | None) -> BasePose:
    """Return what the table predicts; the same as for the bare day where readings are the same."""
    if bare is not None:
        block = bare.recorded.block
        if np.array_equal(sample.encoder, block.theta) and np.array_equal(
            sample.wrench, block.load
        ):
            return bare.base
    return base_pose(wrist(), sample.encoder, sample.wrench)


def pose_riddle(case: Case) -> Riddle:
    """Return a case ready to be solved.

    Raises
    ------
    InputError
        If its size is out of reach, or the wrist with all of it finds no equilibrium.
    """
    hidden = hidden_effects(case)
    bare = bare_day(case.bare, 0), bare_day(case.bare, 1)
    if not hidden:
        return Riddle(case, hidden, bare, bare)
    one, two = (observe(case, hidden, session, bare[session]) for session in (0, 1))
    parts = {}
    if case.ordinary:
        for each in hidden:
            alone = observe(case, (each,), 1, bare[1]).units.residual
            parts[f"{each.effect}@{each.component}"] = alone - bare[1].units.residual
    return Riddle(case, hidden, (one, two), bare, parts)
