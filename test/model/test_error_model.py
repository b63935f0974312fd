"""One prediction: physics of the twist, and every input that must be refused."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.errors import (
    InputError,
    LoadRangeError,
    SingularPoseError,
    UnreachablePoseError,
)
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.model.error_model import Load

POSE = np.radians([20.0, -10.0])


def load(*wrench, on_platform=False):
    return Load(np.array([*wrench, *[0.0] * (6 - len(wrench))]), on_platform)


def test_load_in_base_or_platform_is_one_load(model):
    in_base = load(0.3, -0.2, -0.8, 0.01, 0.0, -0.02)
    turn = model.table.mechanism.forward(POSE).platform
    in_platform = Load(block_diagonal(turn).T @ in_base.wrench, on_platform=True)
    a, b = model.predict(POSE, in_base), model.predict(POSE, in_platform)
    assert np.allclose(a.twist, b.twist, rtol=1e-9, atol=1e-15)


def test_without_load_there_is_own_weight(model):
    """Own weight is part of the base, and turning gravity's load round turns its twist round."""
    idle = model.predict(POSE, load()).twist
    assert np.linalg.norm(idle[:3]) > 0.0
    pushed = model.predict(POSE, load(0.0, 0.0, -1.0)).twist
    assert pushed[2] < idle[2]


def test_wider_guess_of_contact_changes_nothing_but_rounding(model):
    everything = np.ones(len(model.table.components.sectors.gap), dtype=bool)
    a = model.predict(POSE, load(0.1, 0.2, -1.0))
    b = model.predict(POSE, load(0.1, 0.2, -1.0), active=everything)
    assert np.array_equal(a.active, b.active)
    assert np.allclose(a.twist, b.twist, rtol=1e-12)


def test_both_evaluations_agree(model):
    a = model.predict(POSE, load(0.0, 0.0, -1.0))
    b = model.with_evaluation("spline").predict(POSE, load(0.0, 0.0, -1.0))
    assert np.allclose(a.twist, b.twist, rtol=0.01, atol=1e-9)


def test_covariance_is_positive_and_holds_the_encoder_step(model):
    covariance = model.predict(POSE, load(0.0, 0.0, -1.0)).covariance
    assert np.all(np.linalg.eigvalsh(covariance) > -1e-24)
    step = model.table.geometry.limits.encoder_step
    jacobian = model.table.mechanism.jacobian(model.table.mechanism.forward(POSE))
    by_step = np.trace(jacobian @ jacobian.T) * step**2 / 12.0
    assert by_step <= np.trace(covariance[3:, 3:]) <= 1.5 * by_step


def test_stated_error_is_the_rms_length_of_the_shifts_error(model):
    """The encoder only turns the platform about O, so the shift's block is the table's alone."""
    made = model.predict(POSE, load(0.0, 0.0, -1.0))
    stated = model.table.header.errors["stated_relative"]
    rms = np.sqrt(np.trace(made.covariance[:3, :3]))
    assert rms == pytest.approx(stated * np.linalg.norm(made.twist[:3]), rel=1e-12)


def test_motion_is_the_exponential_of_the_twist(model):
    made = model.predict(POSE, load(0.5, 0.0, -1.0))
    rotation, shift = made.motion
    assert np.allclose(log_motion(rotation, shift), made.twist, atol=1e-17)
    assert made.shift_norm == pytest.approx(np.linalg.norm(shift))


def test_exponential_is_a_group_homomorphism_on_one_axis():
    twist = np.array([0.3, -0.2, 0.1, 0.4, 0.5, -0.6])
    half_rotation, half_shift = exp_twist(0.5 * twist)
    rotation, shift = exp_twist(twist)
    assert np.allclose(half_rotation @ half_rotation, rotation, atol=1e-15)
    assert np.allclose(half_rotation @ half_shift + half_shift, shift, atol=1e-15)


@pytest.mark.parametrize("size", [1e-9, 1e-5, 0.99e-4, 1.01e-4, 1e-2, 3.0])
def test_exponential_and_logarithm_are_inverse(size):
    twist = size * np.array([0.3, -0.2, 0.1, 0.4, 0.5, -0.6])
    assert np.allclose(log_motion(*exp_twist(twist)), twist, rtol=1e-11, atol=1e-16)


@pytest.mark.parametrize(
    ("theta_deg", "wrench", "error", "text"),
    [
        ((80.0, 0.0), (0.0, 0.0, -1.0), UnreachablePoseError, "outside the table's domain"),
        ((np.nan, 0.0), (0.0, 0.0, -1.0), InputError, "nan"),
        ((0.0, 0.0), (0.0, 0.0, -6.0), LoadRangeError, "6 N"),
        ((0.0, 0.0), (0.0, 0.0, np.nan), LoadRangeError, "nan"),
    ],
    ids=["domain", "NaN angle", "load", "NaN load"],
)
def test_bad_samples_are_refused(model, theta_deg, wrench, error, text):
    with pytest.raises(error, match=text) as caught:
        model.predict(np.radians(theta_deg), load(*wrench))
    assert "\n" not in str(caught.value)


def test_near_singular_pose_is_refused(model):
    """Inside the rectangle, but with a limit on |D| just above the pose's."""
    near = np.radians([50.0, 5.0])
    limit = abs(float(model.table.mechanism.forward(near).singularity)) + 0.01
    limits = replace(model.table.geometry.limits, singularity=limit)
    workspace = replace(model.table.workspace, limits=limits)
    with pytest.raises(SingularPoseError, match=f"below the limit {limit:g}"):
        workspace.configuration(near)
