"""From a recording of this wrist to a measured session.

The rules are those of the nodes, seen from the stamp of a measured pose: the load is the newest one
that is not younger, held up to an age limit; temperatures and covariates are held.  Motor angles
are interpolated between the two joint states around the stamp, because motions are compared: at
10 ms between joint states and 30 deg/s a held angle is wrong by up to 300 mdeg.  In a dwell the
encoder's count is the same on both sides, so nothing is smoothed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError, InputError, RecordingError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.recording.samples import Samples
from wrist_stiffness.sessions.in_pieces import in_pieces, rigid_rotation
from wrist_stiffness.sessions.measured_session import MeasuredSession, beyond_range
from wrist_stiffness.sessions.reading.clocks import (
    ClockOffset,
    ClockStep,
    clock_offset,
    clock_step,
    rigid_motion,
)
from wrist_stiffness.sessions.reading.gauge_readings import gauge_readings, held_to
from wrist_stiffness.sessions.reading.lost_beams import lost_beams, stood_still
from wrist_stiffness.sessions.reading.machine_signals import MachineSignals, machine_signals
from wrist_stiffness.sessions.reading.pose_track import MeasuredTrack, pose_track
from wrist_stiffness.sessions.reading.refusals import (
    require_enough,
    require_near,
    require_overlap,
    require_same_wrist,
    require_topics,
)
from wrist_stiffness.sessions.reading.registration import registered
from wrist_stiffness.sessions.reading.signals import Signal, Stamps, in_any, last_of_equal
from wrist_stiffness.sessions.reading.static_frames import KnownFrames, frames_of

GEOMETRY = "geometry_sha256"
"""Key of the notes: checksum of the geometry file of the wrist that was recorded."""

OWN_CLOCK_S = 0.2
"""A larger offset is another clock and is taken out; a smaller one is the effect `time_delay`."""

OWN_CLOCK_PERIODS = 5.0
"""An offset of fewer sample periods is not told from the sampling."""

OWN_CLOCK_GAIN = 4.0
"""An offset that divides the mean square of the misfit by less is not believed."""

CERTAIN = 3.0
"""Nor is one of fewer standard uncertainties."""

GAP_S = 0.2
"""Poses that are nearer to each other tell the path themselves [s]."""

TURN_STEPS = 1.5
"""In encoder steps: a smaller swing between two poses is the chatter of a count."""

PULL_SHARE = 0.25
"""Of the load's range: a smaller pull between two poses may be noise."""


def read_session(
    path: str | Path,
    table: Table,
    *,
    remaps: Mapping[str, str] | None = None,
    settings: StreamSettings | None = None,
) -> MeasuredSession:
    """Read a recording with measured poses.

    `path`: rosbag2 folder with MCAP storage, or `.mcap` file; `table`: of the wrist: its rigid
    kinematics, and its readout points as the nominal markers; `remaps`: actual by standard topic
    name; `settings`: joint names, age limit of loads, and sensor frames of loads, poses and markers
    beside `wrist_base`, `wrist_platform` and those on the recording's `/tf_static`.

    The session is named after the recording, with remarks on everything that could not be used.
    Where poses are far apart, rows without a measurement tell where angles and load turned back in
    between.

    Raises `RecordingError` if the recording cannot be read, lacks a topic, or its clocks do not
    overlap; `FrameError` if loads or poses are in an unknown frame; `InputError` if too few poses
    are left, or they are those of another wrist.
    """
    settings = settings or StreamSettings()
    recording, samples, known = opened(path, remaps or {}, settings)
    notes, unread = notes_of(samples.notes)
    try:
        machine = machine_signals(samples, known.frames, table, settings.load_age_limit_s)
        if len(samples.poses.time_ns) or len(samples.markers.time_ns):
            track = pose_track(samples, table.geometry.platform.readout_points, known.frames)
        else:
            time_ns, gauges, readings = gauge_readings(samples.gauges, notes, table)
            none = np.full((len(time_ns), 3, 4), np.nan)
            track = MeasuredTrack(
                time_ns, none[:, :, 0], none[:, :, 1:], gauges=gauges, readings=readings
            )
        session = session_of(recording.path.name, machine, track, table)
    except (FrameError, InputError, RecordingError) as error:
        hints = known.hints if isinstance(error, FrameError) else map(str, samples.faults)
        raise type(error)("; ".join([f"{recording.path}: {error}", *hints])) from error
    damage = ""
    if recording.damage:
        read_s = np.ptp(session.block.time)
        damage = f"the recording is damaged, {read_s:.0f} s of it are used: {recording.damage}"
    faults = [str(fault) for fault in samples.faults]
    other = another_geometry(notes, table)
    said = (*unread, *other, *known.remarks, *faults, *session.remarks)
    remarks = (damage, *said) if damage else said
    return replace(session, notes=notes, remarks=remarks, damage=damage)


def opened(
    path: str | Path, remaps: Mapping[str, str], settings: StreamSettings
) -> tuple[Recording, Samples, KnownFrames]:
    """Return a recording with angles, loads and measurements, these, and its sensor frames.

    Raises `RecordingError` if it cannot be read or lacks a topic.
    """
    recording = open_recording(path)
    joints = settings.motors.motor_1, settings.motors.motor_2
    samples = read_samples(recording, remaps=remaps, joints=joints)
    require_topics(recording, samples, remaps)
    return recording, samples, frames_of(recording, remaps, settings.frames)


def session_of(
    name: str, machine: MachineSignals, track: MeasuredTrack, table: Table
) -> MeasuredSession:
    """Put the signals of a recording together: clocks, spikes, the way between poses.

    `track`: measured poses in F, or readings.  Gives a session with remarks on everything that
    could not be used, and no notes.  Raises `RecordingError` if the clocks do not overlap;
    `InputError` if too few poses are left, or they are those of another wrist, or gauges do not
    stand where they are said to.
    """
    require_overlap(machine.angles.time_ns, track.time_ns)
    recorded = len(track)
    track = track.take(~in_any(machine.twice, track.time_ns))
    motion = rigid_motion(machine.angles, table)
    track = _without_still(machine, track, table, motion)
    track, offset = _by_one_clock(machine, track, motion)
    remarks, late_s = [*machine.remarks, *track.remarks], 0.0
    if (
        offset is not None
        and offset.gain > OWN_CLOCK_GAIN
        and _is_of_clocks(offset, machine, track)
    ):
        remarks.append(
            f"the clock of the pose sensor is {offset.seconds:+.3f} s (uncertain by "
            f"{offset.sigma:.3f} s) from that of the joint states: taken out"
        )
        track = replace(track, time_ns=track.time_ns - round(offset.seconds * NANOSECONDS))
    elif offset is not None and abs(offset.seconds) > CERTAIN * offset.sigma:
        late_s = offset.seconds
    usable, reasons = machine.usable(track.time_ns)
    remarks += reasons
    theta = machine.angles.interpolated(track.time_ns[usable])
    reachable = in_pieces(table.mechanism.reachable, theta)
    if not reachable.all():
        remarks.append(
            f"{np.sum(~reachable)} measured poses are not used: the wrist cannot reach their angles"
        )
    usable[usable] = reachable
    if not usable.any():
        raise InputError(f"no measured pose can be used: {'; '.join(remarks)}")
    track = track.take(usable)
    all_ns = np.union1d(track.time_ns, path_stamps(machine, track.time_ns, table))
    rows = np.searchsorted(all_ns, track.time_ns)
    block = machine.at(all_ns)
    measured = block.take(rows)
    rigid = rigid_rotation(table, measured.theta)
    shift, rotation, covariance = track.shift, track.rotation, track.covariance
    gauges, readings = track.gauges, track.readings
    if track.unplaced:
        found = registered(shift, rotation, rigid)
        shift, rotation = found.in_base(shift, rotation)
        covariance = None if covariance is None else found.covariance(covariance)
        remarks.append(str(found))
    require_same_wrist(rotation, rigid, measured.theta, table)
    require_near(shift)
    if gauges is not None and readings is not None:
        gauges, readings, said = held_to(gauges, readings, rigid)
        readings = _spread(readings, rows, len(block))
        remarks += said
    remarks += beyond_range(table, measured)
    # The rigid rotations at the moments of the poses, not at their late stamps.
    meant = _rigid_at(machine, track.time_ns, late_s, table) if late_s else rigid
    meant = np.where(np.isfinite(meant), meant, rigid)
    step = table.geometry.limits.encoder_step
    lost = lost_beams(measured.time, shift, rotation, meant, step)
    if lost.any():
        remarks.append(f"{lost.sum()} of {len(lost)} measured poses are lost beams: left out")
    if len(measured) > 1 and np.all(measured.load == measured.load[0]):
        remarks.append(
            "the load never changes: what the load does and what is always there look the same"
        )
    seen = rows[~lost]
    session = MeasuredSession(
        name,
        block,
        _spread(shift[~lost], seen, len(block)),
        _spread(rotation[~lost], seen, len(block)),
        covariance,
        remarks=tuple(remarks),
        clock_offset_s=None if offset is None else (offset.seconds, offset.sigma),
        gauges=gauges,
        readings=readings,
    )
    require_enough(session, recorded)
    return session


def _without_still(
    machine: MachineSignals, track: MeasuredTrack, table: Table, motion: Signal
) -> MeasuredTrack:
    """Return the track without poses that its instrument only sent again."""
    if track.repeats is None or not track.repeats.any():
        return track
    # What repeats tells nothing of the clocks: it may be a pose of long ago.
    once = ~track.repeats
    late = clock_offset(track.time_ns[once], track.rotation[once], motion)
    if late is not None and not late.fits and abs(late.seconds) > OWN_CLOCK_S:
        return track
    late_s = 0.0 if late is None else late.seconds
    rigid = _rigid_at(machine, track.time_ns, late_s, table)
    usable, _ = machine.usable(track.time_ns - round(late_s * NANOSECONDS))
    rows = np.flatnonzero(usable & np.isfinite(rigid).all(axis=(1, 2)))
    if track.repeats[rows].all():
        return track
    known = track.take(rows)
    time = (known.time_ns - known.time_ns[0]) / NANOSECONDS
    still = np.zeros(len(track), dtype=bool)
    still[rows] = stood_still(
        time,
        known.shift,
        known.rotation,
        rigid[rows],
        track.repeats[rows],
        table.geometry.limits.encoder_step,
    )
    if not still.any():
        return track
    run = np.cumsum(~track.repeats)
    still = track.repeats & np.isin(run, run[still])
    began = min(machine.angles.time_ns[0], track.time_ns[0])
    ends = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]]))).reshape(-1, 2) - [0, 1]
    spans = (track.time_ns[ends] - began) / NANOSECONDS
    longest = spans[np.argmax(np.ptp(spans, axis=1))]
    times = f"{len(spans)} times, the longest " if len(spans) > 1 else ""
    return track.take(~still).with_remark(
        f"the measured pose stood still {times}from {longest[0]:.2f} s to {longest[1]:.2f} s, to "
        "the last digit, while the motors moved or its noise should show: "
        f"{still.sum()} poses are not used; did the instrument lose its target?"
    )


def path_stamps(machine: MachineSignals, time_ns: Stamps, table: Table) -> Stamps:
    """Return the stamps that tell the way to the first pose and between poses far apart.

    Friction, backlash and creep remember that way.  Between the poses of a machine that measures at
    rest, or where the tracker was blind, the measured stamps alone do not tell it.

    `time_ns` (n,) int64: stamps of measured poses, rising [ns].  Gives (p,) int64: where angles or
    load turned back [ns].
    """
    start = max(machine.angles.time_ns[0], machine.loads.time_ns[0])
    far = time_ns[0] - start > GAP_S * NANOSECONDS
    time_ns = np.append(start, time_ns) if far else time_ns
    step = table.geometry.limits.encoder_step
    turns = turning_stamps(machine.angles, time_ns, np.full(2, TURN_STEPS * step))
    pulls = turning_stamps(
        machine.loads, time_ns, PULL_SHARE * np.ptp(machine.loads.values, axis=0)
    )
    found = np.union1d(np.union1d(turns, pulls), time_ns[:1])
    found = found[machine.usable(found)[0]]
    return found[table.mechanism.reachable(machine.angles.interpolated(found))]


def turning_stamps(signal: Signal, time_ns: Stamps, least: Array) -> Stamps:
    """Return the stamps of the extremes of a signal inside the gaps between poses.

    Of each gap only the outermost extremes count: smaller swings inside them are forgotten by play
    and friction as well.

    `signal`: values (m, k); `time_ns` (n,) int64: stamps of the poses, rising [ns]; `least` (k,):
    an extreme stands out by more than this from the values at both ends of its gap.  Gives (p,)
    int64: rising [ns].
    """
    ends = signal.interpolated(np.clip(time_ns, signal.time_ns[0], signal.time_ns[-1]))
    after = np.searchsorted(signal.time_ns, time_ns, side="right")
    found = [
        signal.time_ns[rows][np.argmax(sign * signal.values[rows, column])]
        for gap in np.flatnonzero(np.diff(time_ns) > round(GAP_S * NANOSECONDS))
        if after[gap] < after[gap + 1]
        for rows in [slice(after[gap], after[gap + 1])]
        for sign in (1.0, -1.0)
        for column in np.flatnonzero(
            np.max(sign * signal.values[rows], axis=0)
            > np.max(sign * ends[gap : gap + 2], axis=0) + least
        )
    ]
    return np.unique(np.array(found, dtype=np.int64))


def _spread(values: Array, rows: NDArray[np.intp], count: int) -> Array:
    """Return values (n, ...) at their rows among so many, NaN at the others."""
    out = np.full((count, *values.shape[1:]), np.nan)
    out[rows] = values
    return out


def _by_one_clock(
    machine: MachineSignals, track: MeasuredTrack, motion: Signal
) -> tuple[MeasuredTrack, ClockOffset | None]:
    """Return the track, its clock followed where it or that of the joint states was set, and that.

    The offset is what is left between the two clocks.  What fits no better is not followed.
    """
    began = min(machine.angles.time_ns[0], track.time_ns[0])
    offset = clock_offset(track.time_ns, track.rotation, motion)
    while offset is not None and not offset.fits:
        step = clock_step(track.time_ns, track.rotation, motion, OWN_CLOCK_GAIN)
        if step is None or not _is_of_clocks(step, machine, track):
            break
        followed = _followed(track, step, began)
        left = clock_offset(followed.time_ns, followed.rotation, motion)
        if left is None or left.misfit >= offset.misfit:
            break
        track, offset = followed, left
    return track, offset


def _followed(track: MeasuredTrack, step: ClockStep, began_ns: int) -> MeasuredTrack:
    """Return the track with one step of a clock taken out, in a session that began then [ns]."""
    later = track.time_ns > step.end_ns
    shift_ns = np.where(later, round(step.seconds * NANOSECONDS), 0)
    around = ~later & (track.time_ns >= step.begin_ns)
    mended = replace(track, time_ns=track.time_ns - shift_ns).take(~around)
    return mended.take(last_of_equal(mended.time_ns)).with_remark(
        f"the clock of the pose sensor steps by {step.seconds:+.3f} s (uncertain by "
        f"{step.sigma:.3f} s) against that of the joint states, "
        f"{(step.begin_ns - began_ns) / NANOSECONDS:.1f} s after the start: taken out; "
        f"{around.sum()} poses around it are not used"
    )


def _is_of_clocks(
    offset: ClockOffset | ClockStep, machine: MachineSignals, track: MeasuredTrack
) -> bool:
    """Tell whether an offset is one of clocks, not a delay that the wrist's model can have."""
    periods = (np.diff(each) for each in (machine.angles.time_ns, track.time_ns) if len(each) > 1)
    longest = max((float(np.median(each)) / NANOSECONDS for each in periods), default=0.0)
    least = max(OWN_CLOCK_S, OWN_CLOCK_PERIODS * longest, CERTAIN * offset.sigma)
    return abs(offset.seconds) > least


def _rigid_at(machine: MachineSignals, time_ns: Stamps, late_s: float, table: Table) -> Array:
    """Return the rigid rotations (n, 3, 3) so long before stamps (n,) [ns]; NaN out of reach.

    Outside of the joint states the motors are where they are at the ends.
    """
    own = machine.angles.time_ns
    moments = np.clip(time_ns - round(late_s * NANOSECONDS), own[0], own[-1])
    theta = machine.angles.interpolated(moments)
    rigid, reachable = np.full((len(theta), 3, 3), np.nan), table.mechanism.reachable(theta)
    rigid[reachable] = rigid_rotation(table, theta[reachable])
    return rigid


def another_geometry(notes: Mapping[str, Any], table: Table) -> list[str]:
    """Return a warning where the notes name another geometry: a table may have been made anew."""
    said, own = notes.get(GEOMETRY), table.geometry.sha256
    if said in (None, own):
        return []
    return [
        f"note {GEOMETRY!r} is {str(said)[:12]}..., the table's geometry {own[:12]}... "
        f"({table.geometry.name}): the recording is of another wrist, or its geometry was changed"
    ]


def notes_of(texts: Iterable[str]) -> tuple[dict[str, Any], list[str]]:
    """Return the facts of all notes, later ones first choice, and what was no JSON."""
    notes: dict[str, Any] = {}
    unread = []
    for text in texts:
        try:
            facts = json.loads(text)
        except (ValueError, RecursionError):
            facts = None
        if isinstance(facts, dict):
            notes |= facts
        else:
            unread.append(f"note {text[:80]!r} is no JSON object: not used")
    return notes, unread
