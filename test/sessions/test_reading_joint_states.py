"""Joint states that pause, are rare, wild or out of reach: what they cost, and that it is said."""

import numpy as np
import pytest

from wrist_stiffness.recording.messages import Header, JointState
from wrist_stiffness.sessions.reading.joint_states import without_held
from wrist_stiffness.sessions.reading.machine_signals import MachineSignals
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.reading.signals import Signal

MILLISECOND = 1_000_000
MOTORS = ("motor_1_joint", "motor_2_joint")


def paused(campaign, first, last):
    """Leave out the joint states between two of them."""
    del campaign.entries[first + 1 : last]
    return campaign


@pytest.fixture
def resting(campaign, monkeypatch):
    """A campaign in which the motors stand still."""
    monkeypatch.setattr(
        type(campaign), "theta", lambda own, time_ns: np.full((len(time_ns), 2), 0.1)
    )
    return campaign


def test_where_joint_states_pause_in_motion_poses_have_no_angles(tmp_path, campaign, table):
    """A straight way from one to the next is 9 deg wrong in the middle of a second."""
    paused(campaign.with_joints(), 300, 400).with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    (why,) = session.remarks
    assert "not used: the motors moved between joint states more than 0.2 s apart" in why
    assert 90 < 799 - len(session) <= 100
    time_ns = np.round(1e9 * session.block.time).astype(np.int64)
    # 5 ms of this motion, and what a stamp since 1970 tells.
    error = np.abs(session.block.theta - campaign.theta(time_ns))
    assert error.max() < np.radians(0.25)


def test_where_joint_states_pause_at_rest_nothing_is_lost(tmp_path, resting, table):
    paused(resting.with_joints(), 300, 400).with_loads().with_poses()
    session = read_session(resting.written(tmp_path / "bag"), table)
    assert session.measured.all()
    assert len(session) == 799


def test_between_rare_joint_states_poses_in_motion_have_no_angles(
    tmp_path, campaign, table, monkeypatch
):
    """Also where motor 1 turns back between two of them; after 4 s the wrist rests."""
    swing, end = type(campaign).theta, campaign.joint_ns[400]
    monkeypatch.setattr(
        type(campaign), "theta", lambda own, time_ns: swing(own, np.minimum(time_ns, end))
    )
    campaign.with_joints()
    campaign.entries = campaign.entries[::80]
    campaign.with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    told = (
        "measured poses are not used: the motors moved between joint states more than 0.2 s apart"
    )
    assert any(told in remark for remark in session.remarks)
    used = session.measured.any(axis=1)
    assert used.sum() > 200
    time_ns = np.round(1e9 * session.block.time).astype(np.int64)
    error = np.abs(session.block.theta - campaign.theta(time_ns))[used]
    assert error.max() < np.radians(0.05)


@pytest.mark.parametrize(("every", "all_told"), [(10, True), (20, False)])
def test_poses_whose_angles_rare_joint_states_do_not_tell_are_left_out(
    tmp_path, campaign, table, every, all_told
):
    """At up to 80 deg/s^2; a straight way is wrong by 0.1 deg at 10 Hz and by 0.4 deg at 5 Hz."""
    campaign.with_joints()
    campaign.entries = campaign.entries[::every]
    time_ns = campaign.pose_ns[campaign.pose_ns < campaign.joint_ns[-every]]
    campaign.with_loads().with_poses(stamps=time_ns)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert (len(session) == len(time_ns)) == (session.remarks == ()) == all_told
    assert len(session) > 0.4 * len(time_ns)
    time_ns = np.round(1e9 * session.block.time).astype(np.int64)
    assert np.degrees(np.abs(session.block.theta - campaign.theta(time_ns))).max() < 0.22


def test_dense_joint_states_tell_angles_also_beside_one_that_leaps(tmp_path, campaign, table):
    """A leap of 10 deg in 10 ms and back after three is no motion; four gaps hold a part of it."""
    swing = campaign.theta(campaign.joint_ns)
    swing[400:403] += np.radians(10.0)
    campaign.theta = lambda time_ns: swing
    campaign.with_joints()
    del campaign.theta
    campaign.with_loads().with_poses(rotation=campaign.rigid(campaign.pose_ns))
    assert len(read_session(campaign.written(tmp_path / "bag"), table)) == 799


def test_poses_after_the_last_reading_are_not_said_to_lack_joint_states(tmp_path, campaign, table):
    """The last angles are sent for 0.3 s more; nobody knows where the wrist went meanwhile."""
    rows = np.minimum(np.arange(800) // 5 * 5, 770)
    swing = campaign.theta(campaign.joint_ns[rows])
    campaign.theta = lambda time_ns: swing
    campaign.with_joints()
    del campaign.theta
    campaign.with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert not any("no joint state within" in remark for remark in session.remarks)
    told = [remark for remark in session.remarks if "after they were last read" in remark]
    assert [remark.split()[0] for remark in told] == [str(799 - len(session))]


def test_between_rare_joint_states_at_rest_nothing_is_lost(tmp_path, resting, table):
    resting.with_joints()
    resting.entries = resting.entries[::80]
    resting.with_loads().with_poses(stamps=resting.pose_ns[:700])
    session = read_session(resting.written(tmp_path / "bag"), table)
    assert session.measured.all()
    assert len(session) == 700


def test_far_from_any_joint_state_a_wrist_that_seems_at_rest_is_not_known(tmp_path, resting, table):
    """It may have gone and come back: a second and a half is told to half a second off its ends."""
    paused(resting.with_joints(), 300, 450).with_loads().with_poses()
    session = read_session(resting.written(tmp_path / "bag"), table)
    (why,) = session.remarks
    assert why.startswith(f"{799 - len(session)} measured poses are not used: no joint state")
    assert 48 <= 799 - len(session) <= 51


def test_a_wild_joint_state_costs_no_pose_and_no_speed(tmp_path, campaign, table):
    true = campaign.theta
    right = true(campaign.joint_ns)
    wild = right.copy()
    wild[[100, 300], [0, 1]] += np.radians([5.0, -1.0])
    campaign.theta = lambda time_ns: wild
    campaign.with_joints()
    campaign.theta = true
    campaign.with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert session.remarks == ("2 of 800 joint states are wild: left out",)
    assert session.measured.all()
    late, early = (true(campaign.pose_ns + ns) for ns in (MILLISECOND, -MILLISECOND))
    speed = (late - early) / 2e-3
    found = session.block.theta_dot[:-3]
    np.testing.assert_allclose(found, speed[:-3], atol=6e-3 * np.abs(speed).max())
    np.testing.assert_allclose(session.block.theta, true(campaign.pose_ns), atol=np.radians(0.01))


def test_an_angle_that_cannot_be_reached_costs_its_pose_only(tmp_path, campaign, table):
    theta = campaign.theta(campaign.joint_ns)
    theta[300:302] = np.radians([0.0, 360.0])
    campaign.theta = lambda time_ns: theta
    campaign.with_joints()
    del campaign.theta
    campaign.with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert len(session) == 797
    assert any("cannot reach" in remark for remark in session.remarks)


@pytest.mark.parametrize("within_s", [0.2, 5.0])
def test_poses_that_were_measured_again_before_the_next_are_no_held_angles(within_s):
    """A measuring machine took each of thirty poses four times; the way to the next takes 5 s."""
    theta = np.repeat(np.random.default_rng(0).uniform(-0.5, 0.5, (30, 2)), 4, axis=0)
    wait_s = np.tile([5.0, within_s, within_s, within_s], 30)
    angles = Signal(np.round(1e9 * np.cumsum(wait_s)).astype(np.int64), theta)
    kept, held_s = without_held(angles)
    assert (len(kept), held_s) == (120, 0.0)


def test_angles_that_are_sent_again_and_again_are_taken_when_they_appear(tmp_path, campaign, table):
    """Read every 0.1 s, sent every 10 ms, at 30 deg/s; the wrist rests from 4 to 6 s."""
    count = np.arange(800)
    moment = campaign.joint_ns[np.where(count > 600, count - 200, np.minimum(count, 400))]
    true = np.round(campaign.theta(moment) / np.radians(0.015)) * np.radians(0.015)
    campaign.theta = lambda time_ns: true[count - count % 10]
    campaign.with_joints()
    del campaign.theta
    rotation = campaign.mechanism.forward(true[:-1]).platform
    campaign.with_loads().with_poses(rotation=rotation, stamps=campaign.joint_ns[:-1])
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert any("angles are read every 0.1 s" in remark for remark in session.remarks)
    rows = np.searchsorted(campaign.joint_ns, np.round(1e9 * session.block.time) - 1000)
    error = np.degrees(np.abs(session.block.theta - true[rows]))
    # A chord of 0.1 s at 80 deg/s^2 and a count; a held angle is wrong by up to 3 deg.
    at_turn = (rows > 390) & (rows < 412) | (rows > 590) & (rows < 612)
    assert error[~at_turn].max() < 0.12
    # Where the wrist stops and starts, its way between two readings is not known.
    assert error.max() < 0.25
    why = "the motors' speed changed between joint states so that their angles may be wrong by"
    assert any(why in remark for remark in session.remarks)
    assert len(session) > 740


def test_where_a_motor_turns_back_in_a_pause_poses_have_no_angles(
    tmp_path, campaign, table, monkeypatch
):
    """It is where it was at both ends of half a second, and was 3 deg away between."""

    def there_and_back(own, time_ns):
        t = 1e-9 * (np.asarray(time_ns) - own.joint_ns[0])
        return np.radians(np.stack([12.0 * np.abs(t - 3.25), np.full(len(t), 5.0)], axis=1))

    monkeypatch.setattr(type(campaign), "theta", there_and_back)
    paused(campaign.with_joints(), 300, 350).with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    time_ns = np.round(1e9 * session.block.time).astype(np.int64)
    error = np.abs(session.block.theta - campaign.theta(time_ns))
    assert error.max() < np.radians(0.1)
    assert 40 < 799 - len(session) <= 50


def test_a_motor_that_moves_into_a_long_pause_has_no_angles_in_it():
    """20 deg/s until a pause of half a minute, back from it the same way; at rest all are known."""
    time = np.concatenate([np.arange(0.0, 10.0, 0.01), np.arange(46.0, 56.0, 0.01)])
    for speed, known in ((20.0, False), (0.0, True)):
        way = np.maximum(np.where(time < 28.0, time - 10.0, 46.0 - time), -1.0)
        theta = np.radians(speed) * np.stack([way, way], axis=1)
        time_ns = np.round(1e9 * time).astype(np.int64)
        still = Signal(time_ns, np.zeros((len(time), 6)))
        signals = Signal(time_ns, theta), None, still, False, {}, {}
        machine = MachineSignals(*signals, load_age_limit_s=100.0)
        poses = np.round(1e9 * (9.99 + np.array([0.1, 0.2, 0.3, 0.45]))).astype(np.int64)
        assert (machine.usable(poses)[0] == known).all()


def test_motors_that_stand_still_and_jump_are_where_their_angles_are(tmp_path, campaign, table):
    """Each second command comes late, and the platform stands still meanwhile as the motors do."""
    moment = campaign.joint_ns[np.arange(800) // 2 * 2]
    jumping = campaign.theta(moment)
    campaign.theta = lambda time_ns: jumping
    campaign.with_joints()
    del campaign.theta
    campaign.with_loads().with_poses(rotation=campaign.rigid(moment), stamps=campaign.joint_ns)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    rows = np.searchsorted(1e-9 * campaign.joint_ns, session.block.time - 1e-3)
    np.testing.assert_allclose(session.block.theta, jumping[rows], atol=1e-12)
    assert not any("sent more often" in remark for remark in session.remarks)


def test_speeds_of_repeated_angles_are_taken_when_they_were_read(tmp_path, campaign, table):
    """A driver that repeats its angles repeats their speeds with them."""
    read = campaign.joint_ns[np.arange(800) // 10 * 10]
    late, early = (campaign.theta(read + ns) for ns in (MILLISECOND, -MILLISECOND))
    speed = (late - early) / 2e-3
    for stamp, angles, told in zip(campaign.joint_ns, campaign.theta(read), speed, strict=True):
        state = JointState(Header(int(stamp), ""), MOTORS, tuple(angles), tuple(told))
        campaign.add("/joint_states", stamp, state)
    campaign.with_loads().with_poses()
    session = read_session(campaign.written(tmp_path / "bag"), table)
    time_ns = np.round(1e9 * session.block.time).astype(np.int64)
    late, early = (campaign.theta(time_ns + ns) for ns in (MILLISECOND, -MILLISECOND))
    error = session.block.theta_dot - (late - early) / 2e-3
    # A chord of a tenth of a second; a held speed is wrong by up to 8 deg/s.
    assert np.degrees(np.abs(error)).max() < 0.4
