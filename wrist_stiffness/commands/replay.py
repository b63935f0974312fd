"""Replay a recording through the nodes' own core path, without a ROS graph."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from wrist_stiffness import topics
from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay_block import BlockReplay
from wrist_stiffness.commands.replay_summary import ReplaySummary
from wrist_stiffness.commands.signals_ahead import SignalsAhead
from wrist_stiffness.commands.wrist_drawing import Drawings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import RecordingError, WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.messages import (
    Float64,
    Float64MultiArray,
    Header,
    JointState,
    JointTrajectory,
    MarkerArray,
    Message,
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Temperature,
    TFMessage,
    Vector3,
    Vector3Stamped,
    WrenchStamped,
)
from wrist_stiffness.recording.raw_block import RawMessage
from wrist_stiffness.recording.reader import Recording, open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.topics import BASE_FRAME, CORRECTED_FRAME, MICROMETRES, MILLIDEGREES

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

TYPES: dict[str, type[Message]] = {
    topics.JOINT_STATES: JointState,
    topics.LOAD_ESTIMATE: WrenchStamped,
    topics.MOTOR_COMMANDS: JointState,
    topics.TEMPERATURES: Temperature,
    topics.TF_STATIC: TFMessage,
    topics.MOTOR_TRAJECTORY: JointTrajectory,
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
    summary = ReplaySummary()
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
            if blocks.answer(block):
                continue
            for raw in block.messages():
                if raw.channel.topic in LEFT_OUT:
                    summary.replaced += 1
                    continue
                writer.write_raw(raw.channel, raw.payload, raw.log_time_ns)
                standard = sampled.get(raw.channel.topic)
                if standard is None:
                    continue
                ahead.read_for(raw.log_time_ns)
                try:
                    answers = _answers(standard, raw, predicting, correcting, drawings, summary)
                    for name, answer in answers:
                        if isinstance(answer, bytes):
                            drawn = channel_of(name, MarkerArray)
                            writer.write_raw(drawn, answer, raw.log_time_ns)
                        else:
                            writer.write(name, answer, raw.log_time_ns)
                except WristError as error:
                    summary.refuse(raw.channel.topic, error)
        if not summary.predictions:
            reason = next(iter(summary.refused), source.damage or "there is none")
            raise RecordingError(
                f"{source.path}: none of {summary.joint_states} joint states could be predicted; "
                f"the first reason: {reason}"
            )
    progress(total, total)
    summary.damage = source.damage
    return summary


def _answers(
    standard: str,
    raw: RawMessage,
    predicting: PredictionStream,
    correcting: CorrectionStream,
    drawings: Drawings,
    summary: ReplaySummary,
) -> Iterator[tuple[str, Message | bytes]]:
    if standard == topics.MOTOR_TRAJECTORY:
        plan = decode(JointTrajectory, raw.payload)
        return _plan(plan, raw.log_time_ns, correcting, summary)
    state = decode(JointState, raw.payload)
    if standard == topics.MOTOR_COMMANDS:
        return _correct(state, correcting, summary)
    return _predict(state, predicting, drawings, summary)


def _actual_names(source: Recording, chosen: Mapping[str, str]) -> dict[str, str]:
    """Return the actual by the standard name of every topic that is there to be used."""
    present = {topic.name: topic for topic in source.topics}
    covariates = (name for name in (*present, *chosen) if name.startswith(topics.COVARIATES))
    types: dict[str, type[Message]] = {**TYPES, **dict.fromkeys(covariates, Float64)}
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


def _predict(
    state: JointState,
    predicting: PredictionStream,
    drawings: Drawings,
    summary: ReplaySummary,
) -> Iterator[tuple[str, Message | bytes]]:
    summary.joint_states += 1
    prediction = predicting.on_joint_state(
        state.header.stamp_ns, state.name, state.position, state.velocity
    )
    summary.predictions += 1
    summary.warnings.update((*prediction.warnings, *predicting.dropped_signals))
    summary.shift_um.add(np.array([prediction.shift_norm * MICROMETRES]))
    summary.phi_mdeg.add(np.array([prediction.phi * MILLIDEGREES]))
    header = Header(state.header.stamp_ns, BASE_FRAME)
    yield topics.POSE_ERROR_PREDICTED, pose_message(header, prediction.twist, prediction.covariance)
    for topic, vector in (
        (topics.POSE_ERROR_S_UM, MICROMETRES * prediction.twist[:3]),
        (topics.POSE_ERROR_PHI_MDEG, MILLIDEGREES * prediction.twist[3:]),
    ):
        yield topic, Vector3Stamped(header, Vector3(*vector.tolist()))
    one = np.array([state.header.stamp_ns]), prediction.configuration.as_block
    for drawn in drawings.of(*one, prediction.twist[None])[1]:
        yield topics.WRIST_MARKERS, drawn


def _correct(
    state: JointState, correcting: CorrectionStream, summary: ReplaySummary
) -> Iterator[tuple[str, Message]]:
    summary.commands += 1
    corrected = correcting.on_command(
        state.header.stamp_ns, state.header.frame_id, state.name, state.position, state.velocity
    )
    if corrected.fault is not None:
        summary.refuse(topics.MOTOR_COMMANDS, corrected.fault)
    summary.corrections += corrected.correction is not None
    header = Header(state.header.stamp_ns, CORRECTED_FRAME)
    yield (
        topics.MOTOR_COMMANDS_CORRECTED,
        JointState(
            header, state.name, tuple(corrected.positions.tolist()), state.velocity, state.effort
        ),
    )
    yield topics.MOTOR_POSITIONS_CORRECTED, Float64MultiArray(data=tuple(corrected.theta.tolist()))
    header = Header(state.header.stamp_ns, BASE_FRAME)
    names = topics.POSE_ERROR_RESIDUAL, topics.POSE_ERROR_RESIDUAL_TASK
    for topic, residual in zip(names, correcting.residuals(corrected), strict=False):
        yield topic, pose_message(header, *residual)


def _plan(
    plan: JointTrajectory, log_time_ns: int, correcting: CorrectionStream, summary: ReplaySummary
) -> Iterator[tuple[str, Message]]:
    summary.trajectories += 1
    names = plan.joint_names
    corrected = correcting.on_trajectory(
        # A zero stamp says "at once".
        plan.header.stamp_ns or log_time_ns,
        plan.header.frame_id,
        names,
        [
            planned_point(len(names), point.positions, point.velocities, point.accelerations)
            for point in plan.points
        ],
    )
    if corrected.fault is not None:
        summary.refuse(topics.MOTOR_TRAJECTORY, corrected.fault)
    summary.corrected_trajectories += corrected.fault is None
    points = tuple(
        replace(
            point,
            positions=tuple(planned.positions.tolist()),
            velocities=tuple(planned.velocities.tolist()),
            accelerations=tuple(planned.accelerations.tolist()),
        )
        for point, planned in zip(plan.points, corrected.points, strict=True)
    )
    header = replace(plan.header, frame_id=corrected.frame_id)
    yield topics.MOTOR_TRAJECTORY_CORRECTED, replace(plan, header=header, points=points)


def pose_message(header: Header, twist: Array, covariance: Array) -> PoseWithCovarianceStamped:
    """Return a twist (6,) at O in F [m, rad] with its covariance (6, 6) as a message."""
    position, quaternion = pose_of_twist(twist)
    pose = Pose(Point(*position.tolist()), Quaternion(*quaternion.tolist()))
    return PoseWithCovarianceStamped(
        header, PoseWithCovariance(pose, tuple(covariance.ravel().tolist()))
    )
