"""Replay a recording through the nodes' own core path, without a ROS graph."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wrist_stiffness import topics
from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay_block import BlockReplay, ReplaySummary
from wrist_stiffness.commands.signals_ahead import SignalsAhead
from wrist_stiffness.commands.wrist_drawing import Drawings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording import messages as msg
from wrist_stiffness.recording.reader import Recording, open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.sessions.reading.session import another_geometry, notes_of

OUTPUTS = (
    topics.POSE_ERROR_PREDICTED,
    topics.POSE_ERROR_RESIDUAL,
    topics.POSE_ERROR_RESIDUAL_TASK,
    topics.MOTOR_COMMANDS_CORRECTED,
    topics.MOTOR_POSITIONS_CORRECTED,
    topics.MOTOR_TRAJECTORY_CORRECTED,
)

LEFT_OUT = frozenset(
    {*OUTPUTS, topics.POSE_ERROR_S_UM, topics.POSE_ERROR_PHI_MDEG, topics.WRIST_MARKERS}
)
"""What an earlier run left in the input; s, phi and the drawing follow from the pose and need no
comparing."""

TYPES: dict[str, type[msg.Message]] = {
    topics.JOINT_STATES: msg.JointState,
    topics.LOAD_ESTIMATE: msg.WrenchStamped,
    topics.MOTOR_COMMANDS: msg.JointState,
    topics.TEMPERATURES: msg.Temperature,
    topics.TF_STATIC: msg.TFMessage,
    topics.MOTOR_TRAJECTORY: msg.JointTrajectory,
}
"""Topics that are used, besides those below `/covariates/`."""

REQUIRED = (topics.JOINT_STATES, topics.LOAD_ESTIMATE)
SAMPLED = (topics.JOINT_STATES, topics.MOTOR_COMMANDS, topics.MOTOR_TRAJECTORY)
"""Topics whose messages are answered."""


def replay(
    recording: str | Path,
    model: str | Path,
    output: str | Path,
    settings: tuple[StreamSettings, StreamSettings] | None = None,
    remaps: Mapping[str, str] | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> ReplaySummary:
    """Write a recording again with predicted errors and corrected commands added.

    `recording`, `output`: folders or `.mcap` files; the output holds the input and what the nodes
    would have sent; `settings`: of predictor and corrector, as the nodes'; the defaults if None;
    `remaps`: actual by standard topic name; `progress`: called with messages done and in all.
    Raises `WristError` if the model or the recording cannot be used, or no joint state at all can
    be predicted; then nothing is written.
    """
    prediction, correction = settings or node_settings(None)
    error_model = load_model(model)
    source = open_recording(recording)
    names = _actual_names(source, remaps or {})
    signals = {actual: standard for standard, actual in names.items() if standard not in SAMPLED}
    sampled = {names[standard]: standard for standard in SAMPLED if standard in names}
    summary = ReplaySummary(another_geometry(_notes(source, remaps or {}), error_model.table))
    predicting = PredictionStream(error_model, prediction)
    correcting = CorrectionStream(error_model, correction, enabled=True)
    ahead = SignalsAhead(source, signals, (predicting, correcting), summary.refuse)
    total = sum(topic.count for topic in source.topics)
    with RecordingWriter(output, overwrite=overwrite) as writer:
        drawings = Drawings(error_model.table.geometry, prediction)
        blocks = BlockReplay(
            writer, predicting, correcting, ahead, sampled, LEFT_OUT, drawings, summary
        )
        done = 0
        for block in source.blocks():
            progress(done, total)
            done += len(block)
            blocks.answer(block)
        if not summary.predictions:
            reason = next(iter(summary.refused), source.damage or "there is none")
            raise RecordingError(
                f"{source.path}: none of {summary.joint_states} joint states could be predicted; "
                f"the first reason: {reason}"
            )
    progress(total, total)
    summary.damage = source.damage
    return summary


def _notes(source: Recording, remaps: Mapping[str, str]) -> dict[str, Any]:
    topic = remaps.get(topics.RECORDING_NOTES, topics.RECORDING_NOTES)
    said = (message for _, _, message in source.messages([topic]))
    return notes_of(each.data for each in said if isinstance(each, msg.String))[0]


def _actual_names(source: Recording, chosen: Mapping[str, str]) -> dict[str, str]:
    """Return the actual by the standard name of every topic that is there to be used."""
    present = {topic.name: topic for topic in source.topics}
    covariates = (name for name in (*present, *chosen) if name.startswith(topics.COVARIATES))
    types: dict[str, type[msg.Message]] = {**TYPES, **dict.fromkeys(covariates, msg.Float64)}
    names = {}
    for standard, wanted in types.items():
        actual = chosen.get(standard, standard)
        topic = present.get(actual)
        if topic is None:
            if standard not in REQUIRED and standard not in chosen:
                continue
            if source.damage and not present:
                raise RecordingError(f"{source.path}: nothing can be read: {source.damage}")
            found = ", ".join(present) or "none"
            raise RecordingError(
                f"{source.path}: no topic {actual} (it has {found}); "
                f"name it with --topic {standard}:=ACTUAL"
            )
        if topic.ros_type != wanted.ros_type:
            if standard not in SAMPLED and standard not in (*REQUIRED, *chosen):
                # Somebody else's topic of that name: a node would not hear it either.
                continue
            raise RecordingError(
                f"{source.path}: {topic.name} is {topic.ros_type}, not {wanted.ros_type}"
            )
        names[standard] = actual
    return names
