"""Kinematics: poses, angles, directions and home axes that cannot be are refused by name."""

import numpy as np
import pytest

from wrist_stiffness.errors import (
    GeometryError,
    InputError,
    SingularPoseError,
    UnreachablePoseError,
)
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.vectors import unit

X, Y, Z = np.eye(3)
C_HORIZONTAL = Mechanism(X, Y, X, Z, Y, Z)
SKEWED = Mechanism(
    X,
    unit(np.array([-0.32, 0.88, 0.34])),
    unit(np.array([0.84, -0.22, 0.5])),
    unit(np.array([-0.54, -0.2, 0.82])),
    unit(np.array([0.34, 0.93, -0.17])),
    Z,
)


def unreachable_pose(mechanism):
    theta = np.random.default_rng(6).uniform(-np.pi, np.pi, (20_000, 2))
    return theta[np.argmin(mechanism.closure_radicand(theta))]


@pytest.mark.parametrize("function", ["forward", "platform_rotation"])
@pytest.mark.parametrize("stacked", [False, True])
def test_unreachable_pose_is_named(stacked, function):
    mechanism = SKEWED
    pose = unreachable_pose(mechanism)
    assert not mechanism.reachable(pose)
    theta = np.stack([np.zeros(2), pose, pose + 0.01]) if stacked else pose
    with pytest.raises(UnreachablePoseError, match="does not close") as caught:
        getattr(mechanism, function)(theta)
    first, second = np.degrees(pose)
    assert f"({first:.3f}, {second:.3f}) deg" in str(caught.value)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    "function", ["forward", "platform_rotation", "reachable", "tilt", "closure_radicand"]
)
def test_angle_that_is_not_finite_is_named(function, bad):
    with pytest.raises(InputError, match=rf"\({bad:.3f}, 57\.296\) deg: not finite"):
        getattr(C_HORIZONTAL, function)(np.array([[0.0, 0.0], [bad, 1.0]]))


def test_parallel_axes_of_joint_2_and_joint_4_are_unreachable_without_a_warning():
    """alpha_2 = alpha_3: the loop folds flat, D = 0 and the closure divides nought by nought."""
    with pytest.raises(UnreachablePoseError, match=r"\(90\.000, 0\.000\) deg"):
        C_HORIZONTAL.forward(np.array([np.pi / 2.0, 0.0]))


def test_jacobian_refuses_the_singularity_and_names_the_pose():
    # |D| = sqrt(1 - sin^2 theta_1) is just above rounding here.
    theta = np.array([np.pi / 2.0 - 1e-7, 0.0])
    with pytest.raises(SingularPoseError, match=r"\(90\.000, 0\.000\) deg.*\|D\|"):
        C_HORIZONTAL.jacobian(C_HORIZONTAL.forward(theta))


def test_inverse_names_a_normal_out_of_reach():
    mechanism = SKEWED
    directions = np.random.default_rng(7).normal(size=(5000, 3))
    nowhere = directions[np.all(np.isnan(mechanism.inverse(directions)[..., 0]), axis=-1)]
    assert len(nowhere)
    with pytest.raises(UnreachablePoseError, match="out of reach") as caught:
        mechanism.inverse_near(nowhere[0], np.zeros(2))
    assert str(np.round(nowhere[0], 6).tolist()) in str(caught.value)


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ((X, X, Y, Z, Y, Z), "joint_1 and joint_2 are parallel"),
        ((X, Y, -Y, Z, Y, Z), "joint_2 and joint_3 are parallel"),
        ((X, Y, X, Z, X, Z), "joint_1 and joint_5 are parallel"),
        ((X, Y, X, Z, Y, Y), "joint_2 and the platform normal are parallel"),
        ((X, Y, (X + Y) / np.sqrt(2.0), -X, Y, Z), "home pose is singular"),
    ],
)
def test_home_pose_that_cannot_work_is_refused(axes, message):
    with pytest.raises(GeometryError, match=message):
        Mechanism(*axes)
