"""A clock that is set during a session is told, and no two motions are taken for one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.sessions.reading.clocks import clock_step
from wrist_stiffness.sessions.reading.joint_states import mixed
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.reading.signals import Signal, set_back

SECOND = 1_000_000_000
MILLISECOND = 1_000_000
POSES = "/platform_pose_measured"


def set_by(campaign, seconds, topics, after=9.0, logged=False):
    """Set the clock of some topics that long after the start, the recorder's too where asked."""
    by, at = round(seconds * SECOND), campaign.joint_ns[0] + round(after * SECOND)
    for row, (topic, logged_ns, message) in enumerate(campaign.entries):
        if logged_ns > at and (topics is None or topic in topics):
            header = replace(message.header, stamp_ns=message.header.stamp_ns + by)
            message = replace(message, header=header)
            campaign.entries[row] = (topic, logged_ns + by * logged, message)


@pytest.fixture
def long(campaign):
    """Eighteen seconds, with the noise of an instrument."""
    campaign.count = 1800
    rng = np.random.default_rng(2)
    noise = Rotation.from_rotvec(np.radians(2e-3) * rng.standard_normal((1799, 3))).as_matrix()
    shift = 1e-6 * rng.standard_normal((1799, 3))
    return (
        campaign.with_joints()
        .with_loads()
        .with_poses(shift, noise @ campaign.rigid(campaign.pose_ns))
    )


def worst(session, table):
    """Largest angle between measured and rigid rotations [deg]."""
    known = session.measured.any(axis=1)
    rigid = table.mechanism.forward(session.block.theta[known]).platform
    off = Rotation.from_matrix(session.rotation[known] @ np.swapaxes(rigid, 1, 2)).magnitude()
    return np.degrees(off.max())


@pytest.mark.parametrize("seconds", [0.7, -0.7, 3.0, -3.0])
def test_a_pose_clock_that_is_set_meanwhile_is_followed(tmp_path, long, table, seconds):
    set_by(long, seconds, {POSES})
    session = read_session(long.written(tmp_path / "bag"), table)
    said = " ".join(session.remarks)
    assert f"the clock of the pose sensor steps by {seconds:+.3f} s" in said
    assert worst(session, table) < 0.1
    assert session.measured.any(axis=1).sum() > 1700 - 2 * 100 * max(-seconds, 0.0)
    assert abs(session.clock_offset_s[0]) < 1e-3


@pytest.mark.parametrize("seconds", [-0.5037, -3.0037])
@pytest.mark.parametrize("logged", [True, False], ids=["sorted", "as recorded"])
def test_what_was_stamped_twice_is_left_out(tmp_path, long, table, seconds, logged):
    """The times of reception go back as well, or tell the order."""
    set_by(long, seconds, None, logged=logged)
    session = read_session(long.written(tmp_path / "bag"), table)
    told = [each for each in session.remarks if "a clock was set back by about" in each]
    assert f"{9.0 + seconds:.1f}" in told[0]
    assert "to 9.0" in told[0]
    assert worst(session, table) < 0.1
    assert session.measured.any(axis=1).sum() > 1799 - 2.2 * 100 * abs(seconds) - 20


def test_a_clock_of_the_angles_alone_is_followed(tmp_path, long, table):
    set_by(long, -0.7, {"/joint_states", "/load_estimate"})
    session = read_session(long.written(tmp_path / "bag"), table)
    assert any("the clock of the pose sensor steps by +0.700 s" in each for each in session.remarks)
    assert worst(session, table) < 0.1


@pytest.mark.parametrize("seconds", [0.05, -0.05])
def test_a_delay_that_changes_a_little_is_no_clock(tmp_path, long, table, seconds):
    set_by(long, seconds, {POSES})
    session = read_session(long.written(tmp_path / "bag"), table)
    assert not any("clock" in each for each in session.remarks)


def test_one_offset_that_fits_is_no_step(long):
    own = np.arange(0, 18 * SECOND, 10 * MILLISECOND) + long.joint_ns[0]
    rigid = Signal(own, long.rigid(own))
    seen = own[100:-100]
    assert clock_step(seen, long.rigid(seen - 120 * MILLISECOND), rigid, 4.0) is None
    late = np.where(seen < own[800], 0, 500 * MILLISECOND)
    found = clock_step(seen, long.rigid(seen - late), rigid, 4.0)
    assert found.seconds == pytest.approx(0.5, abs=0.001)
    assert found.begin_ns <= own[800] <= found.end_ns


STAMPS = 10 * MILLISECOND * np.arange(1000)


def test_late_messages_and_stamps_in_no_order_are_no_clock_that_was_set():
    late = STAMPS.copy()
    late[500:504] -= SECOND
    assert set_back(late) == ()
    assert set_back(np.random.default_rng(1).permutation(STAMPS)) == ()
    assert set_back(STAMPS) == ()
    again = np.where(STAMPS[600] < STAMPS, STAMPS - SECOND, STAMPS)
    (found,) = set_back(again)
    assert (found.begin_ns, found.end_ns) == (again[601], again[600])


def test_wild_and_flickering_angles_are_no_two_motions():
    rng = np.random.default_rng(1)
    swing = np.sin(1e-9 * STAMPS)[:, None] * [0.4, 0.2]
    wild = swing.copy()
    wild[rng.integers(0, 1000, 100)] += 0.1
    flicker = swing + np.radians(0.1) * rng.integers(0, 2, (1000, 2))
    for values in (swing, wild, flicker):
        assert mixed(Signal(STAMPS, values)) == ()
