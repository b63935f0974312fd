"""Whether a live run and its replay are equal to the bit, and why where they are not.

Replay knows every load by its stamp.  A live node may see a load only after the joint state to
which it belongs, and then predicts with the load before: that is the one difference there may be.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wrist_stiffness.compensation.intake import BASE_FRAME
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import WristError
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    PoseWithCovarianceStamped,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.recording.topics import JOINT_STATES, LOAD_ESTIMATE
from wrist_stiffness.workflows.replay import pose_message

PREDICTED = "/pose_error_predicted"

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
        Not equal, but equal to the bit with an older load: the right one had not arrived.
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
    different = {stamp: first[stamp] for stamp in common if first[stamp] != second[stamp]}
    late = _explained_by_late_loads(live, different, model)
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
        for _, _, message in open_recording(path).messages([PREDICTED])
        if isinstance(message, PoseWithCovarianceStamped)
    }


def _explained_by_late_loads(
    live: str | Path, different: dict[int, PoseWithCovarianceStamped], model: str | Path
) -> int:
    if not different:
        return 0
    states: dict[int, JointState] = {}
    loads: list[WrenchStamped] = []
    for _, _, message in open_recording(live).messages([JOINT_STATES, LOAD_ESTIMATE]):
        if isinstance(message, JointState) and message.header.stamp_ns in different:
            states[message.header.stamp_ns] = message
        elif isinstance(message, WrenchStamped):
            loads.append(message)
    loads.sort(key=lambda load: load.header.stamp_ns)
    error_model = load_model(model)
    explained = 0
    for stamp, published in different.items():
        older = [load for load in loads if load.header.stamp_ns <= stamp][-1 - LATE_LOADS : -1]
        explained += any(
            _predicted(error_model, load, states[stamp]) == published for load in older
        )
    return explained


def _predicted(
    model: ErrorModel, load: WrenchStamped, state: JointState
) -> PoseWithCovarianceStamped | None:
    stream = PredictionStream(model, StreamSettings())
    force, torque = load.wrench.force, load.wrench.torque
    try:
        stream.loads.add(
            load.header.stamp_ns,
            load.header.frame_id,
            (force.x, force.y, force.z),
            (torque.x, torque.y, torque.z),
        )
        sample = stream.on_joint_state(state.header.stamp_ns, state.name, state.position)
    except WristError:
        return None
    header = Header(state.header.stamp_ns, BASE_FRAME)
    return pose_message(header, sample.prediction.twist, sample.prediction.covariance)
