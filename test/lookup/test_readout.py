"""Platform error from readout points and from measured markers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.readout import PlatformError, fit_markers, fit_platform_error

# Coordinates of 0.03 m round at 3e-18 m; a few of them over 0.02 m give the rotation.
ROUNDING_RAD = 1e-14
ROUNDING_M = 1e-15

SHIFT = np.array([1.17, 0.53, -8.39]) * 1e-6
ROTATION = Rotation.from_rotvec(
    np.deg2rad(1.29e-2) * np.array([0.6, 0.7, 0.39]) / np.linalg.norm([0.6, 0.7, 0.39])
).as_matrix()
MEAN_ERROR = PlatformError(SHIFT, ROTATION)

seeds = st.integers(0, 2**32 - 1)
vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


def seven_points(lift_m, below_m=0.018):
    """Six points on a ring of radius 20 mm and its centre; every other ring point is lifted."""
    angle = np.arange(6) * np.pi / 3
    ring = np.column_stack([0.02 * np.cos(angle), 0.02 * np.sin(angle), np.zeros(6)])
    points = np.vstack([ring, np.zeros(3)])
    points[::2, 2] = lift_m
    return points - [0.0, 0.0, below_m]


def move(points, error):
    return points @ np.swapaxes(error.rotation, -1, -2) + error.shift[..., None, :]


def paper_equations(before, after):
    """Eqs. (3)-(10) word for word, homogeneous coordinates and all."""
    a_u = np.vstack([before.T, np.ones(len(before))])
    a_d = np.vstack([after.T, np.ones(len(after))])
    estimate = a_d @ np.linalg.pinv(a_u)
    u, _, vt = np.linalg.svd(estimate[:3, :3])
    rotation = u @ vt
    return PlatformError((a_d[:3] - rotation @ a_u[:3]).mean(axis=1), rotation)


def rotation_between(first, second):
    return float(PlatformError(first.shift, first.rotation @ second.rotation.T).phi)


@pytest.mark.parametrize("fit", [fit_platform_error, fit_markers])
@given(turn=vectors, shift=vectors, size=st.floats(-9.0, 0.0), seed=seeds)
@settings(max_examples=60, derandomize=True)
def test_a_rigid_motion_of_any_size_is_recovered(fit, turn, shift, size, seed):
    points = seven_points(0.01) + np.random.default_rng(seed).normal(0.0, 1e-3, 3)
    truth = PlatformError(
        0.01 * 10**size * shift, Rotation.from_rotvec(10**size * turn).as_matrix()
    )
    found = fit(points, move(points, truth))
    np.testing.assert_allclose(found.rotation, truth.rotation, atol=ROUNDING_RAD)
    np.testing.assert_allclose(found.shift, truth.shift, atol=ROUNDING_M)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("angle", [1e-12, 1e-9, 1e-4, 1.0, np.pi - 1e-6, np.pi])
def test_phi_is_the_rotation_angle_down_to_rounding(angle):
    rotation = Rotation.from_rotvec(angle * np.array([2.0, -3.0, 6.0]) / 7.0).as_matrix()
    assert PlatformError(np.zeros(3), rotation).phi == pytest.approx(angle, abs=1e-15)


def test_tiny_displacements_keep_seven_digits_of_a_nanoradian():
    truth = PlatformError(SHIFT, Rotation.from_rotvec([0.0, 1e-9, 0.0]).as_matrix())
    found = fit_platform_error(seven_points(0.01), move(seven_points(0.01), truth))
    assert found.phi == pytest.approx(1e-9, rel=1e-6)


def test_shift_is_that_of_the_point_at_the_origin_and_rotation_multiplies_from_the_left():
    # A quarter turn about z through (10, 0, 0) mm brings the origin to (10, -10, 0) mm.
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    pivot = np.array([0.01, 0.0, 0.0])
    points = seven_points(0.01)
    found = fit_platform_error(points, (points - pivot) @ quarter.T + pivot)
    np.testing.assert_allclose(found.shift, [0.01, -0.01, 0.0], atol=ROUNDING_M)
    np.testing.assert_allclose(found.rotation, quarter, atol=ROUNDING_RAD)
    assert found.shift_norm == pytest.approx(0.01 * np.sqrt(2.0))


def test_poses_are_fitted_together_with_points_that_turn_with_the_platform():
    generator = np.random.default_rng(3)
    truth = PlatformError(
        generator.normal(0.0, 1e-5, (4, 5, 3)),
        Rotation.from_rotvec(generator.normal(0.0, 1e-3, (20, 3))).as_matrix().reshape(4, 5, 3, 3),
    )
    pose = Rotation.from_rotvec(generator.normal(size=(20, 3))).as_matrix().reshape(4, 5, 3, 3)
    points = seven_points(0.01) @ np.swapaxes(pose, -1, -2)
    found = fit_platform_error(points, move(points, truth))
    np.testing.assert_allclose(found.shift, truth.shift, atol=ROUNDING_M)
    np.testing.assert_allclose(found.rotation, truth.rotation, atol=ROUNDING_RAD)
    assert found.phi.shape == found.shift_norm.shape == (4, 5)


@given(seed=seeds)
@settings(max_examples=50, derandomize=True)
def test_points_in_space_give_what_the_equations_of_the_paper_give(seed):
    generator = np.random.default_rng(seed)
    before = seven_points(0.01) + generator.normal(0.0, 1e-3, (7, 3))
    strained = move(before, MEAN_ERROR) + generator.normal(0.0, 2e-6, (7, 3))
    found, expected = fit_platform_error(before, strained), paper_equations(before, strained)
    np.testing.assert_allclose(found.rotation, expected.rotation, atol=ROUNDING_RAD)
    np.testing.assert_allclose(found.shift, expected.shift, atol=ROUNDING_M)


def test_stretch_of_linear_elements_does_not_turn_the_platform():
    # Linear FEM moves a turning body by omega x P, a turn by atan(omega) and a stretch.
    points, omega = seven_points(0.01), np.array([0.0, 0.0, 1e-2])
    found = fit_platform_error(points, points + np.cross(omega, points))
    assert found.phi == pytest.approx(np.arctan(1e-2), abs=ROUNDING_RAD)


def test_a_mirrored_estimate_still_gives_a_proper_rotation():
    points = seven_points(0.01, below_m=0.0)
    found = fit_platform_error(points, points * [1.0, 1.0, -0.1])
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_coplanar_points_would_mislead_the_equations_without_any_noise():
    # In millimetres, as FEM codes list them, the plane 18 mm below O is taken for a homogeneous
    # coordinate and part of s_x, s_y for a tilt.
    coplanar = 1e3 * seven_points(0.0)
    misled = paper_equations(coplanar, coplanar @ ROTATION.T + 1e3 * SHIFT)
    assert 0.5e-3 < np.linalg.norm(misled.shift - 1e3 * SHIFT) < 1.0e-3
    assert misled.phi == pytest.approx(0.95 * MEAN_ERROR.phi, rel=0.01)


def rotation_errors_mdeg(points, fit, noise_m, trials=300):
    """RMS angle between fitted and true rotation over trials with marker noise."""
    generator = np.random.default_rng(20150226)
    clean = move(points, MEAN_ERROR)
    noisy = clean + generator.normal(0.0, noise_m, (trials, *points.shape))
    errors = [rotation_between(fit(points, after), MEAN_ERROR) for after in noisy]
    return 1e3 * np.rad2deg(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize(
    ("lift_m", "unconstrained_mdeg"),
    [(0.001, 21.0), (0.003, 7.2), (0.006, 3.7)],
    ids=["nearly flat", "at the limit", "deep"],
)
def test_marker_noise_disturbs_the_rigid_fit_least(lift_m, unconstrained_mdeg):
    points, noise_m = seven_points(lift_m), 0.7e-6
    # Least squares: variance of a small turn about an axis = noise^2 / (second moment about it).
    centred = points - points.mean(axis=0)
    inertia = np.sum(centred**2) * np.eye(3) - centred.T @ centred
    theory = 1e3 * np.rad2deg(noise_m * np.sqrt(np.trace(np.linalg.inv(inertia))))
    assert theory == pytest.approx(1.85, abs=0.1)
    # 300 trials of three components leave about 3 % in an RMS.
    assert rotation_errors_mdeg(points, fit_markers, noise_m) == pytest.approx(theory, rel=0.1)
    rival = rotation_errors_mdeg(points, paper_equations, noise_m)
    assert rival == pytest.approx(unconstrained_mdeg, rel=0.12)


def test_readout_fit_keeps_to_theory_under_noise_too():
    # The largest noise in the gradient comes from the thin direction: 0.7 um over its extent.
    points = seven_points(0.006)
    assert rotation_errors_mdeg(points, fit_platform_error, 0.7e-6) == pytest.approx(3.7, rel=0.12)


def test_lost_markers_are_left_out():
    points = seven_points(0.0)
    measured = move(points, MEAN_ERROR)
    measured[0] = np.nan
    measured[4, 1] = np.nan
    measured[[0, 4]] += 1.0
    found = fit_markers(points, measured)
    np.testing.assert_allclose(found.rotation, ROTATION, atol=ROUNDING_RAD)
    np.testing.assert_allclose(found.shift, SHIFT, atol=ROUNDING_M)


def test_three_markers_suffice_and_two_do_not():
    points = seven_points(0.0)
    measured = move(points, MEAN_ERROR)
    measured[3:] = np.nan
    assert fit_markers(points, measured).phi == pytest.approx(MEAN_ERROR.phi, abs=ROUNDING_RAD)
    measured[2] = np.nan
    with pytest.raises(InputError, match="2 given; at least 3"):
        fit_markers(points, measured)


def test_markers_in_a_row_are_rejected():
    points = seven_points(0.0)
    in_a_row = move(points, MEAN_ERROR)
    in_a_row[[1, 2, 4, 5]] = np.nan
    with pytest.raises(InputError, match="reference markers: they lie near a line"):
        fit_markers(points, in_a_row)
    with pytest.raises(InputError, match="measured markers: they lie near a line"):
        fit_markers(points, np.zeros((7, 3)))
