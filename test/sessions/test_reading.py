"""A recording becomes a measured session by the nodes' rules, and says what it could not use."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import Frames, SensorFrame
from wrist_stiffness.compensation.load_history import LoadHistory
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import FrameError, StaleLoadError
from wrist_stiffness.model.block import Load
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
)
from wrist_stiffness.recording.samples import DEFAULT_JOINTS
from wrist_stiffness.sessions.reading.machine_signals import _speeds, machine_signals
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.reading.signals import Signal, in_order

SECOND = 1_000_000_000
MILLISECOND = 1_000_000


@pytest.fixture
def complete(campaign):
    return campaign.with_joints().with_loads().with_poses()


def random_turns(rng, count, size):
    return Rotation.from_rotvec(size * rng.standard_normal((count, 3)))


def test_angles_are_interpolated_at_the_stamps_of_the_poses(tmp_path, campaign, complete, table):
    session = read_session(complete.written(tmp_path / "bag"), table)
    neighbours = campaign.theta(campaign.joint_ns)
    expected = 0.5 * (neighbours[1:] + neighbours[:-1])
    np.testing.assert_allclose(session.block.theta, expected, atol=1e-15)
    np.testing.assert_array_equal(session.block.time, campaign.pose_ns / SECOND)
    # The chord of 10 ms of this motion is all that separates it from the truth.
    np.testing.assert_allclose(session.rotation, campaign.rigid(campaign.pose_ns), atol=1e-12)
    assert session.measured.all()
    assert session.remarks == ()
    assert session.name == "bag"


def test_a_constant_count_stays_exactly_that_count():
    signal = in_order(np.array([3, 10, 20]) + 1_700_000_000_000_000_000, np.full((3, 1), 0.1))
    at = np.array([5, 10, 19]) + 1_700_000_000_000_000_000
    np.testing.assert_array_equal(signal.interpolated(at), np.full((3, 1), 0.1))


def test_messages_in_any_order_are_put_into_that_of_their_stamps():
    """As two publishers, or a network, mix them; of equal stamps the last one received counts."""
    found = in_order(np.array([30, 10, 20, 10]), np.array([[3.0], [1.0], [2.0], [1.5]]))
    assert found.time_ns.tolist() == [10, 20, 30]
    assert found.values.tolist() == [[1.5], [2.0], [3.0]]


def speeds(campaign, time_ns):
    """Return the motors' speeds (n, 2) at stamps."""
    late, early = (campaign.theta(time_ns + ns) for ns in (MILLISECOND, -MILLISECOND))
    return (late - early) / 2e-3


def test_speeds_are_used_where_drivers_tell_them(tmp_path, campaign, table):
    """Also where they are a fifth larger than those of the angles."""
    told = 1.2 * speeds(campaign, campaign.joint_ns)
    for stamp, angles, velocity in zip(
        campaign.joint_ns, campaign.theta(campaign.joint_ns), told, strict=True
    ):
        state = JointState(
            Header(int(stamp), ""), DEFAULT_JOINTS, tuple(angles.tolist()), tuple(velocity.tolist())
        )
        campaign.add("/joint_states", stamp, state)
    campaign.with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    true = 1.2 * speeds(campaign, campaign.pose_ns[: len(session)])
    np.testing.assert_allclose(session.block.theta_dot, true, atol=2e-3 * np.abs(true).max())
    assert session.remarks == ()


def test_speeds_that_are_not_those_of_the_angles_are_left_and_said(tmp_path, campaign, table):
    campaign.with_joints(velocity=(0.25, -0.5)).with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    true = speeds(campaign, campaign.pose_ns[: len(session)])
    # Some of the recording's ends is cut off.
    middle = slice(20, -20)
    found = session.block.theta_dot[middle]
    np.testing.assert_allclose(found, true[middle], atol=2e-3 * np.abs(true).max())
    (said,) = session.remarks
    assert "the speeds of motor_1 in the joint states are" in said


@pytest.mark.parametrize("told", [{}, {"velocity": (0.0, 0.0)}])
def test_speeds_that_drivers_leave_out_are_those_of_dense_angles(tmp_path, campaign, table, told):
    """Poses may be rare: a difference between two of them is the speed of another moment."""
    stamps = campaign.joint_ns[7:-7:20]
    campaign.with_joints(**told).with_loads().with_poses(stamps=stamps)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    late, early = (campaign.theta(stamps + ns) for ns in (MILLISECOND, -MILLISECOND))
    true = (late - early) / 2e-3
    np.testing.assert_allclose(session.block.theta_dot, true, atol=2e-3 * np.abs(true).max())


def test_speeds_of_dense_angles_hold_to_their_ends_and_over_gaps():
    """Also where the stamps are near to each other here and minutes apart there."""
    steps = np.random.default_rng(3).integers(1, 10 * MILLISECOND, 500)
    steps[250] = 120 * SECOND
    time_ns = 1_700_000_000 * SECOND + np.cumsum(steps)
    slope = np.array([0.3, -0.1])
    angles = 1e-9 * (time_ns - time_ns[0])[:, None] * slope
    found = _speeds(Signal(time_ns, angles)).values
    np.testing.assert_allclose(found, np.tile(slope, (500, 1)), rtol=1e-6)
    assert _speeds(Signal(time_ns[:1], angles[:1])) is None


def test_sparse_angles_tell_no_speeds(tmp_path, campaign, table):
    campaign.with_joints()
    campaign.entries = campaign.entries[::10]
    campaign.with_loads().with_poses(stamps=campaign.joint_ns[20:-20])
    assert read_session(campaign.written(tmp_path / "bag"), table).block.theta_dot is None


def test_the_load_is_the_one_that_the_nodes_would_use():
    """Some stamps are equal, some too old: held against the nodes' own history."""
    rng = np.random.default_rng(2)
    stamps = rng.integers(1, 50, 30) * SECOND // 10
    # The nodes' history forgets all where the clock jumps back: this test is not about that.
    stamps = np.sort(stamps)
    wrenches = rng.standard_normal((30, 6))
    history = LoadHistory(0.25, Frames())
    for stamp, wrench in zip(stamps.tolist(), wrenches, strict=True):
        history.keep(stamp, Load(wrench))
    signal = in_order(stamps, wrenches)
    asked = np.sort(np.append(rng.integers(1, 60 * SECOND // 10, 200), stamps))
    newest = signal.newest(asked)
    for stamp, row in zip(asked.tolist(), newest, strict=True):
        try:
            expected = history.at(stamp)
        except StaleLoadError:
            assert row < 0 or stamp - signal.time_ns[row] > 0.25 * SECOND
            continue
        assert signal.time_ns[row] == expected[0]
        np.testing.assert_array_equal(signal.values[row], expected[1].wrench)


def test_poses_without_a_young_load_are_left_out_and_counted(tmp_path, campaign, table):
    campaign.with_joints().with_poses()
    loads = len(campaign.entries)
    campaign.with_loads()
    del campaign.entries[loads + 400 :]
    session = read_session(campaign.written(tmp_path / "bag"), table)
    # The last load is stamped 3.99 s and holds for 0.5 s, for poses up to 4.485 s.
    assert len(session) == 449
    assert session.remarks == (
        "350 measured poses are not used: no load estimate in the 0.5 s before",
    )


def test_loads_are_moved_to_O_as_the_nodes_move_them(tmp_path, campaign, table):
    turn = Rotation.from_euler("xyz", [10.0, 20.0, 30.0], degrees=True).as_matrix()
    sensor = SensorFrame("wrist_platform", turn, np.array([0.01, 0.02, 0.03]), "environment")
    frames = Frames({"ft": sensor})
    campaign.with_joints().with_loads("ft", lambda i: (0.5, 0.01 * i, -1.0)).with_poses()
    session = read_session(
        campaign.written(tmp_path / "bag"), table, settings=StreamSettings(frames=frames)
    )
    expected = [frames.load("ft", (0.5, 0.01 * i, -1.0), (0.0, 0.0, 0.0)) for i in range(799)]
    np.testing.assert_allclose(session.block.load, [load.wrench for load in expected], atol=1e-15)
    assert session.block.load_on_platform


def test_loads_in_F_and_in_U_do_not_mix(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_loads("wrist_platform").with_poses()
    samples = read_samples(open_recording(campaign.written(tmp_path / "bag")))
    with pytest.raises(FrameError, match="wrist_base, wrist_platform are mixed"):
        machine_signals(samples, Frames(), table)


def test_temperatures_and_covariates_are_held(tmp_path, campaign, complete, table):
    start = campaign.joint_ns[0]
    for after_s, value in ((1, 20.0), (3, 21.0), (5, float("nan"))):
        complete.with_temperature("link_1", start + after_s * SECOND, value)
        complete.with_covariate("humidity", start + after_s * SECOND, 2 * value)
    session = read_session(complete.written(tmp_path / "bag"), table)
    late = session.block.time > (start + 3 * SECOND) / SECOND
    np.testing.assert_array_equal(session.block.temperatures["link_1"], np.where(late, 21, 20))
    np.testing.assert_array_equal(session.block.covariates["humidity"], np.where(late, 42, 40))
    assert any("not finite" in remark for remark in session.remarks)


def test_a_thermometer_of_no_place_is_told(campaign, complete, table, tmp_path):
    complete.with_temperature("link1", campaign.joint_ns[0], 20.0)
    (remark,) = read_session(complete.written(tmp_path / "bag"), table).remarks
    assert "temperatures of 'link1': the wrist has no such place; known are link_1" in remark


@pytest.mark.parametrize(("reading", "said"), [(293.15, True), (80.0, False)])
def test_kelvin_in_the_place_of_degrees_is_asked_for(
    tmp_path, campaign, complete, table, reading, said
):
    complete.with_temperature("motor_1", campaign.joint_ns[0], reading)
    session = read_session(complete.written(tmp_path / "bag"), table)
    asked = "temperatures of motor_1 go up to 293.1 degC: are they in K?"
    assert session.remarks == ((asked,) if said else ())


def test_where_the_frame_of_a_tracker_can_be_told_is_said(tmp_path, campaign, table):
    campaign.with_joints().with_loads("ft").with_poses()
    with pytest.raises(FrameError, match="--parameters FILE can tell where"):
        read_session(campaign.written(tmp_path / "bag"), table)


def covariance_message(header, pose, variance):
    return PoseWithCovarianceStamped(
        header, PoseWithCovariance(pose, tuple(np.diag(variance).ravel().tolist()))
    )


@pytest.mark.parametrize(
    ("variance", "measured"),
    [
        ([4e-12, 4e-12, 4e-12, 1e6, 1e6, 1e6], [1, 1, 1, 0, 0, 0]),
        ([1e6, 1e6, 1e6, 1e-8, 1e-8, 1e-8], [0, 0, 0, 1, 1, 1]),
        ([1e6, 1e6, 4e-12, 1e6, 1e6, 1e6], [0, 0, 1, 0, 0, 0]),
        ([4e-12, 4e-12, 4e-12, 1e6, 1e-8, 1e-8], [1, 1, 1, 0, 0, 0]),
    ],
    ids=["points only", "pointing only", "one dial gauge", "turn measured in part"],
)
def test_a_huge_variance_says_not_measured(tmp_path, complete, table, variance, measured):
    complete.entries = [
        (topic, stamp, covariance_message(message.header, message.pose, variance))
        if isinstance(message, PoseStamped)
        else (topic, stamp, message)
        for topic, stamp, message in complete.entries
    ]
    session = read_session(complete.written(tmp_path / "bag"), table)
    np.testing.assert_array_equal(session.measured, np.tile(measured, (len(session), 1)) > 0)
    known = np.array(variance) < 1.0
    np.testing.assert_allclose(np.diag(session.covariance), np.where(known, variance, 0.0))
    in_part = any("799 of 799 orientations are measured in part" in r for r in session.remarks)
    assert in_part == (measured == [1, 1, 1, 0, 0, 0] and variance[4] < 1.0)


@pytest.mark.parametrize("stated", [4e-12, 0.0], ids=["stated", "not stated"])
def test_what_most_poses_did_not_measure_says_nothing_of_the_others(
    tmp_path, complete, table, stated
):
    """So the rows of a table are that only tell the way: their variance is no noise of 1 km."""
    rng = np.random.default_rng(5)
    complete.entries = [
        (topic, stamp, covariance_message(m.header, m.pose, np.full(6, variance)))
        if isinstance(m, PoseStamped)
        else (topic, stamp, m)
        for topic, stamp, m in complete.entries
        for variance in [1e6 if rng.random() < 0.7 else stated]
    ]
    session = read_session(complete.written(tmp_path / "bag"), table)
    assert 0.2 < session.measured.all(axis=1).mean() < 0.4
    if stated:
        np.testing.assert_allclose(np.diag(session.covariance), stated)
    else:
        assert session.covariance is None


def test_poses_of_a_mapped_frame_are_turned_into_F(tmp_path, campaign, table):
    turn = Rotation.from_euler("xyz", [40.0, -25.0, 70.0], degrees=True).as_matrix()
    origin = np.array([1.2, -0.4, 0.3])
    campaign.frame_id = "tracker"
    shift = 1e-5 * np.random.default_rng(0).standard_normal((799, 3))
    campaign.with_joints().with_loads()
    campaign.with_poses((shift - origin) @ turn, turn.T @ campaign.rigid(campaign.pose_ns))
    path = campaign.written(tmp_path / "bag")
    frames = Frames({"tracker": SensorFrame("wrist_base", turn, origin)})
    session = read_session(path, table, settings=StreamSettings(frames=frames))
    np.testing.assert_allclose(session.shift, shift, atol=1e-15)
    np.testing.assert_allclose(session.rotation, campaign.rigid(campaign.pose_ns), atol=1e-13)
    with pytest.raises(FrameError, match="'tracker'"):
        read_session(path, table)


def moved_by(motion, rotation, shift):
    turn, place = motion
    return turn @ rotation, (turn @ shift[..., None])[..., 0] + place


def test_motion_of_the_frame_is_taken_out(tmp_path, campaign, complete, table):
    """The frame sinks by 0.1 mm and turns by 1 mrad; a target stands on it 0.3 m from O."""
    growth = np.linspace(0.0, 1.0, 799)
    turn = Rotation.from_rotvec(np.outer(growth, [0.0, 1e-3, 0.0])).as_matrix()
    place = np.outer(growth, [0.0, 0.0, -1e-4])
    # The frame stands still at first: what it is there is the reference.
    turn[:40], place[:40] = np.eye(3), 0.0
    rotation, shift = moved_by((turn, place), campaign.rigid(campaign.pose_ns), np.zeros((799, 3)))
    campaign.entries = []
    campaign.with_joints().with_loads().with_poses(shift, rotation)
    target = np.tile([0.3, 0.1, -0.2], (799, 1))
    target_rotation, target_shift = moved_by((turn, place), np.tile(np.eye(3), (799, 1, 1)), target)
    count = len(campaign.entries)
    campaign.with_poses(target_shift, target_rotation)
    campaign.entries[count:] = [
        ("/frame_pose_measured", stamp, message) for _, stamp, message in campaign.entries[count:]
    ]
    session = read_session(campaign.written(tmp_path / "bag"), table)
    np.testing.assert_allclose(session.shift, 0.0, atol=1e-12)
    np.testing.assert_allclose(session.rotation, campaign.rigid(campaign.pose_ns), atol=1e-12)
    assert any("motion of the frame taken out" in remark for remark in session.remarks)


def test_a_frame_that_stands_still_adds_no_noise(tmp_path, campaign, complete, table):
    rng = np.random.default_rng(1)
    count = len(complete.entries)
    noise = random_turns(rng, 799, 1e-4).as_matrix()
    complete.with_poses(1e-5 * rng.standard_normal((799, 3)) + 0.3, noise)
    complete.entries[count:] = [
        ("/frame_pose_measured", stamp, message) for _, stamp, message in complete.entries[count:]
    ]
    session = read_session(complete.written(tmp_path / "bag"), table)
    np.testing.assert_array_equal(session.shift, 0.0)
    assert any("stood still" in remark for remark in session.remarks)


def test_notes_are_merged_and_what_is_no_json_is_said(tmp_path, complete, table):
    complete.with_note('{"wrist": "a", "session": "1"}').with_note('{"session": "2"}')
    complete.with_note("by hand")
    session = read_session(complete.written(tmp_path / "bag"), table)
    assert session.notes == {"wrist": "a", "session": "2"}
    assert session.remarks == ("note 'by hand' is no JSON object: not used",)


def test_a_part_of_a_session_keeps_what_is_said_of_the_whole(tmp_path, complete, table):
    session = read_session(complete.with_note("x").written(tmp_path / "bag"), table)
    part = session.take(slice(10, 20))
    assert len(part) == 10
    assert part.remarks == session.remarks
    assert part.clock_offset_s == session.clock_offset_s


def test_the_way_between_poses_that_are_far_apart_is_told(tmp_path, campaign, table):
    """Poses every second; motor 1 turns back at 1, 3, 5 and 7 s, motor 2 at other times."""
    campaign.with_joints().with_loads().with_poses(stamps=campaign.pose_ns[50::100])
    session = read_session(campaign.written(tmp_path / "bag"), table)
    measured = session.measured.all(axis=1)
    assert measured.sum() == 8
    theta, time = session.block.theta, session.block.time - 1_700_000_000
    for reversal in (1.0, 3.0, 5.0, 7.0):
        row = int(np.argmin(np.abs(time - reversal)))
        assert not measured[row]
        assert abs(theta[row, 0]) == pytest.approx(np.radians(20.0), rel=1e-9)
    # Between the rows both angles go one way only.
    dense = campaign.theta(campaign.joint_ns[55:750])
    rows = np.searchsorted(time, 1e-9 * (campaign.joint_ns[55:750] - 1.7e18))
    for start, end in zip(range(len(time) - 1), range(1, len(time)), strict=True):
        between = dense[rows == end]
        if len(between) > 1:
            low = np.minimum(theta[start], theta[end]) - 2 * np.radians(0.015)
            high = np.maximum(theta[start], theta[end]) + 2 * np.radians(0.015)
            assert np.all((between >= low) & (between <= high))


def test_a_pull_between_two_poses_is_told(tmp_path, campaign, table):
    pulled = {130: (0.0, 0.0, -3.0)}
    campaign.with_joints().with_loads(force=lambda i: pulled.get(i, (0.0, 0.0, -1.0)))
    campaign.with_poses(stamps=campaign.pose_ns[50::100])
    session = read_session(campaign.written(tmp_path / "bag"), table)
    row = int(np.argmin(session.block.load[:, 2]))
    assert session.block.load[row, 2] == -3.0
    assert session.block.time[row] == pytest.approx(1_700_000_001.3, rel=0, abs=1e-6)
    assert not session.measured[row].any()
