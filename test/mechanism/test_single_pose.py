"""One pose at a time against the formulas for stacks of poses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.single_motion import exp_one, log_one
from wrist_stiffness.mechanism.single_pose import SinglePoseKinematics, SinglePoseStatics
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.shipped import shipped_file

FIELDS = ("b", "c", "d", "singularity", "dual", "bodies")
ROUNDING = 1e-12
"""Relative; a product of ten small matrices and the solution for some flange forces."""

POSES = 30


def random_wrists(count):
    """Yield mechanisms of any link angles with poses at which their loop closes."""
    rng = np.random.default_rng(7)
    while count:
        axes = rng.normal(size=(6, 3))
        mechanism = Mechanism(*(axes / np.linalg.norm(axes, axis=1, keepdims=True)))
        if abs(mechanism.forward(np.zeros(2)).singularity) < 0.4:
            continue
        theta = rng.uniform(-0.6, 0.6, (POSES, 2))
        theta = theta[mechanism.closure_radicand(theta) > 0.04]
        yield mechanism, theta
        count -= 1


def test_kinematics_of_one_pose_are_those_of_a_stack():
    for mechanism, theta in random_wrists(8):
        single, stack = SinglePoseKinematics(mechanism), mechanism.forward(theta)
        for i, each in enumerate(theta):
            found = single.forward(each)
            for name in FIELDS:
                wanted = getattr(stack, name)[i]
                np.testing.assert_allclose(getattr(found, name), wanted, rtol=0, atol=1e-13)


def test_no_configuration_where_the_loop_is_open_or_an_angle_not_finite():
    single = SinglePoseKinematics(Mechanism(*np.eye(3)[[0, 1, 0, 2, 1, 2]]))
    # b meets d here: both axes lie along z.
    assert single.forward(np.array([np.pi / 2.0, 0.0])) is None
    for bad in (np.nan, np.inf):
        assert single.forward(np.array([0.0, bad])) is None


@pytest.fixture(scope="module")
def shipped():
    """Return the shipped parts, with weights and parts of no symmetry."""
    rng = np.random.default_rng(3)
    parts = load_table(shipped_file("precomputed/palmieri2015.npz")).components
    turn = 0.3 * rng.normal(size=(8, 6, 6)) + np.eye(6)
    weights = 0.02 * rng.normal(size=(2, 8, 6, 3))
    return replace(
        parts,
        flexibility=turn @ parts.flexibility @ np.swapaxes(turn, -1, -2),
        weight_motor_side=weights[0],
        weight_platform_side=weights[1],
        platform_weight=0.02 * rng.normal(size=(6, 3)),
    )


@pytest.mark.parametrize(
    "joints", [("joint_2", "joint_3", "joint_4"), ("joint_4",), ()], ids=["all", "one", "none"]
)
def test_response_of_one_pose_is_that_of_the_operators(shipped, joints):
    rng = np.random.default_rng(11)
    contact = {joint: shipped.contact[joint] for joint in joints}
    parts = replace(shipped, contact=contact)
    gravity = np.array([1.0, -3.0, -9.0])
    touched = 0
    for mechanism, theta in random_wrists(4):
        statics, active = SinglePoseStatics(parts, gravity), None
        for each in theta:
            configuration = mechanism.forward(each)
            load = rng.normal(size=6) * [1.0, 1.0, 1.0, 0.02, 0.02, 0.02]
            wanted = respond(contact_operators(configuration, parts, gravity), load)
            twist, force, closed = statics.respond(configuration, load)
            assert np.array_equal(closed, wanted.active)
            for part in (slice(0, 3), slice(3, 6)):
                size = np.linalg.norm(wanted.twist[part])
                assert np.linalg.norm(twist[part] - wanted.twist[part]) < ROUNDING * size
            assert np.allclose(force, wanted.force, rtol=1e-9, atol=1e-9)
            guessed, _, active = statics.respond(configuration, load, active)
            assert np.array_equal(guessed, twist)
            touched += np.count_nonzero(closed)
    assert bool(touched) == bool(joints)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array),
    st.sampled_from([0.0, 1e-12, 1e-8, 1e-5, 0.99e-4, 1.01e-4, 1e-3, 0.1, 1.0, 3.0]),
)
def test_one_motion_is_as_one_of_many(direction, size):
    twist = size * direction
    rotation, shift = exp_one(twist)
    wanted = exp_twist(twist)
    # A few roundings of the largest terms, which are of size one and of the shift's.
    np.testing.assert_allclose(rotation, wanted[0], rtol=0, atol=4e-15)
    np.testing.assert_allclose(shift, wanted[1], rtol=0, atol=4e-15 * size)
    found = log_one(rotation, shift)
    np.testing.assert_allclose(found, log_motion(rotation, shift), rtol=1e-13, atol=4e-15 * size)
