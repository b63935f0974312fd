"""From a recording of this wrist to a measured session.

The rules are those of the nodes, seen from the stamp of a measured pose: the load is the newest one
that is not younger, held up to an age limit; temperatures and covariates are held.  Motor angles
are interpolated between the two joint states around the stamp, because motions are compared: at
10 ms between joint states and 30 deg/s a held angle is wrong by up to 300 mdeg.  In a dwell the
encoder's count is the same on both sides, so nothing is smoothed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.reading.clocks import ClockOffset, clock_offset
from wrist_stiffness.campaign.reading.machine_signals import MachineSignals, machine_signals
from wrist_stiffness.campaign.reading.path import GAP_S, turning_stamps
from wrist_stiffness.campaign.reading.pose_track import PoseTrack, pose_track
from wrist_stiffness.campaign.reading.registration import agreement, put_right
from wrist_stiffness.campaign.reading.signals import Signal, Stamps
from wrist_stiffness.campaign.reading.spikes import WINDOW, spikes
from wrist_stiffness.campaign.reading.static_frames import frames_of
from wrist_stiffness.campaign.rigid_rotation import rigid_rotation
from wrist_stiffness.campaign.table_range import beyond_range
from wrist_stiffness.compensation.intake import BASE_FRAME, Frames
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError, InputError, RecordingError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.recording.samples import DEFAULT_JOINTS, Samples
from wrist_stiffness.recording.topics import (
    JOINT_STATES,
    LOAD_ESTIMATE,
    MOTOR_COMMANDS,
    PLATFORM_MARKERS,
    PLATFORM_POSE,
)

Mask = NDArray[np.bool_]

GEOMETRY = "geometry_sha256"
"""Key of the notes: checksum of the geometry file of the wrist that was recorded."""

ANGLES_USED = 20_000
"""Joint states that are enough to tell the offset of the clocks."""

LEAST_POSES = 5

FAR_M = 0.02
"""Farther from O than registrations are: their refit would leave errors of its own [m]."""

OWN_CLOCK_S = 0.2
"""A larger offset is another clock and is taken out; a smaller one is the effect `time_delay`."""

OWN_CLOCK_PERIODS = 5.0
"""An offset of fewer sample periods is not told from the sampling."""

OWN_CLOCK_GAIN = 4.0
"""An offset that divides the mean square of the misfit by less is not believed."""

DENSE_S = 0.2
"""Median time between poses below which single ones are compared with their neighbours [s]."""

LEAST_SPIKE_M = 30e-6

LEAST_SPIKE_STEPS = 4.0
"""In encoder steps: in motion the measured rotation leaves the encoders' by counts."""

LATE_S = 0.1
"""So late a stamp may be: what turns meanwhile is no spike.  Positions of O hardly move."""

TURN_STEPS = 1.5
"""In encoder steps: a smaller swing between two poses is the chatter of a count."""

PULL_SHARE = 0.25
"""Of the load's range: a smaller pull between two poses may be noise."""

OTHER_GEOMETRY = float(np.radians(5.0))
"""Median angle between measured and rigid rotation that no effect explains."""


def read_session(
    path: str | Path,
    table: Table,
    *,
    remaps: Mapping[str, str] | None = None,
    joints: Sequence[str] = DEFAULT_JOINTS,
    frames: Frames | None = None,
    load_age_limit_s: float = StreamSettings.load_age_limit_s,
) -> MeasuredSession:
    """Read a recording with measured poses.

    Parameters
    ----------
    path : path
        rosbag2 folder with MCAP storage, or `.mcap` file.
    table : Table
        Of the wrist: its rigid kinematics, and its readout points as the nominal markers.
    remaps : mapping, optional
        Actual by standard topic name.
    joints : sequence of str
        Joint names of motor 1 and 2.
    frames : Frames, optional
        Sensor frames of loads, poses and markers, beside `wrist_base`, `wrist_platform` and those
        on the recording's `/tf_static`.
    load_age_limit_s : float
        Oldest load that still belongs to a measured pose [s].

    Returns
    -------
    MeasuredSession
        Named after the recording, with remarks on everything that could not be used.  Where poses
        are far apart, rows without a measurement tell where angles and load turned back in between.

    Raises
    ------
    RecordingError
        If the recording cannot be read, lacks a topic, or its clocks do not overlap.
    FrameError
        If loads or poses are in an unknown frame.
    InputError
        If too few poses are left, or they are those of another wrist.
    """
    recording = open_recording(path)
    samples = read_samples(recording, remaps=remaps, joints=joints, without=(MOTOR_COMMANDS,))
    require_topics(recording, samples, remaps or {})
    notes, unread = notes_of(samples)
    known = frames_of(recording, remaps or {}, frames or Frames())
    try:
        machine = machine_signals(samples, known.frames)
        markers = table.geometry.platform.readout_points
        track = pose_track(samples, markers, known.frames)
        session = session_of(recording.path.name, machine, track, table, load_age_limit_s)
    except (FrameError, InputError, RecordingError) as error:
        hints = known.hints if isinstance(error, FrameError) else map(str, samples.faults)
        raise type(error)("; ".join([f"{recording.path}: {error}", *hints])) from error
    damage = [f"the recording is damaged: {recording.damage}"] if recording.damage else []
    faults = [str(fault) for fault in samples.faults]
    other = _another_geometry(notes, table)
    said = (*damage, *unread, *other, *known.remarks, *faults, *session.remarks)
    return replace(session, notes=notes, remarks=said)


def session_of(
    name: str,
    machine: MachineSignals,
    track: PoseTrack,
    table: Table,
    load_age_limit_s: float = StreamSettings.load_age_limit_s,
) -> MeasuredSession:
    """Put the signals of a recording together: clocks, spikes, the way between poses.

    Parameters
    ----------
    name : str
        Of the session.
    machine : MachineSignals
        Angles, loads and what is slow.
    track : PoseTrack
        Measured poses in F.
    table, load_age_limit_s
        As in `read_session`.

    Returns
    -------
    MeasuredSession
        With remarks on everything that could not be used, and no notes.

    Raises
    ------
    RecordingError
        If the clocks do not overlap.
    InputError
        If too few poses are left, or they are those of another wrist.
    """
    remarks = list(track.remarks)
    _require_overlap(machine.angles.time_ns, track.time_ns)
    offset = _offset(machine, track, table)
    if offset is not None and _another_clock(offset, machine, track):
        remarks.append(
            f"the clock of the pose sensor is {offset.seconds:+.3f} s (uncertain by "
            f"{offset.sigma:.3f} s) from that of the joint states: taken out"
        )
        track = replace(track, time_ns=track.time_ns - round(offset.seconds * NANOSECONDS))
    usable, reasons = machine.usable(track.time_ns, load_age_limit_s)
    remarks += reasons
    time_ns, shift, rotation = track.time_ns[usable], track.shift[usable], track.rotation[usable]
    reachable = table.mechanism.reachable(machine.angles.interpolated(time_ns))
    if not reachable.all():
        remarks.append(
            f"{np.sum(~reachable)} measured poses are not used: the wrist cannot reach their angles"
        )
        time_ns, shift, rotation = time_ns[reachable], shift[reachable], rotation[reachable]
    if len(time_ns) == 0:
        raise InputError(f"no measured pose can be used: {'; '.join(remarks)}")
    block = machine.at(time_ns)
    rigid = rigid_rotation(table, block.theta)
    _require_same_wrist(rotation, rigid, block.theta, table)
    _require_near(shift)
    remarks += beyond_range(table, block)
    lost = _spikes(block.time, shift, rotation, rigid, table.geometry.limits.encoder_step)
    if lost.any():
        remarks.append(f"{lost.sum()} of {len(lost)} measured poses are spikes: left out")
        shift, rotation = shift.copy(), rotation.copy()
        shift[lost], rotation[lost] = np.nan, np.nan
    if np.all(block.load == block.load[0]):
        remarks.append(
            "the load never changes: what the load does and what is always there look the same"
        )
    path_ns = _path(machine, time_ns, table, load_age_limit_s)
    all_ns = np.union1d(time_ns, path_ns)
    rows = np.searchsorted(all_ns, time_ns)
    session = MeasuredSession(
        name,
        block if len(all_ns) == len(block) else machine.at(all_ns),
        _spread(shift, rows, len(all_ns)),
        _spread(rotation, rows, len(all_ns)),
        track.covariance,
        remarks=tuple(remarks),
        clock_offset_s=None if offset is None else (offset.seconds, offset.sigma),
    )
    known = int(session.measured.any(axis=1).sum())
    if known < LEAST_POSES:
        why = "; ".join(remarks) or "no more were recorded"
        raise InputError(
            f"{known} of {len(track)} measured poses can be used, at least {LEAST_POSES} are "
            f"needed ({why})"
        )
    return session


def _path(
    machine: MachineSignals, time_ns: Stamps, table: Table, load_age_limit_s: float
) -> Stamps:
    """Return the stamps that tell the way to the first pose and between poses far apart."""
    start = max(machine.angles.time_ns[0], machine.loads.time_ns[0])
    far = time_ns[0] - start > GAP_S * NANOSECONDS
    time_ns = np.append(start, time_ns) if far else time_ns
    step = table.geometry.limits.encoder_step
    turns = turning_stamps(machine.angles, time_ns, np.full(2, TURN_STEPS * step))
    pulls = turning_stamps(
        machine.loads, time_ns, PULL_SHARE * np.ptp(machine.loads.values, axis=0)
    )
    found = np.union1d(np.union1d(turns, pulls), time_ns[:1])
    found = found[machine.usable(found, load_age_limit_s)[0]]
    return found[table.mechanism.reachable(machine.angles.interpolated(found))]


def _spread(values: Array, rows: NDArray[np.intp], count: int) -> Array:
    """Return values (n, ...) at their rows among so many, NaN at the others."""
    if count == len(values):
        return values
    out = np.full((count, *values.shape[1:]), np.nan)
    out[rows] = values
    return out


def require_topics(recording: Recording, samples: Samples, remaps: Mapping[str, str]) -> None:
    """Refuse a recording that lacks angles, loads or measured poses, and say why."""
    there = [topic.name for topic in recording.topics if topic.count]
    needed = {
        (JOINT_STATES,): len(samples.joints.time_ns),
        (LOAD_ESTIMATE,): len(samples.loads.time_ns),
        (PLATFORM_POSE, PLATFORM_MARKERS): len(samples.poses.time_ns)
        + len(samples.markers.time_ns),
    }
    for topics, count in needed.items():
        if count:
            continue
        wanted = [remaps.get(topic, topic) for topic in topics]
        names = " or ".join(wanted)
        # A topic that was recorded and cannot be read has no other name.
        if recording.damage and (not there or not set(wanted).isdisjoint(there)):
            raise RecordingError(
                f"{recording.path}: nothing on {names} can be read: {recording.damage}; copy the "
                "recording again, or record anew"
            )
        damage = f"; {recording.damage}" if recording.damage else ""
        raise RecordingError(
            f"{recording.path}: nothing on {names} (topics that are there: "
            f"{', '.join(there) or 'none'}){damage}; name another with --topic STANDARD:=ACTUAL"
        )


def _require_overlap(angles_ns: Stamps, poses_ns: Stamps) -> None:
    if poses_ns[-1] < angles_ns[0] or poses_ns[0] > angles_ns[-1]:
        ranges = [
            f"{stamps[0] / NANOSECONDS:.3f} to {stamps[-1] / NANOSECONDS:.3f} s"
            for stamps in (angles_ns, poses_ns)
        ]
        raise RecordingError(
            f"the clocks do not overlap: joint states are stamped {ranges[0]}, measured poses "
            f"{ranges[1]}; synchronise the clocks or stamp the poses at reception"
        )


def _require_same_wrist(rotation: Array, rigid: Array, theta: Array, table: Table) -> None:
    known = np.isfinite(rotation).all(axis=(1, 2))
    if known.sum() < LEAST_POSES:
        return
    if not known.all():
        rotation, rigid, theta = rotation[known], rigid[known], theta[known]
    found = agreement(rotation, rigid)
    if found.misfit <= OTHER_GEOMETRY:
        return
    limit = f"limit {np.degrees(OTHER_GEOMETRY):g} deg"
    if change := put_right(rotation, theta, table, OTHER_GEOMETRY):
        turned = f"; so they do with the instrument turned by {np.degrees(found.turn):.0f} deg"
        raise InputError(
            "the measured rotations are not those that the motor angles say: half of them are more "
            f"than {np.degrees(found.misfit):.1f} deg ({limit}) off; with {change} they agree"
            + (turned if found.misfit_turned <= OTHER_GEOMETRY else "")
        )
    if found.misfit_turned > OTHER_GEOMETRY:
        raise InputError(
            "the measured rotations are not those of this wrist: half of them are more than "
            f"{np.degrees(found.misfit_turned):.1f} deg ({limit}) from what the motor angles say, "
            "however the instrument stands; check the table, and the joints' names, order and signs"
        )
    raise InputError(
        "the measured rotations are not about the axes of wrist_base: half of them are more than "
        f"{np.degrees(found.misfit):.1f} deg ({limit}) from what the motor angles say, unless the "
        f"instrument is turned by {np.degrees(found.turn):.0f} deg; map its frame, or check the "
        "joints' names, order and signs"
    )


def _require_near(shift: Array) -> None:
    """Refuse positions that no registration explains: a wrong unit or another frame."""
    known = np.isfinite(shift).any(axis=0)
    if not known.any():
        return
    off = np.where(known, np.nanmedian(np.abs(np.where(known, shift, 0.0)), axis=0), 0.0)
    worst = int(np.argmax(off))
    if off[worst] > FAR_M:
        raise InputError(
            f"the measured positions are not those of the platform's point O in {BASE_FRAME}: half "
            f"of them are more than {1e3 * off[worst]:.4g} mm (limit {1e3 * FAR_M:g} mm) from the "
            f"base's O along {'xyz'[worst]}; map the instrument's frame, or check the unit (m in a "
            "recording, mm in a table)"
        )


def _offset(machine: MachineSignals, track: PoseTrack, table: Table) -> ClockOffset | None:
    known = np.isfinite(track.rotation).all(axis=(1, 2))
    every = max(1, len(machine.angles) // ANGLES_USED)
    theta, time_ns = machine.angles.values[::every], machine.angles.time_ns[::every]
    reachable = table.mechanism.reachable(theta)
    if not known.any() or not reachable.any():
        return None
    rigid = Rotation.from_matrix(rigid_rotation(table, theta[reachable])).as_quat()
    turned = Signal(time_ns[reachable], rigid)
    return clock_offset(track.time_ns[known], track.rotation[known], turned)


def _another_clock(offset: ClockOffset, machine: MachineSignals, track: PoseTrack) -> bool:
    """Tell whether an offset is one of clocks, not a delay that the wrist's model can have."""
    period = max(_period_s(machine.angles.time_ns), _period_s(track.time_ns))
    least = max(OWN_CLOCK_S, OWN_CLOCK_PERIODS * period, 3.0 * offset.sigma)
    return abs(offset.seconds) > least and offset.gain > OWN_CLOCK_GAIN


def _spikes(time: Array, shift: Array, rotation: Array, rigid: Array, step: float) -> Mask:
    """Tell which poses stand out, of rotations also from what a late stamp does in motion."""
    if len(time) < 2 or np.median(np.diff(time)) > DENSE_S:
        return np.zeros(len(time), dtype=bool)
    turn = rotation @ np.swapaxes(rigid, 1, 2)
    axis = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    interval = np.diff(time)
    turned = log_motion(np.swapaxes(rigid[:-1], 1, 2) @ rigid[1:], np.zeros((len(interval), 3)))
    # Neighbours differ by half a window's turn at most: a count that flickers at 1 kHz is no speed.
    share = LATE_S / np.maximum(interval, LATE_S / (WINDOW // 2))
    swing = share * np.linalg.norm(turned[:, 3:], axis=1)
    near = np.max(sliding_window_view(np.pad(swing, WINDOW // 2), WINDOW - 1), axis=1)
    least = np.repeat([LEAST_SPIKE_M, LEAST_SPIKE_STEPS * step], 3) * np.ones((len(time), 1))
    least[:, 3:] += near[:, None]
    return spikes(np.hstack([shift, axis]), least)


def _period_s(time_ns: Stamps) -> float:
    return float(np.median(np.diff(time_ns))) / NANOSECONDS if len(time_ns) > 1 else 0.0


def _another_geometry(notes: Mapping[str, Any], table: Table) -> list[str]:
    """Return a warning where the notes name another geometry: a table may have been made anew."""
    said, own = notes.get(GEOMETRY), table.geometry.sha256
    if said in (None, own):
        return []
    return [
        f"note {GEOMETRY!r} is {str(said)[:12]}..., the table's geometry {own[:12]}... "
        f"({table.geometry.name}): the recording is of another wrist, or its geometry was changed"
    ]


def notes_of(samples: Samples) -> tuple[dict[str, Any], list[str]]:
    """Return the facts of all notes, later ones first choice, and what was no JSON."""
    notes: dict[str, Any] = {}
    unread = []
    for text in samples.notes:
        try:
            facts = json.loads(text)
        except ValueError:
            facts = None
        if isinstance(facts, dict):
            notes |= facts
        else:
            unread.append(f"note {text[:80]!r} is no JSON object: not used")
    return notes, unread
