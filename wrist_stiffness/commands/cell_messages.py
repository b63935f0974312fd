"""Messages of the virtual cell, written as numbers.

A fast cell says thousands of messages a second that differ in their numbers only: making and
encoding each as an object took longer than the physics behind it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness import topics
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.fixed_layout import FixedLayout
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    Message,
    PoseStamped,
    PoseWithCovarianceStamped,
    Temperature,
    WrenchStamped,
)
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.simulation.cell import SENSED, CellSample
from wrist_stiffness.topics import BASE_FRAME

NOT_MEASURED = 1e6
"""Variance of a part of the pose that the sensor does not see [m^2, rad^2]."""

THERMOMETER_STEP_K = 0.1

SECOND_NS = 10**9
TWO = (0.0, 0.0)

Mask = NDArray[np.bool_]


class CellMessages:
    """Loads, commands, joint states and measured poses of a recording.

    `writer`: open.  `whole`: whether the sensor sees position and rotation; else a huge variance
    says which it does not.
    """

    def __init__(self, writer: RecordingWriter, whole: bool) -> None:
        there, motors = Header(frame_id=BASE_FRAME), DEFAULT_JOINTS
        pose = PoseStamped(there) if whole else PoseWithCovarianceStamped(there)
        self._writer, self._whole = writer, whole
        self._load = _Stream(writer, topics.LOAD_ESTIMATE, WrenchStamped(there))
        self._command = _Stream(writer, topics.MOTOR_COMMANDS, JointState(Header(), motors, TWO))
        self._state = _Stream(writer, topics.JOINT_STATES, JointState(Header(), motors, TWO, TWO))
        self._pose = _Stream(writer, topics.PLATFORM_POSE, pose)

    def write(self, stamps_ns: Iterable[int], sent: Array, block: CellSample, warmth: Mask) -> None:
        """Write n samples; a load goes first, so that it has arrived with its joint state.

        `stamps_ns`: n stamps [ns].  `sent` (n, 2): motor commands [rad].  `block`: what the sensors
        said; a pose of which they measured nothing is not written.  `warmth` (n,): at which samples
        the thermometers speak.
        """
        states = np.concatenate([block.encoder, block.speed], axis=1)
        moved, turned = _known(block.measured_shift), _known(block.measured_rotation)
        poses = self._poses(block, moved, turned)
        numbers = (each.tolist() for each in (block.wrench, sent, states, poses))
        for n, (stamp_ns, load, command, state, pose) in enumerate(
            zip(stamps_ns, *numbers, strict=True)
        ):
            self._load.write(stamp_ns, load)
            self._command.write(stamp_ns, command)
            self._state.write(stamp_ns, state)
            if moved[n] or turned[n]:
                self._pose.write(stamp_ns, pose)
            if warmth[n]:
                self._write_temperatures(stamp_ns, block.temperature[n])

    def _poses(self, block: CellSample, moved: Mask, turned: Mask) -> Array:
        """Return the numbers of the measured poses, (n, 7), and of their variances, (n, 43)."""
        place = np.where(moved[:, None], block.measured_shift, 0.0)
        rotation = np.where(turned[:, None, None], block.measured_rotation, np.eye(3))
        quaternion = Rotation.from_matrix(rotation).as_quat(canonical=True)
        pose = np.concatenate([place, quaternion], axis=1)
        if self._whole:
            return pose
        unseen = np.repeat(~np.stack([moved, turned], axis=1), 3, axis=1)
        variance = NOT_MEASURED * unseen[:, :, None] * np.eye(6)
        return np.concatenate([pose, variance.reshape(len(pose), 36)], axis=1)

    def _write_temperatures(self, stamp_ns: int, celsius: Array) -> None:
        for component, each in zip(SENSED, celsius.tolist(), strict=True):
            shown = THERMOMETER_STEP_K * round(each / THERMOMETER_STEP_K)
            message = Temperature(Header(stamp_ns, component), shown, THERMOMETER_STEP_K**2 / 12.0)
            self._writer.write(topics.TEMPERATURES, message, stamp_ns)


def _known(part: Array) -> Mask:
    """Tell of which samples a part (n, ...) of the pose was measured, (n,): whole or not."""
    return np.isfinite(part.reshape(len(part), -1)[:, 0])


class _Stream:
    """Messages of one topic like a first one, but for their stamps and numbers."""

    def __init__(self, writer: RecordingWriter, topic: str, like: Message) -> None:
        self._writer, self._channel = writer, channel_of(topic, type(like))
        self._layout = FixedLayout.of(like)

    def write(self, stamp_ns: int, numbers: Iterable[float]) -> None:
        payload = self._layout.payload(*divmod(stamp_ns, SECOND_NS), *numbers)
        self._writer.write_raw(self._channel, payload, stamp_ns)
