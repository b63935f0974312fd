"""From a case to the sessions that a diagnosis is given."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from zlib import crc32

import numpy as np
from bench_wrist import RATE_HZ, Array, wrist
from cases import Case

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Block
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.reading.machine_signals import MachineSignals
from wrist_stiffness.sessions.reading.pose_track import MeasuredTrack
from wrist_stiffness.sessions.reading.session import session_of
from wrist_stiffness.sessions.reading.signals import Signal
from wrist_stiffness.simulation.catalogue import ALL, HiddenEffect
from wrist_stiffness.simulation.cell import SENSED, CellSample, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import instrument
from wrist_stiffness.simulation.size import Scale

PROGRAM_SEED = 101
"""Of the first session; the second has the next one."""

LEAST_SHARE = 0.5
"""Of the wanted size: effects that can only be smaller are not posed."""

THERMOMETER_STEP_K = 0.1
"""As in the recordings, once a second."""


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
    whole = replace(settings_of(case, 0), sees="pose", lost_beams=0.0)
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


def run_cell(case: Case, hidden: tuple[HiddenEffect, ...], session: int) -> CellSample:
    """Return what the sensors say in one session of a wrist with these effects."""
    settings = replace(settings_of(case, session), hidden=hidden)
    cell = VirtualCell(wrist(), settings, np.random.default_rng(noise_seed(case, session)))
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
    track = MeasuredTrack(
        time_ns[told], recorded.shift[told], recorded.rotation[told], recorded.covariance
    )
    session = session_of(recorded.name, machine, track, wrist())
    return replace(session, notes=recorded.notes)


def observe(case: Case, hidden: tuple[HiddenEffect, ...], session: int) -> MeasuredSession:
    """Return one session of a wrist with these effects as a user has it.

    Raises
    ------
    InputError
        If the wrist with all of them finds no equilibrium, or reading refuses the session.
    """
    return as_read(measured_session(case, session, run_cell(case, hidden, session)))
