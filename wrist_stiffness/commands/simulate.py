"""Write a recording of the virtual cell."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness import topics
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.registry import unknown_effect
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording import messages as msg
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.chunk_writer import Messages
from wrist_stiffness.recording.fixed_layout import FixedLayout
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.sessions.refitted import SET_UP
from wrist_stiffness.simulation.catalogue import ALL, HiddenEffect
from wrist_stiffness.simulation.cell import SENSED, CellSample, CellSettings, VirtualCell
from wrist_stiffness.simulation.size import Scale, Secret, draw
from wrist_stiffness.topics import BASE_FRAME

START_NS = 1_700_000_000_000_000_000
"""Stamp of a recording's first sample: a fixed date, so that a seed gives the same bytes."""

DAY_NS = 86_400 * 10**9

LAST_DAY = 10_000
"""Stamps in nanoseconds end long after it."""

DAY_SEEDS = 1_000_003
"""From the seed of one day's noise and program to that of the next."""

BLOCK = 500
"""Samples in memory at a time."""

LONGEST_S, FASTEST_HZ = 24.0 * 3600.0, 5000.0
"""A recording is no longer and has no more samples per second than that."""


NOT_MEASURED = 1e6
"""Variance of a part of the pose that the sensor does not see [m^2, rad^2]."""

THERMOMETER_STEP_K = 0.1

TWO = (0.0, 0.0)
ROOM = 4 + len(SENSED)
"""Places for what is said of one sample."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Simulated:
    """What was written."""

    recording: Path
    samples: int  # samples on each topic
    seconds: float  # duration [s]


def simulate_recording(
    path: str | Path,
    table: Table,
    settings: CellSettings,
    seconds: float,
    seed: int,
    progress: Progress = silent,
    overwrite: bool = False,
) -> Simulated:
    """Let the virtual cell work and record it.

    `path`: rosbag2 folder, or file where it ends in `.mcap`; `settings`: program, rate, sensors;
    sessions are days; `seconds`: duration [s]; `seed`: of all noise; the same seed gives the same
    bytes; `progress`: told samples done and in all.  Raises `InputError` if duration or rate are
    out of bounds or the seed is negative; `RecordingError` if the recording exists or cannot be
    written.
    """
    check_bounds(seconds, settings.rate_hz, seed)
    cell = VirtualCell(table, settings, np.random.default_rng(seed))
    total = max(1, round(seconds * settings.rate_hz))
    thermometer = max(1, round(settings.rate_hz))
    start_ns = START_NS + settings.session * DAY_NS
    with RecordingWriter(path, overwrite=overwrite) as writer:
        notes = msg.String(json.dumps(recording_notes(table, settings), sort_keys=True))
        writer.write(topics.RECORDING_NOTES, notes, start_ns)
        for first in range(0, total, BLOCK):
            number = np.arange(first, min(first + BLOCK, total))
            time_s = number / settings.rate_hz
            sent = cell.desired(time_s)
            block = cell.run(time_s, sent)
            stamps_ns = start_ns + np.round(time_s * 1e9).astype(np.int64)
            warmth, whole = number % thermometer == 0, settings.sees == "pose"
            write_samples(writer, stamps_ns, sent, block, warmth, whole)
            progress(int(number[-1]) + 1, total)
    return Simulated(Path(path), total, total / settings.rate_hz)


def check_bounds(seconds: float, rate_hz: float, seed: int) -> None:
    """Refuse what would be no recording, or never end (InputError with the limit)."""
    if not 0.0 < seconds <= LONGEST_S:
        raise InputError(
            f"simulate: a duration of {seconds:g} s is not more than 0 and at most {LONGEST_S:g} s"
        )
    if not 0.0 < rate_hz <= FASTEST_HZ:
        raise InputError(
            f"simulate: a rate of {rate_hz:g} Hz is not more than 0 and at most {FASTEST_HZ:g} Hz"
        )
    if seconds * rate_hz < 1.0:
        raise InputError(f"simulate: {seconds:g} s at {rate_hz:g} Hz are less than one sample")
    if seed < 0:
        raise InputError(f"simulate: seed {seed} is negative")


def hide(
    name: str,
    size: float,
    table: Table,
    settings: CellSettings,
    seconds: float,
    tell: Callable[[str], None] = lambda text: None,
) -> CellSettings:
    """Return the settings with one more hidden effect of a wanted size.

    `name`: `NAME@COMPONENT` or `NAME@COMPONENT:FORM` of the catalogue; the first form by default.
    `size`: in units of one sample's noise, over this experiment.  `seconds`: its duration [s].
    `tell`: is told before every run of the experiment that finds the size.  Raises `InputError` if
    the name is not in the catalogue or the size cannot be had.
    """
    effect, _, place = name.partition("@")
    component, _, form = place.partition(":")
    if effect not in ALL:
        raise unknown_effect(effect, ALL)
    if not (np.isfinite(size) and size > 0.0):
        raise InputError(f"effect {name!r}: size {size:g} is not a positive number")
    entry = ALL[effect]
    if component not in entry.components:
        raise InputError(
            f"effect {name!r}: {effect} is at {', '.join(entry.components)} only; write "
            f"{effect}@{entry.components[0]}"
        )
    if form and form not in entry.forms:
        raise InputError(f"effect {name!r}: {effect} has the forms {', '.join(entry.forms)} only")
    start = HiddenEffect(
        effect, component, form or entry.forms[0], entry.plausible, settings.program_seed
    )
    hidden = Scale(table, settings, seconds, tell).sized(start, size)
    return replace(settings, hidden=(*settings.hidden, hidden))


def secret(
    seed: int,
    table: Table,
    settings: CellSettings,
    seconds: float,
    tell: Callable[[str], None] = lambda text: None,
) -> Secret:
    """Return what a seed draws (see `simulation.size.draw`) of what a diagnosis could find.

    What every session sets up anew is no riddle: nothing would be missing.
    """
    return draw(seed, table, settings, seconds, tell, without={law for law, _ in SET_UP})


def on_day(day: int, settings: CellSettings) -> CellSettings:
    """Return the settings of another day, from 1, of the same wrist with the same hidden effects.

    The instrument was set up anew, and the wrist moves to other poses under other loads.  Raises
    `InputError` if there is no such day.
    """
    if not 1 <= day <= LAST_DAY:
        raise InputError(f"simulate: day {day} is not 1 to {LAST_DAY}")
    later = DAY_SEEDS * (day - 1)
    return replace(settings, session=day - 1, program_seed=settings.program_seed + later)


def recording_notes(table: Table, settings: CellSettings) -> dict[str, str]:
    """Return the free facts that a user would know about the recording."""
    return {
        "wrist": table.geometry.name,
        "geometry_sha256": table.geometry.sha256,
        "pose_sensor": settings.instrument,
        "load_source": "ft",
        "session": "simulated",
    }


def write_samples(
    writer: RecordingWriter,
    stamps_ns: NDArray[np.int64],
    sent: Array,
    block: CellSample,
    warmth: Mask,
    whole: bool,
) -> None:
    """Write n samples as numbers: making and encoding each message as an object took longer.

    `stamps_ns` (n,): [ns].  `sent` (n, 2): motor commands [rad].  `block`: what the sensors said; a
    pose of which they measured nothing is not written.  `warmth` (n,): at which samples the
    thermometers speak.  `whole`: whether the pose sensor sees position and rotation; else a huge
    variance says which it does not.
    """
    out, there, nowhere = Messages(), msg.Header(frame_id=BASE_FRAME), msg.Header()

    def add(rank: int, topic: str, like: msg.Message, rows: Mask, *columns: Array) -> None:
        places, stamps = np.flatnonzero(rows), stamps_ns[rows]
        payloads = FixedLayout.of(like).rows(stamps, *(column[rows] for column in columns))
        number = writer.channel_id(channel_of(topic, type(like)))
        out.add(number, ROOM * places + rank, stamps, payloads)

    every = np.ones(len(stamps_ns), dtype=bool)
    # A load goes first, so that it has arrived with its joint state.
    add(0, topics.LOAD_ESTIMATE, msg.WrenchStamped(there), every, *block.wrench.T)
    command = msg.JointState(nowhere, DEFAULT_JOINTS, TWO)
    add(1, topics.MOTOR_COMMANDS, command, every, sent)
    state = msg.JointState(nowhere, DEFAULT_JOINTS, TWO, TWO)
    add(2, topics.JOINT_STATES, state, every, block.encoder, block.speed)
    moved, turned = _known(block.measured_shift), _known(block.measured_rotation)
    rotation = np.where(turned[:, None, None], block.measured_rotation, np.eye(3))
    pose = [
        *np.where(moved[:, None], block.measured_shift, 0.0).T,
        *Rotation.from_matrix(rotation).as_quat(canonical=True).T,
    ]
    seen = moved | turned
    if whole:
        add(3, topics.PLATFORM_POSE, msg.PoseStamped(there), seen, *pose)
    else:
        unseen = np.repeat(~np.stack([moved, turned], axis=1), 3, axis=1)
        variance = (NOT_MEASURED * unseen[:, :, None] * np.eye(6)).reshape(-1, 36)
        add(3, topics.PLATFORM_POSE, msg.PoseWithCovarianceStamped(there), seen, *pose, variance)
    noise = np.full(len(stamps_ns), THERMOMETER_STEP_K**2 / 12.0)
    for rank, (component, celsius) in enumerate(zip(SENSED, block.temperature.T, strict=True), 4):
        shown = THERMOMETER_STEP_K * np.round(celsius / THERMOMETER_STEP_K)
        like = msg.Temperature(msg.Header(frame_id=component))
        add(rank, topics.TEMPERATURES, like, warmth, shown, noise)
    writer.write_block(out)


def _known(part: Array) -> Mask:
    """Tell of which samples a part (n, ...) of the pose was measured, (n,): whole or not."""
    return np.isfinite(part.reshape(len(part), -1)[:, 0])
