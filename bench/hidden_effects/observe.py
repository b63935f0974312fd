"""From a case to what a solver is given: residuals of dwells and of moments in motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from bench_wrist import RATE_HZ, SECONDS, Array
from cases import Case

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.simulation.catalogue import ALL, HiddenEffect
from wrist_stiffness.simulation.cell import SENSED, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise, instrument
from wrist_stiffness.simulation.residual import residual
from wrist_stiffness.simulation.size import Scale, sample_covariance

MOVING_EVERY = 10
"""One sample in so many counts as a unit of its own while the wrist moves."""

QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))


@dataclass(frozen=True)
class Session:
    """Units of one session: means over dwells, and single samples in motion.

    Parameters
    ----------
    residual : (u, 6) float
        Measured against the table [m, rad].
    covariance : (u, 6, 6) float
        Of a unit on its own: white noise and hidden encoder counts.
    wander : (6u, 6u) float
        Covariance that the slow wander of the pose sensor adds, between units as well.
    conditions : (u, 14) float
        Motor angles, speeds and senses of the last motion, load, time and temperature of the
        frame, each of the order of one.
    """

    residual: Array
    covariance: Array
    wander: Array
    conditions: Array


@dataclass(frozen=True)
class Riddle:
    """A case as a solver gets it: learn from the first session, be judged by the second.

    Parameters
    ----------
    case : Case
        The answer; only the baseline that is told may look.
    hidden : tuple of HiddenEffect
        With magnitudes; likewise.
    train, test : Session
        Two days of the same wrist.
    floor : (u, 6) float
        Residuals of the second day of a wrist that is exactly its table, with the same noise:
        for scores only.
    """

    case: Case
    hidden: tuple[HiddenEffect, ...]
    train: Session
    test: Session
    floor: Array


def settings_of(case: Case, session: int) -> CellSettings:
    """Return the settings of one session of a case, without its effects."""
    return CellSettings(
        rate_hz=RATE_HZ,
        program_seconds=SECONDS,
        program_seed=101 + session,
        experiment=case.experiment,
        instrument=case.instrument,
        base=case.base,
        base_seed=case.seed,
        session=session,
    )


def times() -> Array:
    """Return the times of the samples of a session [s]."""
    return np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ


def unit_labels(cell: VirtualCell, time_s: Array) -> np.ndarray:
    """Return the number of the unit that each sample belongs to, -1 for none, (n,)."""
    program = np.concatenate([cell.desired(time_s), cell.program.load(time_s)], axis=1)
    still = ~np.any(np.diff(program, axis=0, prepend=program[:1]) != 0.0, axis=1)
    labels = np.full(len(time_s), -1)
    number = -1
    for i, rests in enumerate(still):
        if rests and (i == 0 or not still[i - 1]):
            number += 1
        if rests:
            labels[i] = number
        elif i % MOVING_EVERY == 0:
            number += 1
            labels[i] = number
    return labels


def unit_means(labels: np.ndarray, values: Array) -> Array:
    """Return the mean of samples (n, ...) over each unit, (u, ...)."""
    used = labels >= 0
    _, place = np.unique(labels[used], return_inverse=True)
    out = np.zeros((place.max() + 1, *values.shape[1:]))
    np.add.at(out, place, values[used])
    counts = np.bincount(place).reshape(-1, *([1] * (values.ndim - 1)))
    return out / counts


def hidden_effects(table: Table, case: Case) -> tuple[HiddenEffect, ...]:
    """Return the case's effects with the magnitudes that have its size in the first session.

    Raises
    ------
    InputError
        If one cannot be as large as that.
    """
    if not case.effects:
        return ()
    scale = Scale(table, settings_of(case, 0), SECONDS)
    return tuple(
        scale.sized(
            HiddenEffect(*place, ALL[place[0]].plausible, 1000 * case.seed + number), case.size
        )
        for number, place in enumerate(case.effects)
    )


def observe(table: Table, case: Case, hidden: tuple[HiddenEffect, ...], session: int) -> Session:
    """Run one session of a case."""
    settings = replace(settings_of(case, session), hidden=hidden)
    time_s = times()
    cell = VirtualCell(table, settings, np.random.default_rng([case.seed, session]))
    command = cell.desired(time_s)
    sample = cell.run(time_s, command)
    labels = unit_labels(cell, time_s)
    pose = instrument(case.instrument)
    white = np.repeat([pose.shift.white, pose.rotation.white], 3)
    slow = np.repeat([pose.shift.wander, pose.rotation.wander], 3)
    used = labels[labels >= 0]
    counts = np.bincount(used)[np.unique(used)]
    theta, at = unit_means(labels, sample.encoder), unit_means(labels, time_s)
    covariance = sample_covariance(table, theta, case.instrument) - np.diag(slow**2)
    covariance -= (1.0 - 1.0 / counts)[:, None, None] * np.diag(white**2)
    alike = np.exp(-np.abs(at[:, None] - at) / pose.shift.wander_time_s)
    speed = np.diff(command, axis=0, prepend=command[:1]) * RATE_HZ
    conditions = np.column_stack(
        [
            theta,
            2.0 * unit_means(labels, speed),
            0.5 * unit_means(labels, last_sense(speed)),
            unit_means(labels, sample.wrench) / np.repeat([1.0, 0.02], 3),
            at / SECONDS,
            unit_means(labels, sample.temperature[:, SENSED.index("frame")]) / 5.0,
        ]
    )
    return Session(
        unit_means(labels, residual(table, sample)),
        covariance,
        np.kron(alike, np.diag(slow**2)),
        conditions,
    )


def last_sense(speed: Array) -> Array:
    """Return the sign of each motor's motion now or before its rest, (n, 2)."""
    out = np.sign(speed)
    for i in range(1, len(out)):
        out[i] = np.where(out[i] == 0.0, out[i - 1], out[i])
    return out


def pose_riddle(table: Table, case: Case) -> Riddle | None:
    """Return a case ready to be solved, None where its size is out of reach."""
    try:
        hidden = hidden_effects(table, case)
    except InputError:
        return None
    train, test = (observe(table, case, hidden, session) for session in (0, 1))
    floor = observe(table, replace(case, effects=(), base="exact"), (), 1).residual
    return Riddle(case, hidden, train, test, floor)
