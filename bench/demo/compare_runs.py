"""Whether a live run and its replay are equal to the bit, and why where they are not.

Replay knows every load by its stamp.  A live node may see a load only after the joint state to
which it belongs, and then predicts with the load before: no other cause of a difference is known.
A model with a memory carries it on, so the live run is followed sample by sample.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from wrist_stiffness.commands.signals_ahead import SignalsAhead
from wrist_stiffness.compensation.load_history import LoadHistory
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import StaleLoadError, WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
)
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.topics import (
    BASE_FRAME,
    COVARIATES,
    JOINT_STATES,
    LOAD_ESTIMATE,
    POSE_ERROR_PREDICTED,
    TEMPERATURES,
)

LATE_LOADS = 3
"""A live node may lag by this many loads at one joint state."""


@dataclass(frozen=True)
class RunComparison:
    """Predictions of a live run and of its replay, matched by stamp.

    Parameters
    ----------
    equal : int
        Equal to the bit, covariance included.
    late : int
        Not equal, but equal to the bit where an older load is taken, here or, in a model with a
        memory, earlier: the right one had not arrived.
    unexplained : int
        Not equal for any other reason.
    only_live, only_replay : int
        Predictions that the other one lacks.
    """

    equal: int
    late: int
    unexplained: int
    only_live: int
    only_replay: int


def compare_runs(live: str | Path, replayed: str | Path, model: str | Path) -> RunComparison:
    """Compare the predictions of a live run with those of its replay.

    Parameters
    ----------
    live, replayed : path
        Recordings with `/pose_error_predicted`.
    model : path
        Model file of both.

    Returns
    -------
    RunComparison
        Counts.

    Raises
    ------
    WristError
        If a recording or the model cannot be read.
    """
    first, second = _predictions(live), _predictions(replayed)
    common = first.keys() & second.keys()
    different = {stamp for stamp in common if first[stamp] != second[stamp]}
    late = _explained_by_late_loads(live, first, different, model) if different else 0
    return RunComparison(
        equal=len(common) - len(different),
        late=late,
        unexplained=len(different) - late,
        only_live=len(first.keys() - common),
        only_replay=len(second.keys() - common),
    )


def _predictions(path: str | Path) -> dict[int, PoseWithCovarianceStamped]:
    return {
        message.header.stamp_ns: message
        for _, _, message in open_recording(path).messages([POSE_ERROR_PREDICTED])
        if isinstance(message, PoseWithCovarianceStamped)
    }


def _explained_by_late_loads(
    live: str | Path,
    published: Mapping[int, PoseWithCovarianceStamped],
    different: set[int],
    model: str | Path,
) -> int:
    """Follow the live run, taking at every sample the load with which it was published."""
    source = open_recording(live)
    signals = [
        topic.name
        for topic in source.topics
        if topic.name in (LOAD_ESTIMATE, TEMPERATURES) or topic.name.startswith(COVARIATES)
    ]
    stream = PredictionStream(load_model(model), StreamSettings())
    running = stream.running_model()
    ahead = SignalsAhead(
        source, {name: name for name in signals}, (stream,), lambda topic, reason: None
    )
    explained = 0
    for _, log_time_ns, state in source.messages([JOINT_STATES]):
        ahead.read_for(log_time_ns)
        if not isinstance(state, JointState) or state.header.stamp_ns not in published:
            continue
        stamp_ns = state.header.stamp_ns
        if not running.remembers and stamp_ns not in different:
            continue
        motors = stream.settings.motors
        theta = motors.angles(state.name, state.position)
        theta_dot = motors.speeds(state.name, state.velocity)
        header = Header(stamp_ns, BASE_FRAME)
        for load in _newest_first(stream.loads, stamp_ns):
            try:
                made = running.preview(stamp_ns, load, theta_dot)(theta)
            except WristError:
                continue
            if pose_message(header, made.twist, made.covariance) == published[stamp_ns]:
                explained += stamp_ns in different
                if running.remembers:
                    running.advance(stamp_ns, theta, load, theta_dot)
                break
    return explained


def pose_message(header: Header, twist: Array, covariance: Array) -> PoseWithCovarianceStamped:
    """Return a twist (6,) at O in F [m, rad] with its covariance (6, 6) as a message."""
    position, quaternion = pose_of_twist(twist)
    pose = Pose(Point(*position.tolist()), Quaternion(*quaternion.tolist()))
    return PoseWithCovarianceStamped(
        header, PoseWithCovariance(pose, tuple(covariance.ravel().tolist()))
    )


def _newest_first(loads: LoadHistory, stamp_ns: int) -> Iterator[Load]:
    """Yield the load that belongs to a stamp, then those that a late one may have left in use."""
    for _ in range(1 + LATE_LOADS):
        try:
            stamp_ns, load = loads.at(stamp_ns)
        except StaleLoadError:
            return
        yield load
        stamp_ns -= 1
