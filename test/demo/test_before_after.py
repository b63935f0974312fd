"""What correction bought, on recordings whose true errors are known by construction."""

import numpy as np
import pytest
from before_after import before_and_after
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
)
from wrist_stiffness.recording.writer import RecordingWriter

MILLISECOND = 1_000_000
MOTORS = ("motor_1_joint", "motor_2_joint")
TRUE_SHIFT_UM = np.array([3.0, 0.0, 4.0])
SAID_SHIFT_UM = np.array([3.0, 0.0, 0.0])
POINTING = 2e-4
SPIN = 5e-4
"""About the normal: no pointing error."""


def true_pose(table, stamp_ns, degrees):
    """A pose that is off by POINTING across the normal and by SPIN about it."""
    platform = table.mechanism.forward(np.radians(degrees)).platform
    normal = platform @ table.geometry.platform.normal
    across = np.cross(normal, [0.6, 0.8, 0.0])
    across *= POINTING / np.linalg.norm(across)
    rotation = Rotation.from_rotvec(across + SPIN * normal).as_matrix() @ platform
    quaternion = Rotation.from_matrix(rotation).as_quat()
    position = Point(*(1e-6 * TRUE_SHIFT_UM).tolist())
    pose = Pose(position, Quaternion(*quaternion.tolist()))
    return PoseStamped(Header(stamp_ns, "wrist_base"), pose)


# t [ms]        0      1000          2000            3000
# command     (0,0)   (20,-10)     (0,0) corrected  (20,-10) corrected
# true pose every 100 ms; residual with every corrected command
def run(path, table, corrected_from_ms=2000):
    with RecordingWriter(path) as writer:
        for at_ms in range(0, 4000, 100):
            ns = at_ms * MILLISECOND
            degrees = (20.0, -10.0) if at_ms // 1000 % 2 else (0.0, 0.0)
            angles = tuple(np.radians(degrees).tolist())
            writer.write("/motor_commands", JointState(Header(ns), MOTORS, angles), ns)
            on = at_ms >= corrected_from_ms
            header = Header(ns, "wrist_corrected" if on else "")
            writer.write("/motor_commands_corrected", JointState(header, MOTORS, angles), ns)
            if on:
                shift = Pose(Point(*(1e-6 * SAID_SHIFT_UM).tolist()), Quaternion())
                said = PoseWithCovarianceStamped(
                    Header(ns, "wrist_base"), PoseWithCovariance(shift)
                )
                writer.write("/pose_error_residual", said, ns)
            writer.write("/cell_simulator/platform_pose_true", true_pose(table, ns, degrees), ns)
    return path


def test_true_errors_and_what_is_handed_on(tmp_path, table):
    before, after = before_and_after(run(tmp_path / "run", table), table)
    for part in (before, after):
        # Pointing and spin compose to second order: 1e-7 rad.
        assert np.allclose(part.pointing, POINTING, rtol=0.0, atol=POINTING * SPIN)
        assert np.allclose(part.shift, 5e-6, rtol=1e-9)
    assert np.all(np.isnan(before.shift_handed_on))
    assert np.allclose(after.shift_handed_on, 4e-6, rtol=1e-9)


def test_only_poses_at_rest_count(tmp_path, table):
    before, after = before_and_after(run(tmp_path / "run", table), table)
    rest = np.arange(0.3, 1.0, 0.1)
    assert np.allclose(before.time_s, np.concatenate([rest, 1.0 + rest]))
    assert np.allclose(after.time_s, np.concatenate([2.0 + rest, 3.0 + rest]))


def test_the_floor_is_the_encoder_step_uniformly_spread(tmp_path, table):
    before, _ = before_and_after(run(tmp_path / "run", table), table)
    rng = np.random.default_rng(8)
    step = table.geometry.limits.encoder_step
    off = []
    for degrees in ((0.0, 0.0), (20.0, -10.0)):
        theta = np.radians(degrees)
        rounded = theta + rng.uniform(-0.5, 0.5, (20000, 2)) * step
        normals = [
            table.mechanism.normal(table.mechanism.forward(angles)) for angles in (rounded, theta)
        ]
        off.append(np.linalg.norm(normals[0] - normals[1], axis=-1))
    # 40000 draws know their RMS to a percent.
    assert before.floor == pytest.approx(np.sqrt(np.mean(np.square(off))), rel=0.01)


@pytest.mark.parametrize(
    ("corrected_from_ms", "text"), [(0, "not both off and on"), (9000, "no command was corrected")]
)
def test_both_passes_are_needed(tmp_path, table, corrected_from_ms, text):
    with pytest.raises(RecordingError, match=text):
        before_and_after(run(tmp_path / "run", table, corrected_from_ms), table)


def test_a_recording_without_true_poses(tmp_path, table):
    with RecordingWriter(tmp_path / "run") as writer:
        writer.write("/motor_commands", JointState(Header(0), MOTORS, (0.0, 0.0)), 0)
    with pytest.raises(RecordingError, match="no /cell_simulator/platform_pose_true"):
        before_and_after(tmp_path / "run", table)
