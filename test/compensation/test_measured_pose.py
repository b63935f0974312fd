"""What the pose sensor says, in any frame, by poses or markers, on a frame that moves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import Frames, SensorFrame
from wrist_stiffness.compensation.monitor import MonitorSettings, MonitorStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.joint_uncertainty import JointUncertainty

SECOND = 1_000_000_000
NAMES = ("motor_1_joint", "motor_2_joint")
THETA = np.array([0.3, -0.2])
DOWN = np.array([0.2, 0.0, -1.0, 0.0, 0.01, 0.0])
EXTRA = np.array([3e-6, -2e-6, 5e-6, 1e-4, -2e-4, 3e-4])
"""What the wrist does beyond the model [m, rad]."""
FIRST_ORDER = 1e-8  # m or rad: products of the twists
NAN = float("nan")
TRACKER = Frames(
    {"tracker": SensorFrame("wrist_base", Rotation.from_euler("z", 90, degrees=True).as_matrix())}
)


@pytest.fixture
def stream(model):
    stream = MonitorStream(
        model,
        StreamSettings(frames=TRACKER),
        MonitorSettings(np.full(6, 1e-6), joint_age_limit_s=1.0),
    )
    stream.loads.add(SECOND, "wrist_base", DOWN[:3], DOWN[3:])
    stream.on_joint_state(SECOND, NAMES, THETA)
    return stream


@pytest.fixture
def pose(model):
    """Rotation and place of a wrist that departs from the model by EXTRA."""
    prediction = model.predict(THETA, Load(DOWN))
    rotation, shift = prediction.motion
    turn = Rotation.from_rotvec(EXTRA[3:]).as_matrix()
    return turn @ rotation @ prediction.configuration.platform, turn @ shift + EXTRA[:3]


def quaternion(rotation):
    return Rotation.from_matrix(rotation).as_quat()


def assert_extra(judged):
    assert np.allclose(judged.residual, EXTRA, rtol=0, atol=FIRST_ORDER)


def test_what_a_registration_hides_is_no_uncertainty_of_a_residual(stream, pose, model):
    """Else a calibrated model would blunt the alarm by tens of micrometres that never change."""
    rotation, place = pose
    seen = SECOND, "wrist_base", place, quaternion(rotation)
    before = stream.on_pose(*seen).covariance
    hidden = JointUncertainty((), np.full(6, 1e-7), np.full(6, 3e-5))
    stream.model = replace(model, joint=hidden)
    added = stream.on_pose(*seen).covariance - before
    assert np.allclose(added, 1e-14 * np.eye(6), rtol=1e-3, atol=1e-18)
    predicted = [each.predict(THETA, Load(DOWN)).covariance for each in (stream.model, model)]
    assert np.allclose(predicted[0] - predicted[1], 9e-10 * np.eye(6), rtol=1e-6, atol=1e-16)


def test_markers_tell_the_same_residual_as_the_pose(stream, pose, model):
    rotation, place = pose
    points = model.table.geometry.platform.readout_points
    assert_extra(stream.on_pose(SECOND, "wrist_base", place, quaternion(rotation)))
    seen = points @ rotation.T + place
    assert_extra(stream.on_markers(SECOND, "wrist_base", seen))
    lost = seen.copy()
    lost[1, 2] = NAN
    assert_extra(stream.on_markers(SECOND, "wrist_base", lost))


def test_markers_that_cannot_be_used_say_why(stream, pose, model):
    rotation, place = pose
    points = model.table.geometry.platform.readout_points @ rotation.T + place
    with pytest.raises(InputError, match=f"{len(points) - 1} came, the geometry names"):
        stream.on_markers(SECOND, "wrist_base", points[1:])
    for far in (1e4, 1e200, float("inf")):
        wild = points.copy()
        wild[0, 0] = far
        with pytest.raises(InputError, match="beyond 1000 m"):
            stream.on_markers(SECOND, "wrist_base", wild)
    points[2:] = NAN
    with pytest.raises(InputError, match="2 given; at least 3 needed"):
        stream.on_markers(SECOND, "wrist_base", points)
    with pytest.raises(FrameError, match="frame 'moon'.*wrist_base, tracker"):
        stream.on_markers(SECOND, "moon", points)


def test_a_pose_in_a_mapped_frame_is_turned_to_the_base(stream, pose, model):
    """The tracker's x is y of the base; so is its variance."""
    rotation, place = pose
    turn = TRACKER.sensors["tracker"].rotation
    there = turn.T @ place, quaternion(turn.T @ rotation)
    assert_extra(stream.on_pose(SECOND, "tracker", *there))
    points = model.table.geometry.platform.readout_points @ rotation.T + place
    assert_extra(stream.on_markers(SECOND, "tracker", points @ turn))
    unmeasured = stream.on_pose(SECOND, "tracker", *there, np.array([1e9, 0, 0, 0, 0, 0])).residual
    assert np.isnan(unmeasured).tolist() == [False, True, False, False, False, False]


def moved(rotation, place, turn, shift):
    return turn @ rotation, turn @ place + shift


# A target far from O, whose own pose means nothing; then the frame and all on it move.
TARGET = (Rotation.from_rotvec([0.4, 0.1, -1.0]).as_matrix(), np.array([0.3, -0.2, 0.1]))
MOTION = (Rotation.from_rotvec([1e-3, 2e-3, -1e-3]).as_matrix(), np.array([4e-5, -3e-5, 1e-5]))


def test_the_motion_of_the_frame_is_taken_out(stream, pose, model):
    def frame_at(stamp, rotation, place):
        stream.on_frame_pose(stamp, "wrist_base", place, quaternion(rotation))

    def judged(stamp, rotation, place):
        return stream.on_pose(stamp, "wrist_base", place, quaternion(rotation))

    frame_at(SECOND, *TARGET)
    assert_extra(judged(SECOND, *pose))
    later = SECOND + SECOND // 2
    stream.loads.add(later, "wrist_base", DOWN[:3], DOWN[3:])
    platform = moved(*pose, *MOTION)
    assert np.abs(judged(later, *platform).residual - EXTRA).max() > 1e-5
    frame_at(later, *moved(*TARGET, *MOTION))
    assert_extra(judged(later, *platform))
    points = model.table.geometry.platform.readout_points @ platform[0].T + platform[1]
    assert_extra(stream.on_markers(later, "wrist_base", points))


def test_a_frame_that_was_measured_once_must_go_on_being_measured(stream, pose):
    rotation, place = pose
    stream.on_frame_pose(SECOND - 2 * SECOND // 3, "wrist_base", TARGET[1], quaternion(TARGET[0]))
    stream.on_pose(SECOND, "wrist_base", place, quaternion(rotation))
    later = SECOND + SECOND // 2
    stream.loads.add(later, "wrist_base", DOWN[:3], DOWN[3:])
    with pytest.raises(InputError, match=r"newest pose of the frame is 1\.167 s older \(limit 1 s"):
        stream.on_pose(later, "wrist_base", place, quaternion(rotation))
    with pytest.raises(InputError, match="measured pose: a coordinate of 1e.200 m is beyond"):
        stream.on_pose(later, "wrist_base", [0.0, 1e200, 0.0], [0.0, 0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="measured frame pose: .* is not finite"):
        stream.on_frame_pose(later, "wrist_base", [NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
