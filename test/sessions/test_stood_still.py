"""Poses that an instrument only sends again are left out; what its digits repeat is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.sessions.in_pieces import rigid_rotation
from wrist_stiffness.sessions.reading.lost_beams import stood_still
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell


def again(rows, shift, rotation):
    """Repeat the pose before these rows in them."""
    shift, rotation = shift.copy(), rotation.copy()
    shift[rows], rotation[rows] = shift[rows[0] - 1], rotation[rows[0] - 1]
    return shift, rotation


def test_poses_that_repeat_while_the_motors_move_are_left_out_and_named(tmp_path, campaign, table):
    rows = np.arange(300, 500)
    shift = 1e-6 * np.random.default_rng(1).standard_normal((799, 3))
    shift, rotation = again(rows, shift, campaign.rigid(campaign.pose_ns))
    campaign.with_joints().with_loads().with_poses(shift, rotation)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert (
        "the measured pose stood still from 3.00 s to 5.00 s, to the last digit, while the motors "
        "moved or its noise should show: 200 poses are not used; did the instrument lose its "
        "target?"
    ) in session.remarks
    left = np.delete(campaign.pose_ns, rows)
    np.testing.assert_allclose(session.block.time[session.measured.any(axis=1)], 1e-9 * left)
    assert abs(session.clock_offset_s[0]) < 1e-4


def test_an_instrument_that_never_comes_back_is_no_other_wrist(tmp_path, campaign, table):
    """More than half of the rotations are wrong then."""
    stood = again(np.arange(300, 799), np.zeros((799, 3)), campaign.rigid(campaign.pose_ns))
    campaign.with_joints().with_loads().with_poses(*stood)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert session.measured.any(axis=1).sum() == 300


def test_frozen_markers_are_left_out(tmp_path, campaign, table):
    nominal = table.geometry.platform.readout_points
    points = nominal @ np.swapaxes(campaign.rigid(campaign.pose_ns), 1, 2)
    points[300:500] = points[299]
    campaign.with_joints().with_loads().with_markers(points)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    assert session.measured.any(axis=1).sum() == 599
    assert any("stood still from 3.00 s to 5.00 s" in remark for remark in session.remarks)


def test_each_time_it_stood_still_is_counted_and_the_longest_told(tmp_path, campaign, table):
    stood = again(np.arange(100, 150), np.zeros((799, 3)), campaign.rigid(campaign.pose_ns))
    stood = again(np.arange(400, 500), *stood)
    campaign.with_joints().with_loads().with_poses(*stood)
    said = " ".join(read_session(campaign.written(tmp_path / "bag"), table).remarks)
    assert "stood still 2 times, the longest from 4.00 s to 5.00 s" in said
    assert "150 poses are not used" in said


@pytest.fixture(scope="module")
def cell_run(table):
    """Return a function of an instrument: a minute of the cell at 100 Hz."""

    def run(instrument, hidden=()):
        settings = CellSettings(rate_hz=100.0, instrument=instrument, hidden=hidden)
        cell = VirtualCell(table, settings, np.random.default_rng(1))
        time = 0.01 * np.arange(6000)
        return time, cell.run(time, cell.desired(time))

    return run


def found(table, time, sample, shift, rotation):
    seen = np.hstack([shift, rotation.reshape(-1, 9)])
    same = (seen[1:] == seen[:-1]) | np.isnan(seen[1:])
    repeats = np.append(False, same.all(axis=1))
    step = table.geometry.limits.encoder_step
    still = stood_still(time, shift, rotation, rigid_rotation(table, sample.encoder), repeats, step)
    return np.flatnonzero(still), repeats


@pytest.mark.parametrize("instrument", ["interferometer", "tracker"])
@pytest.mark.parametrize("seconds", [0.5, 3.0, 10.0])
@pytest.mark.parametrize("begin", [21.3, 30.0])
def test_a_freeze_at_rest_or_in_motion_is_found(table, cell_run, instrument, seconds, begin):
    time, sample = cell_run(instrument)
    rows = np.flatnonzero((time >= begin) & (time < begin + seconds))
    stood = again(rows, sample.measured_shift, sample.measured_rotation)
    np.testing.assert_array_equal(found(table, time, sample, *stood)[0], rows)


def test_a_point_that_freezes_is_found_where_the_wrist_swings_it(table, cell_run):
    """The target is 15 mm off O, and the digits are coarse."""
    time, sample = cell_run("tracker")
    place = sample.measured_shift + sample.measured_rotation @ [9e-3, 0.0, 12e-3]
    nowhere = np.full((6000, 3, 3), np.nan)
    coarse = np.round(place / 1e-4) * 1e-4
    assert len(found(table, time, sample, coarse, nowhere)[0]) == 0
    rows = np.arange(3000, 4000)
    frozen, _ = again(rows, coarse, nowhere)
    assert set(rows) <= set(found(table, time, sample, frozen, nowhere)[0])


@pytest.mark.parametrize("digit_mdeg", [1.0, 20.0, 1000.0])
@pytest.mark.parametrize("late_s", [0.0, 0.05])
@pytest.mark.parametrize("instrument", ["interferometer", "tracker", "ideal"])
def test_what_digits_repeat_is_a_measurement(table, cell_run, instrument, digit_mdeg, late_s):
    """Beside gears that lose much of the way, and stamps that are late."""
    play = tuple(HiddenEffect("backlash", f"motor_{k}", "single", 5e-3, 0) for k in (1, 2))
    time, sample = cell_run(instrument, play)
    angles = Rotation.from_matrix(sample.measured_rotation).as_euler("xyz", degrees=True)
    angles = np.round(1e3 * angles / digit_mdeg) * digit_mdeg * 1e-3
    rotation = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    digit = 1e-6 * digit_mdeg
    shift = np.round(sample.measured_shift / digit) * digit
    late = round(late_s / 0.01)
    sample = replace(sample, encoder=sample.encoder[late:])
    count = len(sample.encoder)
    still, repeats = found(table, time[:count], sample, shift[:count], rotation[:count])
    assert len(still) == 0
    assert repeats.any() or digit_mdeg < 20.0 and instrument != "ideal"


def test_poses_that_are_sent_more_often_than_measured_are_left_alone(table, cell_run):
    """At 20 a second, sent at 100: at rest as in motion each one repeats four times."""
    time, sample = cell_run("interferometer")
    rows = np.arange(6000) // 5 * 5
    held = sample.measured_shift[rows], sample.measured_rotation[rows]
    assert len(found(table, time, sample, *held)[0]) == 0
