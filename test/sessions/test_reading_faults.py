"""Bad recordings: a clear error, or a result that says what it could not use."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError, RecordingError
from wrist_stiffness.recording.messages import PoseStamped
from wrist_stiffness.sessions.reading.refusals import LEAST_POSES
from wrist_stiffness.sessions.reading.session import read_session

SECOND = 1_000_000_000
MILLISECOND = 1_000_000


@pytest.fixture
def complete(campaign):
    return campaign.with_joints().with_loads().with_poses()


@pytest.mark.parametrize(
    ("absent", "named"),
    [
        ("/platform_pose_measured", "/platform_pose_measured or /platform_markers_measured"),
        ("/load_estimate", "/load_estimate"),
        ("/joint_states", "/joint_states"),
    ],
)
def test_an_absent_topic_is_named_with_those_that_are_there(
    tmp_path, complete, table, absent, named
):
    complete.entries = [entry for entry in complete.entries if entry[0] != absent]
    with pytest.raises(RecordingError, match=f"nothing on {named}") as caught:
        read_session(complete.written(tmp_path / "bag"), table)
    for topic in {"/joint_states", "/load_estimate", "/platform_pose_measured"} - {absent}:
        assert topic in str(caught.value)


def flipped(whole):
    """Every chunk damaged; the summary still names the topics."""
    data = bytearray(whole)
    data[len(data) // 3] ^= 0x10
    return bytes(data)


@pytest.mark.parametrize(
    ("damaged", "reason"),
    [
        (lambda whole: whole[:2000], r"damaged or cut within .*; 0 messages can be read"),
        (flipped, "does not match its checksum"),
    ],
    ids=["cut", "flipped"],
)
def test_where_damage_took_a_topic_nobody_is_told_to_rename_it(
    tmp_path, complete, table, damaged, reason
):
    complete.entries = complete.entries[:300]
    path = complete.written(tmp_path / "day.mcap")
    path.write_bytes(damaged(path.read_bytes()))
    with pytest.raises(RecordingError, match=reason) as caught:
        read_session(path, table)
    assert "nothing on /joint_states can be read: " in str(caught.value)
    assert "--topic" not in str(caught.value)


def test_another_clock_is_found_taken_out_and_reported(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses(late_ns=1_730_000_000)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    offset, sigma = session.clock_offset_s
    assert abs(offset - 1.73) < max(3.0 * sigma, 1e-4)
    assert any("+1.730 s" in remark and "taken out" in remark for remark in session.remarks)
    # 0.1 ms at 30 deg/s.
    np.testing.assert_allclose(session.rotation, campaign.rigid(campaign.pose_ns), atol=1e-12)
    np.testing.assert_allclose(session.block.time, campaign.pose_ns / SECOND, rtol=0, atol=1e-4)


def test_a_small_lag_is_reported_and_left_to_the_effect_time_delay(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses(late_ns=120 * MILLISECOND)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    offset, sigma = session.clock_offset_s
    assert abs(offset - 0.12) < max(3.0 * sigma, 1e-4)
    # The last poses are stamped behind the last joint state: no angles belong to them.
    used = len(session)
    expected = campaign.pose_ns[:used] / SECOND + 0.12
    np.testing.assert_allclose(session.block.time, expected, rtol=0, atol=1e-6)


def test_a_registration_is_no_clock_offset(tmp_path, campaign, table):
    turn = Rotation.from_euler("xyz", [0.2, -0.2, 0.2], degrees=True).as_matrix()
    campaign.with_joints().with_loads()
    campaign.with_poses(rotation=turn @ campaign.rigid(campaign.pose_ns) @ turn.T)
    offset, _ = read_session(campaign.written(tmp_path / "bag"), table).clock_offset_s
    assert abs(offset) < 1e-3


def test_without_motion_the_clocks_cannot_be_compared(tmp_path, campaign, table):
    campaign.theta = lambda time_ns: np.zeros((*np.shape(time_ns), 2))
    campaign.with_joints().with_loads().with_poses()
    assert read_session(campaign.written(tmp_path / "bag"), table).clock_offset_s is None


def test_clocks_that_do_not_overlap_are_an_error_with_both_ranges(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses(late_ns=-1_000_000 * SECOND)
    reason = (
        r"joint states are stamped 1700000000\.000 to 1700000007\.990 s, "
        r"measured poses 1699000000\.005 to 1699000007\.985 s"
    )
    with pytest.raises(RecordingError, match=reason):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_too_few_poses_are_refused_with_the_limit(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses(stamps=campaign.pose_ns[: LEAST_POSES - 1])
    with pytest.raises(InputError, match=f"4 of 4 .* at least {LEAST_POSES} are needed"):
        read_session(campaign.written(tmp_path / "few"), table)


def test_of_one_pose_nobody_says_that_the_load_never_changes(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses(stamps=campaign.pose_ns[:1])
    with pytest.raises(InputError, match=r"1 of 1 .* needed \(no more were recorded\)"):
        read_session(campaign.written(tmp_path / "one"), table)


def test_a_load_sensor_without_a_number_is_one_line(tmp_path, campaign, table):
    campaign.with_joints().with_loads(force=lambda i: (np.nan, 0.0, 0.0)).with_poses()
    with pytest.raises(InputError, match="no load estimate is finite; .* not finite, first at"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_poses_without_stamps_of_their_own_are_said(tmp_path, campaign, table):
    stamps = np.full(len(campaign.pose_ns), campaign.pose_ns[9])
    campaign.with_joints().with_loads().with_poses(stamps=stamps)
    with pytest.raises(InputError, match="1 of 1 .* 798 of 799 have the stamp of another one"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_just_enough_poses_are_read(tmp_path, campaign, table):
    campaign.with_joints().with_loads().with_poses(stamps=campaign.pose_ns[:LEAST_POSES])
    assert len(read_session(campaign.written(tmp_path / "bag"), table)) == LEAST_POSES


def test_a_load_that_never_changes_is_said(tmp_path, campaign, table):
    campaign.with_joints().with_loads(force=lambda i: (0.0, 0.0, -1.0)).with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert any("the load never changes" in remark for remark in session.remarks)


def test_loads_in_another_unit_are_said_and_not_dropped_in_silence(tmp_path, campaign, table):
    """Pulling ever harder, up to 102 N instead of 1: gram-force in place of newton."""
    campaign.with_joints().with_loads(force=lambda i: (0.0, 0.0, -102.0 * i / 799)).with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    limit = table.geometry.limits.force
    beyond = np.sum(np.abs(session.block.load[:, 2]) > limit)
    assert 0 < beyond < len(session)
    said = f"{beyond} of 799 measured poses are not used: the force at O goes up to 102 N"
    assert any(said in text and f"limit is {limit:g} N" in text for text in session.remarks)


@pytest.mark.parametrize(("offset_m", "read"), [(0.015, True), (0.025, False), (-1.5, False)])
def test_positions_far_from_o_are_refused(tmp_path, campaign, table, offset_m, read):
    shift = np.full((len(campaign.pose_ns), 3), [0.0, offset_m, 0.0])
    recording = campaign.with_joints().with_loads().with_poses(shift=shift).written(tmp_path / "b")
    if read:
        assert len(read_session(recording, table)) == len(shift)
        return
    said = f"more than {1e3 * abs(offset_m):g} mm .limit 20 mm. from the base's O along y"
    with pytest.raises(InputError, match=said):
        read_session(recording, table)


def test_swapped_motors_are_refused_and_named(tmp_path, campaign, table):
    """They look nearly like an instrument that is turned by a quarter."""
    campaign.with_joints(("motor_2_joint", "motor_1_joint")).with_loads().with_poses()
    both = "limit 5 deg.*with the motors swapped they agree; so they do with the instrument turned"
    with pytest.raises(InputError, match=both):
        read_session(campaign.written(tmp_path / "bag"), table)


@pytest.mark.parametrize(
    ("factor", "change"),
    [
        ([-1.0, 1.0], "the sign of motor 1 turned"),
        ([1.0, -1.0], "the sign of motor 2 turned"),
        (np.degrees([1.0, 1.0]), "angles taken as degrees"),
        (np.radians([1.0, 1.0]), "the angles of a table's _deg columns taken as radians"),
    ],
    ids=["sign of 1", "sign of 2", "degrees", "radians"],
)
def test_angles_of_a_wrong_sign_or_unit_are_named(tmp_path, campaign, table, factor, change):
    campaign.with_loads().with_poses()
    true = campaign.theta
    campaign.theta = lambda time_ns: true(time_ns) * factor
    campaign.with_joints()
    with pytest.raises(InputError, match=f"with {change} they agree"):
        read_session(campaign.written(tmp_path / "bag"), table)


@pytest.mark.parametrize(
    ("wrong", "change"),
    [
        (lambda right: Rotation.from_quat(right.as_quat()[:, [3, 0, 1, 2]]), "order w x y z"),
        (lambda right: right.inv(), "the rotations taken from base to platform"),
    ],
    ids=["w first", "inverse"],
)
def test_rotations_in_another_order_or_direction_are_named(
    tmp_path, campaign, table, wrong, change
):
    rotation = wrong(Rotation.from_matrix(campaign.rigid(campaign.pose_ns))).as_matrix()
    campaign.with_joints().with_loads().with_poses(rotation=rotation)
    with pytest.raises(InputError, match=f"{change} they agree"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_poses_of_another_wrist_are_refused(tmp_path, campaign, table):
    campaign.with_joints().with_loads()
    stretched = Rotation.from_matrix(campaign.rigid(campaign.pose_ns)).as_rotvec()
    campaign.with_poses(rotation=Rotation.from_rotvec(2.0 * stretched).as_matrix())
    with pytest.raises(InputError, match="not those of this wrist.*limit 5 deg"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_an_instrument_in_another_frame_is_refused_with_its_turn(tmp_path, campaign, table):
    instrument = Rotation.from_euler("xyz", [0.0, 60.0, 0.0], degrees=True).as_matrix()
    campaign.with_joints().with_loads()
    campaign.with_poses(rotation=instrument @ campaign.rigid(campaign.pose_ns))
    with pytest.raises(InputError, match="turned by 60 deg; map its frame"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_a_target_that_sits_anyhow_is_read(tmp_path, campaign, table):
    instrument = Rotation.from_euler("xyz", [1.0, 2.0, -1.0], degrees=True).as_matrix()
    target = Rotation.from_euler("xyz", [-40.0, 5.0, 90.0], degrees=True).as_matrix()
    campaign.with_joints().with_loads()
    campaign.with_poses(rotation=instrument @ campaign.rigid(campaign.pose_ns) @ target)
    assert len(read_session(campaign.written(tmp_path / "bag"), table)) == 799


def test_dropouts_are_counted(tmp_path, campaign, complete, table):
    nothing = np.full(3, np.nan)
    rotation = campaign.rigid(campaign.pose_ns)
    shift = np.zeros((799, 3))
    campaign.entries = []
    campaign.with_joints().with_loads().with_poses(shift, rotation)
    poses = [i for i, entry in enumerate(campaign.entries) if isinstance(entry[2], PoseStamped)]
    for i in poses[100:130]:
        topic, stamp, message = campaign.entries[i]
        pose = type(message.pose)(
            type(message.pose.position)(*nothing.tolist()),
            type(message.pose.orientation)(*[float("nan")] * 4),
        )
        campaign.entries[i] = (topic, stamp, PoseStamped(message.header, pose))
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert session.measured.all(axis=1).sum() == 769
    assert "measured pose: 30 of 799 lost by the instrument" in session.remarks


def test_positions_stay_where_only_the_orientation_is_not_a_number(tmp_path, campaign, table):
    shift = 5e-6 * np.random.default_rng(5).standard_normal((799, 3))
    campaign.with_joints().with_loads().with_poses(shift)
    poses = [i for i, entry in enumerate(campaign.entries) if isinstance(entry[2], PoseStamped)]
    for i in poses[::5]:
        topic, stamp, message = campaign.entries[i]
        blind = type(message.pose.orientation)(*[float("nan")] * 4)
        pose = replace(message.pose, orientation=blind)
        campaign.entries[i] = (topic, stamp, PoseStamped(message.header, pose))
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert session.measured[:, :3].all()
    np.testing.assert_allclose(session.shift, shift, atol=1e-15)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(session.rotation[:, 0, 0])) % 5, 0)
    told = "measured pose: 160 of 799 orientations are not finite: of these the position"
    assert any(remark.startswith(told) for remark in session.remarks)


@pytest.mark.parametrize(
    ("angle_deg", "load_late_s", "reason"),
    [(180.0, 0, "cannot reach"), (0.0, 100, "no load estimate in the 0.5 s before")],
)
def test_where_nothing_is_left_the_reason_is_said(
    tmp_path, campaign, table, angle_deg, load_late_s, reason
):
    campaign.theta = lambda time_ns: np.tile(np.radians([0.0, angle_deg]), (len(time_ns), 1))
    campaign.with_joints()
    del campaign.theta
    campaign.with_poses()
    loads = len(campaign.entries)
    campaign.with_loads()
    for i in range(loads, len(campaign.entries)):
        topic, stamp, message = campaign.entries[i]
        header = type(message.header)(stamp + load_late_s * SECOND, "wrist_base")
        campaign.entries[i] = (topic, stamp, type(message)(header, message.wrench))
    with pytest.raises(InputError, match=f"no measured pose can be used: .*{reason}"):
        read_session(campaign.written(tmp_path / "bag"), table)


def test_what_is_left_of_a_cut_recording_is_used_and_said(tmp_path, campaign, table):
    campaign.count = 5000
    campaign.with_joints().with_loads().with_poses()
    path = campaign.written(tmp_path / "bag.mcap")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    session = read_session(path, table)
    assert 1000 < len(session) < 4000
    used = round(float(np.ptp(session.block.time)))
    assert session.remarks[0].startswith(f"the recording is damaged, {used} s of it are used: ")


@pytest.mark.parametrize("same", [True, False])
def test_a_recording_of_another_geometry_is_said(tmp_path, campaign, complete, table, same):
    own = table.geometry.sha256
    campaign.with_note(json.dumps({"geometry_sha256": own if same else "f" * 64}))
    remarks = read_session(campaign.written(tmp_path / "bag"), table).remarks
    if same:
        assert remarks == ()
    else:
        (remark,) = remarks
        assert f"ffffffffffff..., the table's geometry {own[:12]}" in remark
        assert "another wrist, or its geometry was changed" in remark
