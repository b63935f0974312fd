"""Thousands of a recording's messages at once through the streams, where nothing stands against it.

The streams' blocks are the compiled loop that serves a live sample, so the numbers are those of a
node to the bit; a model with a memory is asked sample by sample.  What a block cannot do (a clock
that jumps, a trajectory, a payload of another layout) goes message by message.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness import topics
from wrist_stiffness.commands.replay_summary import ReplaySummary
from wrist_stiffness.commands.signals_ahead import SignalsAhead
from wrist_stiffness.commands.wrist_drawing import Drawings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.mechanism.vectors import dot
from wrist_stiffness.recording.batch import decode_batches
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.chunk_writer import Messages
from wrist_stiffness.recording.fixed_layout import FixedLayout
from wrist_stiffness.recording.messages import (
    Float64MultiArray,
    Header,
    JointState,
    MarkerArray,
    Message,
    PoseWithCovarianceStamped,
    Vector3Stamped,
)
from wrist_stiffness.recording.raw_block import Integers, RawBlock
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.topics import BASE_FRAME, CORRECTED_FRAME, MICROMETRES, MILLIDEGREES

ROOM = 8
"""Places for a message and its answers, so that each answer follows its message."""

POSE_ERROR = FixedLayout.of(PoseWithCovarianceStamped(Header(frame_id=BASE_FRAME)))
TWO_NUMBERS = FixedLayout.of(Float64MultiArray(data=(0.0, 0.0)))
VECTOR = FixedLayout.of(Vector3Stamped(Header(frame_id=BASE_FRAME)))


@dataclass
class _Joints:
    """Joint states or commands of one layout: which messages, and what they say."""

    rows: Integers
    time_ns: Integers
    like: JointState  # the first of them
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
        """Write a block with its answers; False, and nothing is done, where that cannot be."""
        found: dict[str, _Joints] = {}
        for topic, rows in block.topics().items():
            standard = self.sampled.get(topic)
            if standard == topics.MOTOR_TRAJECTORY:
                return False
            if standard is not None:
                joints = self._joints(block, rows, standard)
                if joints is None:
                    return False
                found[standard] = joints
        last_ns = int(block.time_ns[-1])
        first_ns = min((int(joints.stamps[0]) for joints in found.values()), default=0)
        alone = self.predicting.in_blocks and self.correcting.in_blocks
        if found and not self.ahead.rises_until(last_ns, first_ns, not alone):
            return False
        self.ahead.read_for(last_ns)
        out = Messages()
        self._copy(block, out)
        if topics.JOINT_STATES in found:
            self._predict(found[topics.JOINT_STATES], out)
        if topics.MOTOR_COMMANDS in found:
            self._correct(found[topics.MOTOR_COMMANDS], out)
        self.writer.write_block(out)
        return True

    def _joints(self, block: RawBlock, rows: Integers, standard: str) -> _Joints | None:
        """Return joint states or commands that are all alike and as they should be, else None."""
        batches, undecodable = decode_batches(JointState, block.payloads(rows))
        if undecodable or len(batches) != 1:
            return None
        like, columns = batches[0].first, batches[0].columns
        if not isinstance(like, JointState) or len(like.position) != len(like.name):
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

    def _predict(self, joints: _Joints, out: Messages) -> None:
        summary = self.summary
        summary.joint_states += len(joints.rows)
        predicted = self.predicting.on_joint_states(joints.stamps, joints.theta, joints.theta_dot)
        actual = next(name for name, known in self.sampled.items() if known == topics.JOINT_STATES)
        for error in predicted.faults.values():
            summary.refuse(actual, error)
        summary.warnings.update(predicted.warnings)
        known = np.flatnonzero(predicted.known)
        summary.predictions += len(known)
        twist = predicted.twist[known]
        summary.shift_um.add(_lengths(pose_of_twist(twist)[0]) * MICROMETRES)
        summary.phi_mdeg.add(_lengths(twist[:, 3:]) * MILLIDEGREES)
        answers = joints.rows[known], joints.time_ns[known]
        rows = _pose_rows(joints.stamps[known], twist, predicted.covariance[known])
        self._add(out, topics.POSE_ERROR_PREDICTED, PoseWithCovarianceStamped, 1, *answers, rows)
        for rank, topic, vectors in (
            (2, topics.POSE_ERROR_S_UM, MICROMETRES * twist[:, :3]),
            (3, topics.POSE_ERROR_PHI_MDEG, MILLIDEGREES * twist[:, 3:]),
        ):
            rows = VECTOR.rows(joints.stamps[known], *vectors.T)
            self._add(out, topic, Vector3Stamped, rank, *answers, rows)
        at = Configuration.of_row(predicted.configuration[known])
        drawn, payloads = self.drawings.of(joints.stamps[known], at, twist)
        answers = answers[0][drawn], answers[1][drawn]
        self._add(out, topics.WRIST_MARKERS, MarkerArray, 4, *answers, payloads)

    def _correct(self, joints: _Joints, out: Messages) -> None:
        summary, correcting = self.summary, self.correcting
        summary.commands += len(joints.rows)
        block = correcting.on_commands(joints.stamps, joints.theta, joints.theta_dot)
        for place in sorted(block.faults):
            summary.refuse(topics.MOTOR_COMMANDS, block.faults[place])
        summary.corrections += int(np.count_nonzero(block.corrected))
        like, columns, n = joints.like, joints.columns, len(joints.rows)
        positions = columns["position"].copy()
        positions[:, list(correcting.settings.motors.places(like.name))] = block.theta
        layout = FixedLayout.of(replace(like, header=Header(frame_id=CORRECTED_FRAME)))
        others = [columns[name] for name in ("velocity", "effort") if name in columns]
        answers = joints.rows, joints.time_ns
        rows = layout.rows(joints.stamps, positions, *others)
        self._add(out, topics.MOTOR_COMMANDS_CORRECTED, JointState, 1, *answers, rows)
        rows = TWO_NUMBERS.rows(np.zeros(n, dtype=np.uint32), block.theta)
        self._add(out, topics.MOTOR_POSITIONS_CORRECTED, Float64MultiArray, 2, *answers, rows)
        own = np.flatnonzero(block.corrected)
        answers = joints.rows[own], joints.time_ns[own]
        names = topics.POSE_ERROR_RESIDUAL, topics.POSE_ERROR_RESIDUAL_TASK
        residuals = correcting.residuals(block)
        for rank, (topic, residual) in enumerate(zip(names, residuals, strict=False), start=3):
            rows = _pose_rows(joints.stamps[own], *residual)
            self._add(out, topic, PoseWithCovarianceStamped, rank, *answers, rows)

    def _add(
        self,
        out: Messages,
        topic: str,
        kind: type[Message],
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
