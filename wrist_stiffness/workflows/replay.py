"""Replay a recording through the nodes' own core path, without a ROS graph."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.pose import pose_of_twist
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.compensation.trajectory import planned_point
from wrist_stiffness.errors import RecordingError, WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.messages import (
    Float64,
    Float64MultiArray,
    Header,
    JointState,
    JointTrajectory,
    Message,
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Temperature,
    TFMessage,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import Recording, open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.topics import (
    BASE_FRAME,
    CORRECTED_FRAME,
    COVARIATES,
    JOINT_STATES,
    LOAD_ESTIMATE,
    MOTOR_COMMANDS,
    MOTOR_COMMANDS_CORRECTED,
    MOTOR_POSITIONS_CORRECTED,
    MOTOR_TRAJECTORY,
    MOTOR_TRAJECTORY_CORRECTED,
    POSE_ERROR_PREDICTED,
    POSE_ERROR_RESIDUAL,
    POSE_ERROR_RESIDUAL_TASK,
    TEMPERATURES,
    TF_STATIC,
)
from wrist_stiffness.workflows.parameter_file import node_settings
from wrist_stiffness.workflows.signals_ahead import SignalsAhead

OUTPUTS = (
    POSE_ERROR_PREDICTED,
    POSE_ERROR_RESIDUAL,
    POSE_ERROR_RESIDUAL_TASK,
    MOTOR_COMMANDS_CORRECTED,
    MOTOR_POSITIONS_CORRECTED,
    MOTOR_TRAJECTORY_CORRECTED,
)

TYPES: dict[str, type[Message]] = {
    JOINT_STATES: JointState,
    LOAD_ESTIMATE: WrenchStamped,
    MOTOR_COMMANDS: JointState,
    TEMPERATURES: Temperature,
    TF_STATIC: TFMessage,
    MOTOR_TRAJECTORY: JointTrajectory,
}
"""Topics that are used, besides those below `/covariates/`."""

REQUIRED = (JOINT_STATES, LOAD_ESTIMATE)
SAMPLED = (JOINT_STATES, MOTOR_COMMANDS, MOTOR_TRAJECTORY)
"""Topics whose messages are answered."""

PROGRESS_EVERY = 500

NUMBER = re.compile(r"(?<!\w)-?\d+(\.\d+)?(e[-+]?\d+)?")
"""A value in a message; not the digits of a name such as motor_1_joint."""


@dataclass
class ReplaySummary:
    """What a replay did.

    Parameters
    ----------
    joint_states, predictions : int
        Joint states read, predictions written.
    commands, corrections : int
        Commands read, commands that were changed.
    trajectories, corrected_trajectories : int
        The same of trajectories.
    refused : Counter
        Samples without a result. Reasons that differ only in their numbers are one, told by the
        first of them.
    warnings : Counter
        Predictions by what the model had to leave out of them, such as an effect whose temperature
        the recording lacks.
    replaced : int
        Outputs of an earlier run in the input, left out.
    shift_norm_um, phi_mdeg : list of float
        Predicted |s| [um] and phi [mdeg] at each prediction.
    damage : str
        What is wrong with the input; empty if nothing.
    """

    joint_states: int = 0
    predictions: int = 0
    commands: int = 0
    corrections: int = 0
    trajectories: int = 0
    corrected_trajectories: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    warnings: Counter[str] = field(default_factory=Counter)
    replaced: int = 0
    shift_norm_um: list[float] = field(default_factory=list)
    phi_mdeg: list[float] = field(default_factory=list)
    damage: str = ""
    _first_of_kind: dict[str, str] = field(default_factory=dict, repr=False)

    def refuse(self, topic: str, reason: object) -> None:
        """Count a message of a topic that gave no result."""
        text = f"{topic}: {reason}"
        self.refused[self._first_of_kind.setdefault(NUMBER.sub("#", text), text)] += 1

    def as_values(self) -> dict[str, Any]:
        """Return the counts and reasons as programs read them."""
        return {
            "joint_states": self.joint_states,
            "predictions": self.predictions,
            "commands": self.commands,
            "corrections": self.corrections,
            "trajectories": self.trajectories,
            "corrected_trajectories": self.corrected_trajectories,
            "warnings": dict(self.warnings),
            "refused": dict(self.refused),
            "damage": self.damage,
        }


def replay(
    recording: str | Path,
    model: str | Path,
    output: str | Path,
    settings: tuple[StreamSettings, StreamSettings] | None = None,
    topics: Mapping[str, str] | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> ReplaySummary:
    """Write a recording again with predicted errors and corrected commands added.

    Parameters
    ----------
    recording : path
        Folder or `.mcap` file.
    model : path
        Model file.
    output : path
        Folder or `.mcap` file to write: the input, plus the outputs that the nodes would have sent.
    settings : (StreamSettings, StreamSettings), optional
        As the nodes'; the defaults if None.
    topics : mapping, optional
        Actual by standard topic name.
    overwrite : bool
        Replace an existing recording.
    progress : callable
        Called with messages done and in all.

    Returns
    -------
    ReplaySummary
        Counts and reasons.

    Raises
    ------
    WristError
        If the model or the recording cannot be used, or no joint state at all can be predicted;
        then nothing is written.
    """
    prediction, correction = settings or node_settings(None)
    error_model = load_model(model)
    source = open_recording(recording)
    names = _actual_names(source, topics or {})
    signals = {actual: standard for standard, actual in names.items() if standard not in SAMPLED}
    sampled = {names[standard]: standard for standard in SAMPLED if standard in names}
    summary = ReplaySummary()
    predicting = PredictionStream(error_model, prediction)
    correcting = CorrectionStream(error_model, correction, enabled=True)
    ahead = SignalsAhead(source, signals, (predicting, correcting), summary.refuse)
    total = sum(topic.count for topic in source.topics)
    with RecordingWriter(output, overwrite=overwrite) as writer:
        for done, raw in enumerate(source.raw_messages()):
            if done % PROGRESS_EVERY == 0:
                progress(done, total)
            topic = raw.channel.topic
            if topic in OUTPUTS:
                summary.replaced += 1
                continue
            writer.write_raw(raw.channel, raw.payload, raw.log_time_ns)
            if topic not in sampled:
                continue
            ahead.read_for(raw.log_time_ns)
            try:
                if sampled[topic] == MOTOR_TRAJECTORY:
                    plan = decode(JointTrajectory, raw.payload)
                    answers = _plan(plan, raw.log_time_ns, correcting, summary)
                elif sampled[topic] == MOTOR_COMMANDS:
                    answers = _correct(decode(JointState, raw.payload), correcting, summary)
                else:
                    answers = _predict(decode(JointState, raw.payload), predicting, summary)
                for name, message in answers:
                    writer.write(name, message, raw.log_time_ns)
            except WristError as error:
                summary.refuse(topic, error)
        if not summary.predictions:
            reason = next(iter(summary.refused), source.damage or "there is none")
            raise RecordingError(
                f"{source.path}: none of {summary.joint_states} joint states could be predicted; "
                f"the first reason: {reason}"
            )
    progress(total, total)
    summary.damage = source.damage
    return summary


def _actual_names(source: Recording, chosen: Mapping[str, str]) -> dict[str, str]:
    """Return the actual by the standard name of every topic that is there to be used."""
    present = {topic.name: topic for topic in source.topics}
    covariates = (name for name in (*present, *chosen) if name.startswith(COVARIATES))
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
    state: JointState, predicting: PredictionStream, summary: ReplaySummary
) -> Iterator[tuple[str, Message]]:
    summary.joint_states += 1
    sample = predicting.on_joint_state(
        state.header.stamp_ns, state.name, state.position, state.velocity
    )
    prediction = sample.prediction
    summary.predictions += 1
    summary.warnings.update((*prediction.warnings, *predicting.dropped_signals))
    summary.shift_norm_um.append(1e6 * prediction.shift_norm)
    summary.phi_mdeg.append(1e3 * float(np.degrees(prediction.phi)))
    header = Header(state.header.stamp_ns, BASE_FRAME)
    yield POSE_ERROR_PREDICTED, pose_message(header, prediction.twist, prediction.covariance)


def _correct(
    state: JointState, correcting: CorrectionStream, summary: ReplaySummary
) -> Iterator[tuple[str, Message]]:
    summary.commands += 1
    corrected = correcting.on_command(
        state.header.stamp_ns, state.header.frame_id, state.name, state.position, state.velocity
    )
    if corrected.fault is not None:
        summary.refuse(MOTOR_COMMANDS, corrected.fault)
    summary.corrections += corrected.correction is not None
    header = Header(state.header.stamp_ns, CORRECTED_FRAME)
    yield (
        MOTOR_COMMANDS_CORRECTED,
        JointState(
            header, state.name, tuple(corrected.positions.tolist()), state.velocity, state.effort
        ),
    )
    yield MOTOR_POSITIONS_CORRECTED, Float64MultiArray(data=tuple(corrected.theta.tolist()))
    if corrected.correction is not None:
        header = Header(state.header.stamp_ns, BASE_FRAME)
        yield (
            POSE_ERROR_RESIDUAL,
            pose_message(
                header, corrected.correction.after, corrected.correction.prediction.covariance
            ),
        )
        at_task_point = correcting.residual_at_task_point(corrected.correction)
        if at_task_point is not None:
            yield POSE_ERROR_RESIDUAL_TASK, pose_message(header, *at_task_point)


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
        summary.refuse(MOTOR_TRAJECTORY, corrected.fault)
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
    yield MOTOR_TRAJECTORY_CORRECTED, replace(plan, header=header, points=points)


def pose_message(header: Header, twist: Array, covariance: Array) -> PoseWithCovarianceStamped:
    """Return a twist as a recording's message.

    Parameters
    ----------
    header : Header
        Stamp and frame.
    twist : (6,) float
        At O in F [m, rad].
    covariance : (6, 6) float
        Of the twist.

    Returns
    -------
    PoseWithCovarianceStamped
        Position s, orientation R_err.
    """
    position, quaternion = pose_of_twist(twist)
    pose = Pose(Point(*position.tolist()), Quaternion(*quaternion.tolist()))
    return PoseWithCovarianceStamped(
        header, PoseWithCovariance(pose, tuple(covariance.ravel().tolist()))
    )
