"""What the machine said beside the measured poses: angles, load, temperatures, covariates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.places import THERMOMETERS
from wrist_stiffness.recording.samples import (
    JointSamples,
    PoseSamples,
    Samples,
    ScalarSamples,
    WrenchSamples,
)
from wrist_stiffness.sessions.reading.clocks import clock_offset, rigid_motion
from wrist_stiffness.sessions.reading.joint_states import (
    DENSE_S,
    fault_of,
    mixed,
    without_held,
    without_wild,
)
from wrist_stiffness.sessions.reading.pose_track import measured_components
from wrist_stiffness.sessions.reading.signals import (
    Signal,
    Stamps,
    Twice,
    in_any,
    in_order,
    set_back,
)

JOINT_GAP_S = 0.5
"""Farthest joint state from a measured pose that still tells its angles [s]."""

WAY_S = 0.2
"""Joint states farther apart than this do not tell the way of a moving motor: at 50 deg/s^2 a
straight one is wrong by 0.25 deg, and by 6 deg between states a second apart [s]."""

BENT_RAD = float(np.radians(0.2))
"""So far from straight the way between nearer ones may be, as it is at 10 Hz and 160 deg/s^2; dense
ones are not looked at: a motor cannot bend its way by so much in their time [rad]."""

STILL_RAD = float(np.radians(0.05))
"""So much, some counts, the angles beside a pause may be from those of a pose in it [rad]."""

SPEED_WINDOW_S = 0.025
"""Half the time over which a speed is taken from dense angles [s]: short against a move, and long
enough that one encoder count in it is a slow speed."""

HOT_DEGC = 150.0
"""No bushing lives to be hotter, and whoever sends kelvin is far above it."""


@dataclass(frozen=True, eq=False)
class MachineSignals:
    """Signals of one recording by their own stamps."""

    angles: Signal  # motor angles (m, 2) [rad]
    # motor speeds (m, 2), where the joint states tell them or are dense enough [rad/s]
    speeds: Signal | None
    loads: Signal  # wrenches (l, 6) at O [N, N m]
    load_on_platform: bool  # whether their components are in U
    # `temperatures`, `covariates`: by component, by name
    temperatures: Mapping[str, Signal]
    covariates: Mapping[str, Signal]
    remarks: tuple[str, ...] = ()  # what could not be used
    load_age_limit_s: float = StreamSettings.load_age_limit_s  # oldest load that still counts [s]
    twice: tuple[Twice, ...] = ()  # times of which angles and loads are left out

    def usable(self, time_ns: Stamps) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        """Tell at which stamps (n,) [ns] angles and load are known, and why not at the others."""
        own = self.angles.time_ns
        during = (own[0] <= time_ns) & (time_ns <= own[-1])
        before = own[np.maximum(self.angles.newest(time_ns), 0)]
        after = own[np.minimum(np.searchsorted(own, time_ns), len(own) - 1)]
        near = np.minimum(after - time_ns, time_ns - before) <= JOINT_GAP_S * NANOSECONDS
        way, straight = np.ones((2, len(time_ns)), dtype=bool)
        apart = after - before > DENSE_S * NANOSECONDS
        if apart.any():
            way[apart], straight[apart] = self._between(time_ns[apart], before[apart], after[apart])
        newest = self.loads.newest(time_ns)
        age = time_ns - self.loads.time_ns[newest]
        loads = (newest >= 0) & (age <= round(self.load_age_limit_s * NANOSECONDS))
        usable, reasons = np.ones(len(time_ns), dtype=bool), []
        for known, what in (
            (during, "before the motor angles were first read or after they were last read"),
            (near, f"no joint state within {JOINT_GAP_S:g} s"),
            (way, f"the motors moved between joint states more than {WAY_S:g} s apart"),
            (
                straight,
                "the motors' speed changed between joint states so that their angles may be wrong "
                f"by more than {np.degrees(BENT_RAD):g} deg",
            ),
            (loads, f"no load estimate in the {self.load_age_limit_s:g} s before"),
        ):
            if unknown := np.sum(usable & ~known):
                reasons.append(f"{unknown} measured poses are not used: {what}")
            usable &= known
        return usable, tuple(reasons)

    def _between(
        self, time_ns: Stamps, before: Stamps, after: Stamps
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Tell what is known of the way between joint states that are not dense.

        Of stamps (n,), by those of the states before and after.  Gives `way`, `straight` (n,) bool:
        where it is no pause, or one without motion; where it is as good as straight.
        """
        own, angle = self.angles.time_ns, self.angles.interpolated
        gap = after - before
        nearest = np.where(time_ns - before < after - time_ns, before, after)
        # As far as it came in as much time outside the pause, it may have gone on.
        outside = np.clip(2 * nearest - time_ns, own[0], own[-1])
        moved = np.max([np.abs(angle(t) - angle(nearest)) for t in (time_ns, outside)], axis=0)
        # A motor that turns back in a pause is where it was at both ends of it.
        around = np.stack([before - gap, before, after, after + gap])
        way = np.diff([angle(stamps) for stamps in around], axis=0)
        # Beyond the first and the last state nobody knows of another speed.
        way[0, around[0] < own[0]] = way[1, around[0] < own[0]]
        way[2, around[3] > own[-1]] = way[1, around[3] > own[-1]]
        into = (time_ns - before) / np.maximum(gap, 1)
        share = into * (1.0 - into)
        bent = 0.5 * share[:, None] * np.max(np.abs(np.diff(way, axis=0)), axis=0)
        still = (np.maximum(moved, bent) <= STILL_RAD).all(axis=1)
        return (gap <= WAY_S * NANOSECONDS) | still, (bent <= BENT_RAD).all(axis=1)

    def at(self, time_ns: Stamps) -> Block:
        """Return the signals that belong to usable stamps (n,) [ns], which rise."""
        return Block(
            time_ns / NANOSECONDS,
            self.angles.interpolated(time_ns),
            self.loads.values[self.loads.newest(time_ns)],
            None if self.speeds is None else self.speeds.interpolated(time_ns),
            self.load_on_platform,
            {name: _held(signal, time_ns) for name, signal in self.temperatures.items()},
            {name: _held(signal, time_ns) for name, signal in self.covariates.items()},
        )


def machine_signals(
    samples: Samples,
    frames: Frames,
    table: Table,
    load_age_limit_s: float = StreamSettings.load_age_limit_s,
) -> MachineSignals:
    """Return the signals of a recording, loads moved to O.

    `table`: its rigid wrist tells whether the measured poses stand still where angles repeat.
    Gives `MachineSignals`: values that are not finite are left out.  Raises `FrameError` if loads
    are in an unknown frame, or some in F and some in U; `InputError` if no angle or no load is
    finite.
    """
    loads, on_platform = _loads(samples.loads, frames)
    recorded = in_order(samples.joints.time_ns, samples.joints.position)
    twice = set_back(samples.joints.time_ns) or mixed(recorded)
    twice = (*twice, *set_back(samples.loads.time_ns))
    recorded, loads = (each.take(~in_any(twice, each.time_ns)) for each in (recorded, loads))
    read, held_s = _as_read(recorded, samples.poses, table)
    angles, wild = without_wild(read)
    if len(angles) == 0:
        raise InputError("no joint state has finite angles")
    if len(loads) == 0:
        raise InputError("no load estimate is finite")
    start_ns = int(samples.joints.time_ns[0])
    remarks = list(dict.fromkeys(each.told(start_ns) for each in twice))
    if held_s:
        remarks.append(
            f"the motor angles are read every {held_s:.3g} s and sent more often: they are taken "
            "when they first appear, and are interpolated between"
        )
    if wild:
        remarks.append(f"{wild} of {len(read)} joint states are wild: left out")
    speeds = _told_speeds(samples.joints, recorded, read, twice)
    fault = "" if speeds is None else fault_of(speeds, angles)
    if fault:
        remarks.append(fault)
    if speeds is None or fault:
        speeds = _speeds(angles)
    temperatures = _slow(samples.temperatures)
    if foreign := [name for name in temperatures if name not in THERMOMETERS]:
        remarks.append(
            f"temperatures of {', '.join(map(repr, foreign))}: the wrist has no such place; known "
            f"are {', '.join(THERMOMETERS)}"
        )
    highest = {name: float(signal.values.max()) for name, signal in temperatures.items()}
    if hot := [name for name, value in highest.items() if value > HOT_DEGC]:
        remarks.append(
            f"temperatures of {', '.join(hot)} go up to {max(highest.values()):.4g} degC: are they "
            "in K?"
        )
    covariates = _slow(samples.covariates)
    return MachineSignals(
        angles,
        speeds,
        loads,
        on_platform,
        temperatures,
        covariates,
        tuple(remarks),
        load_age_limit_s,
        twice,
    )


def _loads(loads: WrenchSamples, frames: Frames) -> tuple[Signal, bool]:
    wrench = np.empty_like(loads.wrench)
    on_platform = {}
    names = np.unique(loads.frame_id).tolist()
    for name in names:
        # Moving a wrench to O is linear, so six unit wrenches tell all of it.
        moved = [frames.load(name, unit[:3], unit[3:]) for unit in np.eye(6).tolist()]
        rows = loads.frame_id == name if len(names) > 1 else slice(None)
        wrench[rows] = loads.wrench[rows] @ np.array([load.wrench for load in moved])
        on_platform[name] = moved[0].on_platform
    if len(set(on_platform.values())) > 1:
        raise FrameError(
            f"loads: frames {', '.join(on_platform)} are mixed; some turn with the platform"
        )
    return in_order(loads.time_ns, wrench), any(on_platform.values())


def _as_read(recorded: Signal, poses: PoseSamples, table: Table) -> tuple[Signal, float]:
    """Return angles without repetitions, as `without_held`; all where poses move as all of them.

    Motors whose commands come late stand still and jump: then the platform did so too.
    """
    read, held_s = without_held(recorded)
    _, quaternion = measured_components(poses)
    if held_s and np.isfinite(quaternion).any():
        turned = in_order(poses.time_ns, quaternion)
        rotation = Rotation.from_quat(turned.values).as_matrix()
        sent, once = (
            clock_offset(turned.time_ns, rotation, rigid_motion(angles, table))
            for angles in (recorded, read)
        )
        if sent is not None and once is not None and sent.misfit <= once.misfit:
            return recorded, 0.0
    return read, held_s


def _told_speeds(
    joints: JointSamples, recorded: Signal, read: Signal, twice: Sequence[Twice]
) -> Signal | None:
    """Return the speeds where angles were read, None where drivers leave them out or at zero."""
    speeds = in_order(joints.time_ns, joints.velocity)
    speeds = speeds.take(~in_any(twice, speeds.time_ns))
    if len(speeds) != len(recorded) or not np.any(speeds.values != 0.0):
        return None
    rows = np.searchsorted(speeds.time_ns, read.time_ns)
    return Signal(read.time_ns, speeds.values[rows])


def _speeds(angles: Signal) -> Signal | None:
    """Return differences of dense angles, as late as early; None of sparse ones.

    Differences of the angles at the measured poses, which may be ten times as sparse, would lag.
    """
    if len(angles) < 2 or np.median(np.diff(angles.time_ns)) > SPEED_WINDOW_S * NANOSECONDS:
        return None
    half = round(SPEED_WINDOW_S * NANOSECONDS)
    ends = np.clip(angles.time_ns + [[-half], [half]], angles.time_ns[0], angles.time_ns[-1])
    before, after = (angles.interpolated(each) for each in ends)
    span_s = (ends[1] - ends[0]) / NANOSECONDS
    return Signal(angles.time_ns, (after - before) / span_s[:, None])


def _slow(samples: Mapping[str, ScalarSamples]) -> dict[str, Signal]:
    signals = {name: in_order(one.time_ns, one.value) for name, one in samples.items()}
    return {name: signal for name, signal in signals.items() if len(signal)}


def _held(signal: Signal, time_ns: Stamps) -> Array:
    """Return the newest values; before the first one, that one."""
    return signal.values[np.maximum(signal.newest(time_ns), 0)]
