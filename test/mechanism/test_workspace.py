"""Borders of the operative workspace and of the map's domain."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.errors import InputError, SingularPoseError, UnreachablePoseError
from wrist_stiffness.mechanism.geometry_file import load_geometry
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.workspace import Workspace

GEOMETRY = load_geometry(Path(__file__).parents[2] / "config" / "palmieri2015.yaml")
DEGREE = np.pi / 180.0
TILT, MARGIN, LEAST_D = 50.0 * DEGREE, 1.2, 0.2
LIMITS = replace(GEOMETRY.limits, operative_tilt=TILT, map_margin=MARGIN, singularity=LEAST_D)


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


ORTHOGONAL = Mechanism(*np.eye(3)[[0, 1, 0, 2, 1, 2]])
SKEWED = Mechanism(
    unit(1.0, 0.0, 0.0),
    unit(0.2, 1.0, 0.1),
    unit(1.0, -0.1, 0.2),
    unit(0.1, -0.2, 1.0),
    unit(-0.1, 1.0, 0.0),
    unit(0.1, 0.0, 1.0),
)


@pytest.fixture
def workspace():
    return Workspace(ORTHOGONAL, LIMITS)


@pytest.fixture
def wide():
    """So wide that the singularity at (90, 0) deg cuts the rectangle."""
    return Workspace(ORTHOGONAL, replace(LIMITS, map_margin=1.75))


@pytest.mark.parametrize("mechanism", [ORTHOGONAL, SKEWED], ids=["orthogonal", "skewed"])
def test_border_is_a_closed_line_at_the_tilt_limit_around_home(mechanism):
    border = Workspace(mechanism, LIMITS).operative_border
    q = mechanism.forward(border)
    np.testing.assert_allclose(mechanism.normal(q) @ mechanism.n0, np.cos(TILT), atol=1e-9)
    np.testing.assert_allclose(border[0], border[-1], atol=1e-9)
    assert np.max(np.linalg.norm(np.diff(border, axis=0), axis=-1)) < 2.0 * DEGREE
    around = np.unwrap(np.arctan2(border[:, 1], border[:, 0]))
    assert abs(around[-1] - around[0]) == pytest.approx(2.0 * np.pi)


def test_rectangle_bounds_the_orthogonal_wrist_at_the_tilt_itself(workspace):
    """Closed form: theta_1 is the tilt where n_x = 0, theta_2 where n_y = 0."""
    lower, upper = workspace.rectangle
    # The border's points stand half a degree apart, its extremes are flat.
    np.testing.assert_allclose(upper, MARGIN * TILT, rtol=1e-4)
    np.testing.assert_allclose(lower, -MARGIN * TILT, rtol=1e-4)


def test_rectangle_grows_about_the_centre_of_the_border():
    narrow = Workspace(SKEWED, replace(LIMITS, map_margin=1.0)).rectangle
    wide = Workspace(SKEWED, replace(LIMITS, map_margin=1.5)).rectangle
    border = Workspace(SKEWED, LIMITS).operative_border
    np.testing.assert_allclose(narrow, [border.min(axis=0), border.max(axis=0)], atol=1e-12)
    assert np.max(np.abs(np.sum(narrow, axis=0))) > 0.01  # not about home
    np.testing.assert_allclose(np.sum(wide, axis=0), np.sum(narrow, axis=0), atol=1e-12)
    np.testing.assert_allclose(np.diff(wide, axis=0), 1.5 * np.diff(narrow, axis=0), atol=1e-12)


def test_paper_grid_has_its_25_poses(workspace):
    poses = workspace.grid(5)
    assert poses.shape == (25, 2)
    lower, upper = workspace.rectangle
    axis = np.linspace(lower[0], upper[0], 5)
    np.testing.assert_allclose(poses[:, 0].reshape(5, 5), np.tile(axis[:, None], 5), atol=1e-12)
    np.testing.assert_allclose(np.unique(poses[:, 1]), np.linspace(lower[1], upper[1], 5))


def test_grid_leaves_out_what_is_too_near_to_the_singularity(wide):
    poses = wide.grid(41)
    assert 0 < len(poses) < 41**2
    assert np.min(np.abs(ORTHOGONAL.forward(poses).singularity)) >= LEAST_D


def test_domain_is_the_rectangle_cut_at_least_d(wide):
    """|D| of the orthogonal wrist has a closed form."""
    theta = np.random.default_rng(1).uniform(-2.0, 2.0, (5000, 2))
    lower, upper = wide.rectangle
    d = np.sqrt(1.0 - np.sin(theta[:, 0]) ** 2 * np.cos(theta[:, 1]) ** 2)
    rectangle = np.all((theta >= lower) & (theta <= upper), axis=-1)
    cut = rectangle & (d < LEAST_D)
    assert np.any(cut)
    assert np.array_equal(wide.domain(theta), rectangle & ~cut)
    assert np.array_equal(wide.domain(theta.reshape(50, 100, 2)).ravel(), rectangle & ~cut)


def test_operative_is_the_tilt_cone(workspace):
    theta = np.random.default_rng(2).uniform(-1.5, 1.5, (5000, 2))
    phi = np.arctan2(np.tan(theta[:, 1]), np.cos(theta[:, 0]))
    tilt = np.arccos(np.cos(theta[:, 0]) * np.cos(phi))
    assert np.array_equal(workspace.operative(theta), tilt <= TILT)
    assert 0 < np.mean(tilt <= TILT) < 1


def test_one_pose_gives_one_answer(workspace):
    assert workspace.operative(np.zeros(2)).shape == ()
    assert workspace.operative(np.zeros(2))
    assert not workspace.domain(np.array([1.2, 0.0]))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_angles_that_are_not_finite_lie_nowhere(workspace, bad):
    theta = np.array([[0.0, 0.0], [bad, 0.0]])
    assert workspace.domain(theta).tolist() == [True, False]
    assert workspace.operative(theta).tolist() == [True, False]


def test_configuration_inside_is_the_forward_kinematics(workspace):
    theta = np.array([0.3, -0.2])
    inside = workspace.configuration(theta)
    assert np.allclose(inside.bodies, ORTHOGONAL.forward(theta).bodies, rtol=0.0, atol=1e-15)


def test_configuration_names_a_pose_outside_the_rectangle(workspace):
    with pytest.raises(UnreachablePoseError, match=r"\(10\.000, -61\.000\) deg outside") as caught:
        workspace.configuration(np.array([10.0, -61.0]) * DEGREE)
    assert "(-60.00 to 60.00, -60.00 to 60.00)" in str(caught.value)


def test_configuration_names_a_pose_too_near_to_the_singularity(wide):
    with pytest.raises(SingularPoseError, match=r"\(84\.000, 0\.000\) deg: \|D\| = 0\.105 below"):
        wide.configuration(np.array([84.0, 0.0]) * DEGREE)


def test_configuration_names_angles_that_are_not_finite(workspace):
    with pytest.raises(InputError, match=r"\(nan, 0\.000\) deg: not finite"):
        workspace.configuration(np.array([np.nan, 0.0]))


def test_configuration_names_a_pose_where_the_loop_does_not_close():
    """Inside the rectangle of a skewed wrist there may be such corners."""
    workspace = Workspace(SKEWED, replace(LIMITS, map_margin=2.5))
    lower, upper = workspace.rectangle
    theta = np.random.default_rng(3).uniform(lower, upper, (2000, 2))
    open_loops = theta[~SKEWED.reachable(theta)]
    assert len(open_loops)
    assert not np.any(workspace.domain(open_loops))
    with pytest.raises(UnreachablePoseError, match="does not close"):
        workspace.configuration(open_loops[0])


def test_tilt_that_the_wrist_cannot_reach_is_refused():
    # The normal keeps its angle to b, and b its angle to a1: here n stays within 60 deg of a1's
    # equator.
    mechanism = Mechanism(*np.eye(3)[[0, 1, 0, 2, 1]], unit(0.0, 0.5, 1.0))
    with pytest.raises(UnreachablePoseError, match="out of reach"):
        _ = Workspace(mechanism, replace(LIMITS, operative_tilt=100.0 * DEGREE)).operative_border
