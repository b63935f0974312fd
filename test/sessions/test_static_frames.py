"""Sensors speak in frames that a recording's `/tf_static` places, as the nodes hear it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.commands.export_csv import export_csv
from wrist_stiffness.compensation.intake import Frames, SensorFrame
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError
from wrist_stiffness.recording.messages import (
    Header,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
)
from wrist_stiffness.sessions.reading.session import read_session

TURN = Rotation.from_euler("xyz", [40.0, -25.0, 70.0], degrees=True)
ORIGIN = np.array([1.2, -0.4, 0.3])


def placed(parent, child, place, turn, scale=1.0):
    quaternion = Quaternion(*(scale * turn.as_quat()).tolist())
    transform = Transform(Vector3(*np.asarray(place).tolist()), quaternion)
    return TransformStamped(Header(0, parent), child, transform)


@pytest.fixture
def tracked(campaign):
    """Poses in a tracker's frame, which hangs at a stand on the wrist's base."""
    campaign.frame_id = "tracker"
    campaign.shift = 1e-5 * np.random.default_rng(0).standard_normal((799, 3))
    campaign.with_joints().with_loads()
    turn = TURN.as_matrix()
    rotation = turn.T @ campaign.rigid(campaign.pose_ns)
    return campaign.with_poses((campaign.shift - ORIGIN) @ turn, rotation)


def test_poses_are_turned_by_a_chain_of_fixed_transforms(tmp_path, tracked, table):
    stand = np.array([0.5, 0.0, 0.1])
    start = tracked.joint_ns[0]
    chain = (
        placed("stand", "tracker", ORIGIN - stand, TURN),
        placed("wrist_base", "stand", stand, Rotation.identity()),
    )
    for step in chain:
        tracked.add("/tf_static", start, TFMessage((step,)))
    path = tracked.written(tmp_path / "bag")
    session = read_session(path, table)
    np.testing.assert_allclose(session.shift, tracked.shift, atol=1e-15)
    np.testing.assert_allclose(session.rotation, tracked.rigid(tracked.pose_ns), atol=1e-13)
    export_csv(path, tmp_path / "poses.csv", table)
    first = np.genfromtxt(tmp_path / "poses.csv", delimiter=",", names=True)[0]
    assert first["x_mm"] == pytest.approx(1e3 * tracked.shift[0, 0], abs=1e-12)
    # What the user maps goes before what the recording says.
    mapped = Frames({"tracker": SensorFrame("wrist_base", TURN.as_matrix(), ORIGIN + 1e-3)})
    moved = read_session(path, table, settings=StreamSettings(frames=mapped))
    np.testing.assert_allclose(moved.shift, tracked.shift + 1e-3, atol=1e-15)


def test_another_name_of_the_topic_is_followed(tmp_path, tracked, table):
    step = placed("wrist_base", "tracker", ORIGIN, TURN)
    tracked.add("/cell/tf_static", tracked.joint_ns[0], TFMessage((step,)))
    path = tracked.written(tmp_path / "bag")
    session = read_session(path, table, remaps={"/tf_static": "/cell/tf_static"})
    np.testing.assert_allclose(session.shift, tracked.shift, atol=1e-15)
    with pytest.raises(FrameError, match="'tracker'"):
        read_session(path, table)


def test_a_transform_that_is_none_is_said(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses()
    broken = placed("wrist_base", "ft", ORIGIN, TURN, scale=0.5)
    campaign.add("/tf_static", campaign.joint_ns[0], TFMessage((broken,)))
    (remark,) = read_session(campaign.written(tmp_path / "bag"), table).remarks
    assert remark.startswith("/tf_static: static transform wrist_base -> ft:")
    assert remark.endswith("not used")


def test_two_places_of_one_frame_are_said(tmp_path, tracked, table):
    """As two publishers do; the same place told twice is no contradiction."""
    start = tracked.joint_ns[0]
    for place in (ORIGIN + 0.01, ORIGIN, ORIGIN + 1e-9):
        step = placed("wrist_base", "tracker", place, TURN)
        tracked.add("/tf_static", start, TFMessage((step,)))
    session = read_session(tracked.written(tmp_path / "bag"), table)
    np.testing.assert_allclose(session.shift, tracked.shift, atol=1e-8)
    (remark,) = session.remarks
    assert "'tracker' stands in two places" in remark


def test_a_frame_that_is_missing_for_its_transform_is_none_says_so(tmp_path, tracked, table):
    broken = placed("wrist_base", "tracker", [np.nan, 0.0, 0.0], TURN)
    tracked.add("/tf_static", tracked.joint_ns[0], TFMessage((broken,)))
    path = tracked.written(tmp_path / "bag")
    with pytest.raises(FrameError, match="bag: .*'tracker'.*static transform wrist_base -> track"):
        read_session(path, table)


def test_frames_are_known_with_a_leading_slash_too(tmp_path, tracked, table):
    """As what was written for ROS 1 names them."""
    tracked.add(
        "/tf_static",
        tracked.joint_ns[0],
        TFMessage((placed("/wrist_base", "/tracker", ORIGIN, TURN),)),
    )
    session = read_session(tracked.written(tmp_path / "bag"), table)
    np.testing.assert_allclose(session.shift, tracked.shift, atol=1e-15)


def test_a_chain_that_ends_elsewhere_says_so(tmp_path, tracked, table):
    for step in (("world", "stand"), ("stand", "tracker"), ("wrist_platform", "ft")):
        tracked.add("/tf_static", tracked.joint_ns[0], TFMessage((placed(*step, ORIGIN, TURN),)))
    path = tracked.written(tmp_path / "bag")
    told = "'tracker' is neither .* not to wrist_base or wrist_platform: stand, tracker, world$"
    with pytest.raises(FrameError, match=told):
        read_session(path, table)
    with pytest.raises(FrameError, match=told):
        export_csv(path, tmp_path / "poses.csv", table)
