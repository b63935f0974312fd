"""Poses from markers, held against the fit of one pose at a time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.readout import fit_markers
from wrist_stiffness.sessions.reading.pose_track import poses_from_markers
from wrist_stiffness.sessions.reading.session import read_session

NAN = float("nan")


@pytest.fixture
def nominal(table):
    return table.geometry.platform.readout_points


def seen_at(nominal, rotation, shift=(0.0, 0.0, 0.0)):
    return nominal @ np.swapaxes(rotation, -1, -2) + np.reshape(shift, (-1, 1, 3))


@pytest.fixture
def noisy(nominal):
    """Sixty poses with 5 um of noise; markers lost at random, rows 0 to 9 complete."""
    rng = np.random.default_rng(3)
    rotation = Rotation.from_rotvec(0.5 * rng.standard_normal((60, 3))).as_matrix()
    points = seen_at(nominal, rotation, 1e-3 * rng.standard_normal((60, 3)))
    points = points + 5e-6 * rng.standard_normal(points.shape)
    lost = rng.random(points.shape[:2]) < 0.4
    lost[:10] = False
    points[lost] = NAN
    return points


def test_many_poses_are_those_of_one_at_a_time(nominal, noisy):
    shift, rotation = poses_from_markers(nominal, noisy)
    compared = 0
    for row, points in enumerate(noisy):
        try:
            expected = fit_markers(nominal, points)
        except InputError:
            assert np.isnan(shift[row]).all()
            continue
        compared += 1
        np.testing.assert_allclose(shift[row], expected.shift, atol=1e-14)
        np.testing.assert_allclose(rotation[row], expected.rotation, atol=1e-12)
    assert compared >= 40


def test_coplanar_markers_give_a_rotation_and_no_reflection():
    nominal = 0.02 * np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    rng = np.random.default_rng(0)
    rotation = Rotation.from_rotvec(rng.standard_normal((50, 3))).as_matrix()
    points = seen_at(nominal, rotation) + 1e-5 * rng.standard_normal((50, 4, 3))
    _, found = poses_from_markers(nominal, points)
    np.testing.assert_allclose(np.linalg.det(found), 1.0, atol=1e-12)
    np.testing.assert_allclose(found, rotation, atol=5e-3)


def test_a_recording_of_markers_is_one_of_poses(tmp_path, campaign, nominal, table):
    shift = 1e-5 * np.random.default_rng(1).standard_normal((799, 3))
    points = seen_at(nominal, campaign.rigid(campaign.pose_ns), shift)
    points[::2, 0] = NAN
    points[5:8, 2:] = NAN
    path = campaign.with_joints().with_loads().with_markers(points).written(tmp_path / "bag")
    session = read_session(path, table)
    seen = session.measured.all(axis=1)
    assert np.flatnonzero(~seen).tolist() == [5, 6, 7]
    np.testing.assert_allclose(session.shift[seen], shift[seen], atol=1e-14)
    np.testing.assert_allclose(
        session.rotation[seen], campaign.rigid(campaign.pose_ns)[seen], atol=1e-12
    )
    assert session.remarks == ("measured markers: 3 of 799 lost by the instrument",)


def test_fewer_than_three_markers_are_refused_with_their_number(tmp_path, campaign, nominal, table):
    points = seen_at(nominal, campaign.rigid(campaign.pose_ns))
    points[:, 2:] = NAN
    path = campaign.with_joints().with_loads().with_markers(points).written(tmp_path / "bag")
    with pytest.raises(InputError, match=f"at most 2 of {len(nominal)} were seen at once.*least 3"):
        read_session(path, table)


def test_another_number_of_markers_is_refused_with_both(tmp_path, campaign, nominal, table):
    points = seen_at(nominal[:4], campaign.rigid(campaign.pose_ns))
    path = campaign.with_joints().with_loads().with_markers(points).written(tmp_path / "bag")
    with pytest.raises(InputError, match=f"hold 4 markers, the geometry names {len(nominal)}"):
        read_session(path, table)


def test_poses_are_used_where_both_were_measured(tmp_path, campaign, nominal, table):
    points = seen_at(nominal, campaign.rigid(campaign.pose_ns), [1e-3, 0.0, 0.0])
    campaign.with_joints().with_loads().with_poses().with_markers(points)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    np.testing.assert_array_equal(session.shift, 0.0)
    assert session.remarks == ("markers and poses were measured: the poses are used",)
