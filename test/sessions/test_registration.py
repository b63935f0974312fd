"""Where an instrument stands and its target sits is told by the wrist's own motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.recording.messages import Header, Pose, PoseStamped
from wrist_stiffness.sessions.in_pieces import rigid_rotation
from wrist_stiffness.sessions.reading.registration import Registration, place_left, turn_left
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.topics import INSTRUMENT_FRAME

INSTRUMENT = Rotation.from_euler("xyz", [12.0, -25.0, 130.0], degrees=True).as_matrix()
TARGET = Rotation.from_euler("xyz", [5.0, 8.0, -40.0], degrees=True).as_matrix()
O_SEEN = np.array([1.4, -1.3, 0.6])
PLACE = np.array([0.015, 0.020, -0.030])
NOISE = 1e-5  # m and rad of one pose, a tracker's

TOLERANCE = 5.0 * NOISE / np.sqrt(799)
"""Of the mean over all poses: five standard deviations."""


@pytest.fixture
def tracked(campaign):
    """A tracker two metres away, its target off O, one pose in a hundred wild by centimetres."""
    rng = np.random.default_rng(0)
    campaign.frame_id = "instrument"
    campaign.with_joints().with_loads()
    rigid = campaign.rigid(campaign.pose_ns)
    noise = Rotation.from_rotvec(NOISE * rng.standard_normal((799, 3))).as_matrix()
    shift = (rigid @ PLACE + NOISE * rng.standard_normal((799, 3))) @ INSTRUMENT.T + O_SEEN
    shift[50::100] += rng.normal(0.0, 0.05, (8, 3))
    return campaign.with_poses(shift, INSTRUMENT @ noise @ rigid @ TARGET)


def test_poses_come_into_the_wrist_s_frame(tmp_path, tracked, table):
    session = read_session(tracked.written(tmp_path / "bag"), table)
    sound = np.isfinite(session.shift).all(axis=1)
    assert (~sound).sum() == 8  # the wild ones
    rigid = tracked.rigid(tracked.pose_ns)[sound]
    left = Rotation.from_matrix(session.rotation[sound] @ np.swapaxes(rigid, 1, 2)).as_rotvec()
    assert np.abs(session.shift[sound].mean(axis=0)).max() < TOLERANCE
    assert np.abs(left.mean(axis=0)).max() < TOLERANCE
    assert np.std(session.shift[sound]) < 1.2 * NOISE
    stand = ", ".join(f"{1e3 * each:.0f}" for each in -INSTRUMENT.T @ O_SEEN)
    (said,) = (remark for remark in session.remarks if "was registered" in remark)
    turned = np.degrees(Rotation.from_matrix(INSTRUMENT).magnitude())
    assert f"stands at ({stand}) mm in wrist_base, turned by {turned:.1f} deg" in said
    assert "sits at (15, 20, -30) mm" in said


def test_a_mirrored_instrument_is_told_by_its_markers(tmp_path, campaign, table):
    """Left-handed axes: one sign turned."""
    campaign.frame_id = "instrument"
    nominal = table.geometry.platform.readout_points
    seen = nominal @ np.swapaxes(campaign.rigid(campaign.pose_ns), 1, 2)
    seen = seen @ INSTRUMENT.T + O_SEEN
    campaign.with_joints().with_loads().with_markers(seen * [1.0, -1.0, 1.0])
    with pytest.raises(InputError, match="bag: measured markers: .* axes are left-handed"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_positions_alone_do_not_tell_where_it_stands(tmp_path, table):
    rows = "".join(f"{i},{i},{-i},1400,{i}.5,-600\n" for i in range(6))
    (tmp_path / "t.csv").write_text("time_s,motor_1_deg,motor_2_deg,x_mm,y_mm,z_mm\n" + rows)
    import_csv(tmp_path / "t.csv", tmp_path / "bag", unloaded=True, frame=INSTRUMENT_FRAME)
    with pytest.raises(InputError, match="points alone do not tell where .* without --register"):
        read_session(tmp_path / "bag", table)


def test_a_wrist_that_hardly_moves_does_not_tell_where_it_stands(tmp_path, campaign, table):
    still = 1e-3 * campaign.theta(campaign.pose_ns)
    rigid = campaign.mechanism.forward(still).platform
    noise = 1e-3 * np.random.default_rng(1).standard_normal((799, 3))
    campaign.frame_id = "instrument"
    campaign.theta = lambda stamps: 1e-3 * type(campaign).theta(campaign, stamps)
    campaign.with_joints().with_loads()
    campaign.with_poses(rotation=INSTRUMENT @ Rotation.from_rotvec(noise).as_matrix() @ rigid)
    with pytest.raises(InputError, match="about a second axis, .* move both motors"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_another_unknown_frame_is_a_mistake(tmp_path, campaign, table):
    campaign.frame_id = "tracker"
    campaign.with_joints().with_loads().with_poses()
    with pytest.raises(FrameError, match="'tracker'"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_the_wrist_s_frame_must_be_seen_by_the_same_instrument(tmp_path, tracked, table):
    for stamp in tracked.pose_ns:
        header = Header(int(stamp), "wrist_base")
        tracked.add("/frame_pose_measured", stamp, PoseStamped(header, Pose()))
    with pytest.raises(FrameError, match="bag: poses come in several frames: instrument, wrist_ba"):
        read_session(tracked.written(tmp_path / "bag"), table)


def test_a_stated_scatter_turns_with_the_axes():
    standing = Registration(INSTRUMENT, TARGET, O_SEEN, PLACE)
    along_x = standing.covariance(np.diag([1.0, 0.0, 0.0, 0.0, 0.0, 4.0]))
    np.testing.assert_allclose(along_x[:3, :3], np.outer(INSTRUMENT[0], INSTRUMENT[0]))
    np.testing.assert_allclose(along_x[3:, 3:], 4.0 * np.outer(INSTRUMENT[2], INSTRUMENT[2]))


def test_wild_positions_have_no_say_in_where_the_target_is(table):
    """One in ten is off by centimetres, all to one side, as a prism that was mixed up is."""
    rng = np.random.default_rng(3)
    rigid = rigid_rotation(table, np.radians(rng.uniform(-20.0, 20.0, (600, 2))))
    target, stand = 1e-3 * np.array([6.0, -4.8, 6.4]), np.array([0.1, -0.2, 0.3])
    noise = 1e-6 * rng.standard_normal((600, 3))
    shift = rigid @ target + stand + noise
    wild = np.arange(0, 600, 10)
    shift[wild] += rigid[wild] @ [0.03, 0.0, 0.02]
    shift[5::10] = np.nan
    left, found = place_left(shift, rigid)
    sound = np.setdiff1d(np.arange(600), [*wild, *range(5, 600, 10)])
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(target), rel=1e-3)
    np.testing.assert_allclose(left[sound], noise[sound], atol=1e-6)
    assert np.isnan(left[5::10]).all()


@pytest.mark.parametrize(("moving", "jitter_mdeg"), [(1.0, 1.0), (0.1, 100.0)])
def test_wild_rotations_have_no_say_in_how_the_instrument_stands(table, moving, jitter_mdeg):
    """One in ten is off by 90 deg, as of a target whose markers were mixed up.

    Of a wrist that hardly moves it is motion all the same that tells the instrument, jitter or not.
    """
    rng = np.random.default_rng(3)
    theta = np.radians(rng.uniform(-20.0, 20.0, (600, 2)))
    rest = rng.uniform(size=600) > moving
    theta[rest] = 0.1
    askew = Rotation.from_euler("xyz", [3.0, -3.0, 9.0], degrees=True)
    target = Rotation.from_euler("xyz", [20.0, 5.0, -30.0], degrees=True)
    noise = np.radians(1e-3 * np.where(rest, 1.0, jitter_mdeg))[:, None] * rng.standard_normal(
        (600, 3)
    )
    rigid = rigid_rotation(table, theta)
    rotation = askew * Rotation.from_rotvec(noise) * Rotation.from_matrix(rigid) * target
    wild = np.arange(0, 600, 10)
    rotation[wild] = Rotation.from_euler("y", 90.0, degrees=True) * rotation[wild]
    left = turn_left(rotation.as_matrix(), rigid)
    sound = np.setdiff1d(np.arange(600), wild)
    np.testing.assert_allclose(left[sound], noise[sound], atol=np.radians(1e-3 * jitter_mdeg))
