"""A recording as arrays, one set for each kind of topic.

Values are given as they were recorded.  What is wrong with them is counted in `Samples.faults` and
left to the reader: NaN stay, stamps stay in the order of reception even where they repeat or run
backwards.  Only a message that cannot give a row (a joint missing, another number of markers, a
payload that cannot be decoded) is left out, and counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness import topics as names
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.collector import (
    Collector,
    Extract,
    Fault,
    FloatArray,
    Rows,
    TimeArray,
    gauge_rows,
    joint_rows,
    marker_rows,
    pose_rows,
    single,
    stacked,
    text_rows,
    xyz,
)
from wrist_stiffness.recording.messages import (
    Float64,
    JointState,
    Message,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    String,
    Temperature,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import Recording

TextArray = NDArray[np.str_]

DEFAULT_JOINTS = ("motor_1_joint", "motor_2_joint")


@dataclass(frozen=True)
class HeaderSamples:
    """Stamps, log times (n,) [ns] and frames (n,) of messages with a header."""

    time_ns: TimeArray
    log_time_ns: TimeArray
    frame_id: TextArray


@dataclass(frozen=True)
class JointSamples(HeaderSamples):
    """Two joints: positions and velocities (n, 2) [rad, rad/s]; NaN where a message has none."""

    position: FloatArray
    velocity: FloatArray


@dataclass(frozen=True)
class WrenchSamples(HeaderSamples):
    """Wrenches (n, 6) [N, N m], force first, as expressed in `frame_id` (n,)."""

    wrench: FloatArray


@dataclass(frozen=True)
class PoseSamples(HeaderSamples):
    """Positions (n, 3) [m], quaternions (n, 4) scalar last, covariances (n, 6, 6) or NaN."""

    position: FloatArray
    quaternion: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class MarkerSamples(HeaderSamples):
    """Markers (n, k, 3) [m] in the order of the message; NaN = lost."""

    position: FloatArray


@dataclass(frozen=True)
class GaugeSamples(HeaderSamples):
    """Readings (n, k) [m, rad] by the names (n, k) of what was read; NaN = not read."""

    value: FloatArray
    names: TextArray


@dataclass(frozen=True)
class ScalarSamples(HeaderSamples):
    """Numbers (n,) of one sensor; a message without a header has its log time as stamp."""

    value: FloatArray


@dataclass(frozen=True)
class Samples:
    """What was measured on the wrist; a topic that is absent gives arrays of length 0.

    `temperatures` are by component, `covariates` by the name below ``/covariates/``, `notes` the
    texts of ``/recording_notes``.
    """

    joints: JointSamples
    loads: WrenchSamples
    poses: PoseSamples
    frame_poses: PoseSamples
    markers: MarkerSamples
    gauges: GaugeSamples
    temperatures: Mapping[str, ScalarSamples]
    covariates: Mapping[str, ScalarSamples]
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]


def read_samples(
    recording: Recording,
    *,
    remaps: Mapping[str, str] | None = None,
    joints: Sequence[str] = DEFAULT_JOINTS,
) -> Samples:
    """Read the measurements of a recording into arrays.

    Parameters
    ----------
    recording : Recording
        From `open_recording`.
    remaps : Mapping[str, str], optional
        Name in the recording by standard name, for topics that are named otherwise there.
    joints : Sequence[str]
        Names of motor 1 and motor 2; other joints are ignored, and so are messages of a shared
        joint state topic that name neither.

    Returns
    -------
    Samples
        In log-time order.

    Raises
    ------
    RecordingError
        If a mapped topic is absent, a topic has a type that it cannot have, or a joint state topic
        never names both joints.
    """
    remaps = dict(remaps or {})
    collectors = _collectors_of(recording, remaps, tuple(joints))
    for topic, log_times, payloads in recording.payloads(collectors.keys()):
        collectors[topic].add(log_times, payloads)

    def of(standard: str) -> Rows:
        collector = collectors.get(remaps.get(standard, standard))
        return collector.rows() if collector else {}

    covariates, warmth = _covariates(recording, remaps), of(names.TEMPERATURES)
    component = warmth.get("frame_id", np.empty(0, np.str_))
    stated = collectors.get(remaps.get(names.JOINT_STATES, names.JOINT_STATES))
    if stated and stated.counts and not stated.rows():
        raise RecordingError(
            f"{recording.path}: {stated.topic} never names {' and '.join(joints)} together"
            f"{_first_names(recording, stated.topic)}"
        )
    return Samples(
        joints=_made(JointSamples, of(names.JOINT_STATES), position=(2,), velocity=(2,)),
        loads=_made(WrenchSamples, of(names.LOAD_ESTIMATE), wrench=(6,)),
        poses=_pose_samples(of(names.PLATFORM_POSE)),
        frame_poses=_pose_samples(of(names.FRAME_POSE)),
        markers=_made(MarkerSamples, of(names.PLATFORM_MARKERS), position=(0, 3)),
        gauges=_made(GaugeSamples, of(names.GAUGE_READINGS), value=(0,), names=(0,)),
        temperatures={
            str(name): _made(
                ScalarSamples,
                {key: column[component == name] for key, column in warmth.items()},
                value=(),
            )
            for name in np.unique(component)
        },
        covariates={
            name: _made(ScalarSamples, collectors[topic].rows(), value=())
            for name, topic in covariates.items()
        },
        notes=tuple(of(names.RECORDING_NOTES).get("text", np.empty(0, np.str_)).tolist()),
        faults=tuple(fault for name in sorted(collectors) for fault in collectors[name].faults()),
    )


def _first_names(recording: Recording, topic: str) -> str:
    """Return which joints the first message of a topic names, for whoever has other names."""
    for _, _, message in recording.messages([topic]):
        if isinstance(message, JointState):
            named = ", ".join(message.name) or "none"
            return f"; its first message names {named}: say --joint twice, motor 1 first"
    return ""


_Kind = TypeVar("_Kind")


def _made(kind: Callable[..., _Kind], rows: Rows, **shapes: tuple[int, ...]) -> _Kind:
    """Make samples of a kind; `shapes` are those of a row where there is none."""
    columns: Rows = {
        "time_ns": np.empty(0, np.int64),
        "log_time_ns": np.empty(0, np.int64),
        "frame_id": np.empty(0, np.str_),
        **{name: np.empty((0, *shape)) for name, shape in shapes.items()},
    }
    columns.update(rows)
    return kind(**columns)


def _pose_samples(rows: Rows) -> PoseSamples:
    # One NaN stands for all covariances of a topic that has none: 600,000 of them take 170 MB.
    unknown = np.broadcast_to(np.nan, (len(rows.get("time_ns", ())), 6, 6))
    return _made(PoseSamples, {"covariance": unknown, **rows}, position=(3,), quaternion=(4,))


def _covariates(recording: Recording, remaps: Mapping[str, str]) -> dict[str, str]:
    """Return the topic of each covariate by its name."""
    found = {
        info.name.removeprefix(names.COVARIATES): info.name
        for info in recording.topics
        if info.name.startswith(names.COVARIATES) and info.name not in remaps.values()
    }
    for standard, actual in remaps.items():
        if standard.startswith(names.COVARIATES):
            found[standard.removeprefix(names.COVARIATES)] = actual
    return found


def _collectors_of(
    recording: Recording, remaps: Mapping[str, str], joints: tuple[str, ...]
) -> dict[str, Collector]:
    types = {info.name: info.ros_type for info in recording.topics}
    absent = [actual for actual in remaps.values() if actual not in types]
    if absent:
        present = ", ".join(sorted(types)) or "none"
        raise RecordingError(
            f"{recording.path} has no topic {', '.join(absent)}; its topics are {present}"
        )
    wrench = stacked(wrench=(*xyz("wrench.force"), *xyz("wrench.torque")))
    wanted: dict[str, list[tuple[type[Message], Extract, tuple[str, ...]]]] = {
        names.JOINT_STATES: [(JointState, joint_rows(joints), ("position",))],
        names.LOAD_ESTIMATE: [(WrenchStamped, wrench, ("wrench",))],
        names.PLATFORM_MARKERS: [(PoseArray, marker_rows(), ())],
        names.GAUGE_READINGS: [(JointState, gauge_rows(), ())],
        names.TEMPERATURES: [(Temperature, single("temperature"), ("value",))],
        names.RECORDING_NOTES: [(String, text_rows, ())],
    }
    for standard in (names.PLATFORM_POSE, names.FRAME_POSE):
        wanted[standard] = [
            (PoseStamped, pose_rows("pose"), ("position", "quaternion")),
            (PoseWithCovarianceStamped, pose_rows("pose.pose"), ("position", "quaternion")),
        ]
    topics = {remaps.get(standard, standard): kinds for standard, kinds in wanted.items()}
    for topic in _covariates(recording, remaps).values():
        topics[topic] = [(Float64, single("data"), ("value",))]
    return {
        topic: _collector(recording, topic, types[topic], kinds)
        for topic, kinds in topics.items()
        if topic in types
    }


def _collector(
    recording: Recording,
    topic: str,
    ros_type: str,
    kinds: list[tuple[type[Message], Extract, tuple[str, ...]]],
) -> Collector:
    for message_type, extract, finite in kinds:
        if message_type.ros_type == ros_type:
            return Collector(topic, message_type, extract, finite)
    expected = " or ".join(message_type.ros_type for message_type, _, _ in kinds)
    raise RecordingError(f"{recording.path}: {topic} carries {ros_type}, not {expected}")
