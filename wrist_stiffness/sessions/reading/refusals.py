"""What is refused: recordings from which no measured session can be made, and why."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wrist_stiffness import topics
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError, RecordingError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.recording.samples import Samples
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.reading.registration import agreement, put_right
from wrist_stiffness.sessions.reading.signals import Stamps
from wrist_stiffness.topics import BASE_FRAME

LEAST_POSES = 5

FAR_M = 0.02
"""Farther from O than registrations are: their refit would leave errors of its own [m]."""

OTHER_GEOMETRY = float(np.radians(5.0))
"""Median angle between measured and rigid rotation that no effect explains."""


def require_topics(recording: Recording, samples: Samples, remaps: Mapping[str, str]) -> None:
    """Refuse a recording that lacks angles, loads or measured poses, and say why."""
    there = [topic.name for topic in recording.topics if topic.count]
    needed = {
        (topics.JOINT_STATES,): len(samples.joints.time_ns),
        (topics.LOAD_ESTIMATE,): len(samples.loads.time_ns),
        (topics.PLATFORM_POSE, topics.PLATFORM_MARKERS, topics.GAUGE_READINGS): sum(
            len(each.time_ns) for each in (samples.poses, samples.markers, samples.gauges)
        ),
    }
    for any_of, count in needed.items():
        if count:
            continue
        wanted = [remaps.get(topic, topic) for topic in any_of]
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


def require_overlap(angles_ns: Stamps, poses_ns: Stamps) -> None:
    """Refuse poses that were all stamped before or after the joint states."""
    if poses_ns[-1] < angles_ns[0] or poses_ns[0] > angles_ns[-1]:
        ranges = [
            f"{stamps[0] / NANOSECONDS:.3f} to {stamps[-1] / NANOSECONDS:.3f} s"
            for stamps in (angles_ns, poses_ns)
        ]
        raise RecordingError(
            f"the clocks do not overlap: joint states are stamped {ranges[0]}, measured poses "
            f"{ranges[1]}; synchronise the clocks or stamp the poses at reception"
        )


def require_same_wrist(rotation: Array, rigid: Array, theta: Array, table: Table) -> None:
    """Refuse rotations that no effect and no registration explains, and say what would."""
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
        f"instrument is turned by {np.degrees(found.turn):.0f} deg; map its frame (a table: import "
        "--register), or check the joints' names, order and signs"
    )


def require_near(shift: Array) -> None:
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
            f"base's O along {'xyz'[worst]}; map the instrument's frame (a table: import "
            "--register), or check the unit (m in a recording, mm in a table)"
        )


def require_enough(session: MeasuredSession, recorded: int) -> None:
    """Refuse a session in which too few of so many recorded poses are left."""
    known = int(session.measured.any(axis=1).sum())
    if known < LEAST_POSES:
        why = "; ".join(session.remarks) or "no more were recorded"
        raise InputError(
            f"{known} of {recorded} measured poses can be used, at least {LEAST_POSES} are "
            f"needed ({why})"
        )
