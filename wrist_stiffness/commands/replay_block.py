"""A recording's messages through the streams, by the thousand where nothing stands against it.

The streams' blocks are the compiled loop that serves a live sample, so the numbers are those of a
node to the bit; a model with a memory is asked sample by sample.  What a block cannot do (a clock
that jumps, a trajectory, a payload of another layout) goes message by message.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness import topics
from wrist_stiffness.commands.signals_ahead import SignalsAhead
from wrist_stiffness.commands.wrist_drawing import Drawings
from wrist_stiffness.compensation.corrected import CorrectedBlock
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.stream import PredictedBlock, PredictionStream
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.mechanism.vectors import dot
from wrist_stiffness.recording import messages as msg
from wrist_stiffness.recording.cdr import decode, encode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.chunk_writer import Messages
from wrist_stiffness.recording.fixed_layout import FixedLayout, decode_batches
from wrist_stiffness.recording.raw_block import Integers, RawBlock, RawMessage
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.topics import BASE_FRAME, CORRECTED_FRAME, MICROMETRES, MILLIDEGREES

ROOM = 8
"""Places for a message and its answers, so that each answer follows its message."""

POSE_ERROR = FixedLayout.of(msg.PoseWithCovarianceStamped(msg.Header(frame_id=BASE_FRAME)))
TWO_NUMBERS = FixedLayout.of(msg.Float64MultiArray(data=(0.0, 0.0)))
VECTOR = FixedLayout.of(msg.Vector3Stamped(msg.Header(frame_id=BASE_FRAME)))


NUMBER = re.compile(r"(?<!\w)-?\d+(\.\d+)?(e[-+]?\d+)?")
"""A value in a message; not the digits of a name such as motor_1_joint."""


@dataclass
class Sizes:
    """Mean and maximum of what was never kept."""

    count: int = 0
    total: float = 0.0
    most: float = 0.0

    def add(self, values: Array) -> None:
        """Count values (n,), not negative."""
        if len(values):
            self.count += len(values)
            self.total += float(values.sum())
            self.most = max(self.most, float(values.max()))

    @property
    def mean(self) -> float:
        """Mean of all."""
        return self.total / self.count


@dataclass
class ReplaySummary:
    """What a replay did."""

    remarks: list[str] = field(default_factory=list)  # on the whole recording
    # `joint_states`, `predictions`: joint states read, predictions written
    joint_states: int = 0
    predictions: int = 0
    # `commands`, `corrections`: commands read, commands that were changed
    commands: int = 0
    corrections: int = 0
    # `trajectories`, `corrected_trajectories`: the same of trajectories
    trajectories: int = 0
    corrected_trajectories: int = 0
    # samples without a result. Reasons that differ only in their numbers are one, told by the first
    # of them
    refused: Counter[str] = field(default_factory=Counter)
    # predictions by what the model had to leave out of them, such as an effect whose temperature
    # the recording lacks
    warnings: Counter[str] = field(default_factory=Counter)
    replaced: int = 0  # outputs of an earlier run in the input, left out
    # `shift_um`, `phi_mdeg`: predicted |s| [um] and phi [mdeg]
    shift_um: Sizes = field(default_factory=Sizes)
    phi_mdeg: Sizes = field(default_factory=Sizes)
    damage: str = ""  # what is wrong with the input; empty if nothing
    _first_of_kind: dict[str, str] = field(default_factory=dict, repr=False)

    def refuse(self, topic: str, reason: object) -> None:
        """Count a message of a topic that gave no result."""
        self.refused[self._first_like(f"{topic}: {reason}")] += 1

    def warn(self, warnings: Mapping[str, int]) -> None:
        """Count warnings of predictions, each with how often it was given."""
        for text, count in warnings.items():
            self.warnings[self._first_like(text)] += count

    def _first_like(self, text: str) -> str:
        """Return the first text that differs in its numbers alone."""
        return self._first_of_kind.setdefault(NUMBER.sub("#", text), text)

    def as_values(self) -> dict[str, Any]:
        """Return the counts and reasons as programs read them."""
        return {
            "remarks": self.remarks,
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


@dataclass
class _Joints:
    """Joint states or commands of one layout: which messages of a block, and what they say."""

    rows: Integers
    time_ns: Integers
    like: msg.JointState  # the first of them
    columns: Mapping[str, Any]
    stamps: Integers
    theta: Array
    theta_dot: Array | None


@dataclass(frozen=True, eq=False)
class BlockReplay:
    """Answers blocks of messages."""

    writer: RecordingWriter  # gets the messages and their answers
    predicting: PredictionStream
    correcting: CorrectionStream
    ahead: SignalsAhead  # feeds both
    sampled: Mapping[str, str]  # standard by actual name of the topics that are answered
    left_out: frozenset[str]  # topics of an earlier run
    drawings: Drawings
    summary: ReplaySummary

    def answer(self, block: RawBlock) -> bool:
        """Write a block with its answers; tell whether they could be had at once."""
        out = Messages()
        self._copy(block, out)
        found = self._together(block)
        if found is None:
            for row, raw in enumerate(block.messages()):
                if raw.channel.topic in self.sampled and raw.channel.topic not in self.left_out:
                    self._one(row, raw, out)
        else:
            self.ahead.read_for(int(block.time_ns[-1]))
            if topics.JOINT_STATES in found:
                self._predict(found[topics.JOINT_STATES], out)
            if topics.MOTOR_COMMANDS in found:
                self._correct(found[topics.MOTOR_COMMANDS], out)
        self.writer.write_block(out)
        return found is not None

    def _together(self, block: RawBlock) -> dict[str, _Joints] | None:
        """Return joint states and commands by standard name; None where one must go by itself."""
        found: dict[str, _Joints] = {}
        for topic, rows in block.topics().items():
            standard = self.sampled.get(topic)
            if standard is not None:
                joints = self._joints(block, rows, standard)
                if joints is None:
                    return None
                found[standard] = joints
        first_ns = min((int(joints.stamps[0]) for joints in found.values()), default=0)
        alone = self.predicting.in_blocks and self.correcting.in_blocks
        if found and not self.ahead.rises_until(int(block.time_ns[-1]), first_ns, not alone):
            return None
        return found

    def _joints(self, block: RawBlock, rows: Integers, standard: str) -> _Joints | None:
        """Return joint states or commands that are all alike and as they should be, else None."""
        if standard == topics.MOTOR_TRAJECTORY:
            return None
        batches, undecodable = decode_batches(msg.JointState, block.payloads(rows))
        if undecodable or len(batches) != 1:
            return None
        like, columns = batches[0].first, batches[0].columns
        if not isinstance(like, msg.JointState) or len(like.position) != len(like.name):
            return None
        motors = self.predicting.settings.motors
        if standard == topics.MOTOR_COMMANDS:
            motors = self.correcting.settings.motors
            if like.header.frame_id == CORRECTED_FRAME:
                return None
        try:
            places = motors.places(like.name)
        except WristError:
            return None
        stamps, positions = columns["header.stamp_ns"], columns["position"]
        if not (np.isfinite(positions).all() and stamps[0] > 0 and (np.diff(stamps) >= 0).all()):
            return None
        theta = np.ascontiguousarray(positions[:, list(places)])
        if standard == topics.MOTOR_COMMANDS and not self.correcting.within_limits(theta):
            return None
        theta_dot = None
        if len(like.velocity) == len(like.name):
            theta_dot = np.ascontiguousarray(columns["velocity"][:, list(places)])
        return _Joints(rows, block.time_ns[rows], like, columns, stamps, theta, theta_dot)

    def _copy(self, block: RawBlock, out: Messages) -> None:
        for place, channel in enumerate(block.channels):
            rows = np.flatnonzero(block.channel == place)
            if channel.topic in self.left_out:
                self.summary.replaced += len(rows)
            elif len(rows):
                number = self.writer.channel_id(channel)
                out.add(number, ROOM * rows, block.time_ns[rows], block.payloads(rows))

    def _one(self, row: int, raw: RawMessage, out: Messages) -> None:
        """Answer a message by itself, as a node does."""
        standard, topic = self.sampled[raw.channel.topic], raw.channel.topic
        self.ahead.read_for(raw.log_time_ns)
        at = np.array([row]), np.array([raw.log_time_ns])
        try:
            if standard == topics.MOTOR_TRAJECTORY:
                self._plan(decode(msg.JointTrajectory, raw.payload), at, out)
                return
            state = decode(msg.JointState, raw.payload)
            stamps = np.array([state.header.stamp_ns])
            said = state.name, state.position, state.velocity
            if standard == topics.MOTOR_COMMANDS:
                self.summary.commands += 1
                frame_id = state.header.frame_id
                time_ns = raw.log_time_ns
                command = self.correcting.on_command(int(stamps[0]), frame_id, *said, time_ns)
                answers = CorrectedBlock.of([command], 1)
                others = [np.array([each]) for each in (state.velocity, state.effort) if each]
                positions = command.positions[None]
                self._add_commands(state, stamps, positions, others, answers, at, out)
                return
            self.summary.joint_states += 1
            one = self.predicting.on_joint_state(int(stamps[0]), *said)
            rows = one.twist[None], one.covariance[None], one.configuration.row[None]
            warnings = Counter((*one.warnings, *self.predicting.dropped_signals))
            predicted = PredictedBlock(np.ones(1, dtype=bool), *rows, {}, warnings)
            self._add_predictions(stamps, predicted, at, out)
        except WristError as error:
            self.summary.refuse(topic, error)

    def _plan(
        self, plan: msg.JointTrajectory, at: tuple[Integers, Integers], out: Messages
    ) -> None:
        summary, names = self.summary, plan.joint_names
        summary.trajectories += 1
        corrected = self.correcting.on_trajectory(
            # A zero stamp says "at once".
            plan.header.stamp_ns or int(at[1][0]),
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
        payload = encode(replace(plan, header=header, points=points))
        self._add(out, topics.MOTOR_TRAJECTORY_CORRECTED, msg.JointTrajectory, 1, *at, [payload])

    def _predict(self, joints: _Joints, out: Messages) -> None:
        self.summary.joint_states += len(joints.rows)
        predicted = self.predicting.on_joint_states(joints.stamps, joints.theta, joints.theta_dot)
        actual = next(name for name, known in self.sampled.items() if known == topics.JOINT_STATES)
        for error in predicted.faults.values():
            self.summary.refuse(actual, error)
        self._add_predictions(joints.stamps, predicted, (joints.rows, joints.time_ns), out)

    def _add_predictions(
        self,
        stamps: Integers,
        predicted: PredictedBlock,
        at: tuple[Integers, Integers],
        out: Messages,
    ) -> None:
        """Add what is said of n joint states; `at`: their rows in the block and log times [ns]."""
        summary = self.summary
        summary.warn(predicted.warnings)
        known = np.flatnonzero(predicted.known)
        summary.predictions += len(known)
        twist, stamps = predicted.twist[known], stamps[known]
        summary.shift_um.add(_lengths(pose_of_twist(twist)[0]) * MICROMETRES)
        summary.phi_mdeg.add(_lengths(twist[:, 3:]) * MILLIDEGREES)
        answers = at[0][known], at[1][known]
        rows = _pose_rows(stamps, twist, predicted.covariance[known])
        self._add(
            out, topics.POSE_ERROR_PREDICTED, msg.PoseWithCovarianceStamped, 1, *answers, rows
        )
        for rank, topic, vectors in (
            (2, topics.POSE_ERROR_S_UM, MICROMETRES * twist[:, :3]),
            (3, topics.POSE_ERROR_PHI_MDEG, MILLIDEGREES * twist[:, 3:]),
        ):
            rows = VECTOR.rows(stamps, *vectors.T)
            self._add(out, topic, msg.Vector3Stamped, rank, *answers, rows)
        configuration = Configuration.of_row(predicted.configuration[known])
        drawn, payloads = self.drawings.of(stamps, configuration, twist)
        answers = answers[0][drawn], answers[1][drawn]
        self._add(out, topics.WRIST_MARKERS, msg.MarkerArray, 4, *answers, payloads)

    def _correct(self, joints: _Joints, out: Messages) -> None:
        self.summary.commands += len(joints.rows)
        block = self.correcting.on_commands(joints.stamps, joints.theta, joints.theta_dot)
        like, columns = joints.like, joints.columns
        positions = columns["position"].copy()
        positions[:, list(self.correcting.settings.motors.places(like.name))] = block.theta
        others = [columns[name] for name in ("velocity", "effort") if name in columns]
        at = joints.rows, joints.time_ns
        self._add_commands(like, joints.stamps, positions, others, block, at, out)

    def _add_commands(
        self,
        like: msg.JointState,
        stamps: Integers,
        positions: Array,
        others: Sequence[Array],
        block: CorrectedBlock,
        at: tuple[Integers, Integers],
        out: Messages,
    ) -> None:
        """Add what is answered to n commands.

        `like`: the first; `positions`, `others`: corrected, and speeds and efforts, (n, joints);
        `at`: their rows in the block and log times [ns].
        """
        for place in sorted(block.faults):
            self.summary.refuse(topics.MOTOR_COMMANDS, block.faults[place])
        self.summary.corrections += int(np.count_nonzero(block.corrected))
        layout = FixedLayout.of(replace(like, header=msg.Header(frame_id=CORRECTED_FRAME)))
        rows = layout.rows(stamps, positions, *others)
        self._add(out, topics.MOTOR_COMMANDS_CORRECTED, msg.JointState, 1, *at, rows)
        rows = TWO_NUMBERS.rows(np.zeros(len(stamps), dtype=np.uint32), block.theta)
        self._add(out, topics.MOTOR_POSITIONS_CORRECTED, msg.Float64MultiArray, 2, *at, rows)
        own = np.flatnonzero(block.corrected)
        names = topics.POSE_ERROR_RESIDUAL, topics.POSE_ERROR_RESIDUAL_TASK
        residuals = self.correcting.residuals(block)
        for rank, (topic, residual) in enumerate(zip(names, residuals, strict=False), start=3):
            rows = _pose_rows(stamps[own], *residual)
            answers = at[0][own], at[1][own]
            self._add(out, topic, msg.PoseWithCovarianceStamped, rank, *answers, rows)

    def _add(
        self,
        out: Messages,
        topic: str,
        kind: type[msg.Message],
        rank: int,
        rows: Integers,
        time_ns: Integers,
        payloads: NDArray[np.uint8] | Sequence[bytes],
    ) -> None:
        if len(rows):
            number = self.writer.channel_id(channel_of(topic, kind))
            out.add(number, ROOM * rows + rank, time_ns, payloads)


def _lengths(vectors: Array) -> Array:
    """Return the lengths of vectors (n, 3)."""
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def _pose_rows(stamps: Integers, twist: Array, covariance: Array) -> NDArray[np.uint8]:
    """Return pose errors as payloads."""
    position, quaternion = pose_of_twist(twist)
    parts = [*position.T, *quaternion.T]
    return POSE_ERROR.rows(stamps, *parts, covariance.reshape(-1, 36))
