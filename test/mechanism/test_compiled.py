"""The compiled formulas against the NumPy ones, for any wrist, and one sample against a block."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.compiled import CompiledWrist, mechanism_constants, native
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Limits
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion, pose_of_twist
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

FIELDS = ("theta", "b", "c", "d", "singularity", "dual", "bodies")
ROUNDING = 1e-12
"""Relative; a product of ten small matrices and the solution for some flange forces."""

POSES = 30
ANYWHERE = np.full(2, -np.pi), np.full(2, np.pi)


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


def limits_of(singularity=0.0):
    """Return limits of which only these count here."""
    return Limits(*ANYWHERE, 1.0, 1.0, singularity, 100.0, 1.0, 1e-4)


def found_at(mechanism, theta, rectangle=ANYWHERE, singularity=0.0):
    """Return the compiled configuration, None where it is refused."""
    row = np.empty(native.CONFIGURATION)
    constants = mechanism_constants(mechanism, rectangle, limits_of(singularity))
    refused = native.forward(constants, theta, row, np.empty(1, dtype=np.uint8))
    return None if refused else Configuration.of_row(row)


def test_it_is_built_here():
    """Without a C compiler everything works, slower; where tests run there is one."""
    assert native is not None


def test_kinematics_of_one_pose_are_those_of_a_stack():
    for mechanism, theta in random_wrists(8):
        stack = mechanism.forward(theta)
        for i, each in enumerate(theta):
            found = found_at(mechanism, each)
            for name in FIELDS:
                wanted = getattr(stack, name)[i]
                np.testing.assert_allclose(getattr(found, name), wanted, rtol=0, atol=1e-13)
            assert np.array_equal(
                Configuration(*(getattr(found, f) for f in FIELDS)).row, found.row
            )


def test_no_configuration_where_there_is_none():
    mechanism = Mechanism(*np.eye(3)[[0, 1, 0, 2, 1, 2]])
    # b meets d here: both axes lie along z.
    assert found_at(mechanism, np.array([np.pi / 2.0, 0.0])) is None
    for bad in (np.nan, np.inf):
        assert found_at(mechanism, np.array([0.0, bad])) is None
    theta = np.array([0.3, 0.2])
    determinant = abs(mechanism.forward(theta).singularity)
    assert found_at(mechanism, theta, singularity=0.999 * determinant) is not None
    assert found_at(mechanism, theta, singularity=1.001 * determinant) is None
    assert found_at(mechanism, theta, (np.zeros(2), theta)) is not None
    assert found_at(mechanism, theta, (np.zeros(2), 0.999 * theta)) is None


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
    parts = replace(shipped, contact={joint: shipped.contact[joint] for joint in joints})
    gravity = np.array([1.0, -3.0, -9.0])
    touched = 0
    for mechanism, theta in random_wrists(4):
        constants = mechanism_constants(mechanism, ANYWHERE, limits_of())
        wrist, active = CompiledWrist(constants, parts, gravity), None
        loads = rng.normal(size=(len(theta), 6)) * [1.0, 1.0, 1.0, 0.02, 0.02, 0.02]
        alone, answers = [], []
        for each, load in zip(theta, loads, strict=True):
            configuration = mechanism.forward(each)
            wanted = respond(contact_operators(configuration, parts, gravity), load)
            (twist,), (force,), (closed,) = wrist.respond(configuration.as_block, load[None])
            assert np.array_equal(closed, wanted.active)
            for part in (slice(0, 3), slice(3, 6)):
                size = np.linalg.norm(wanted.twist[part])
                assert np.linalg.norm(twist[part] - wanted.twist[part]) < ROUNDING * size
            assert np.allclose(force, wanted.force, rtol=1e-9, atol=1e-9)
            (guessed,), _, (active,) = wrist.respond(configuration.as_block, load[None], active)
            assert np.array_equal(guessed, twist)
            answers.append(twist)
            touched += np.count_nonzero(closed)
            first = np.zeros(wrist.sectors, dtype=bool)
            alone.append(wrist.predict(each, load, np.zeros(1, dtype=bool), first, None).twist[0])
        assert np.array_equal(wrist.respond(mechanism.forward(theta), loads)[0], answers)
        first, in_f = np.zeros(wrist.sectors, dtype=bool), np.zeros(len(theta), dtype=bool)
        block = wrist.predict(theta, loads, in_f, first, None)
        assert not block.status.any()
        assert np.array_equal(block.twist, alone)
    assert bool(touched) == bool(joints)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array),
    st.sampled_from([0.0, 1e-12, 1e-8, 1e-5, 0.99e-4, 1.01e-4, 1e-3, 0.1, 1.0, 3.0]),
)
def test_one_motion_is_as_one_of_many(direction, size):
    twist = size * direction
    rotation, shift = exp_twist(twist)
    wanted = exp_twist(twist[None])
    # A few roundings of the largest terms, which are of size one and of the shift's.
    np.testing.assert_allclose(rotation, wanted[0][0], rtol=0, atol=4e-15)
    np.testing.assert_allclose(shift, wanted[1][0], rtol=0, atol=4e-15 * size)
    found, stack = log_motion(rotation, shift), log_motion(rotation[None], shift[None])[0]
    np.testing.assert_allclose(found, stack, rtol=1e-13, atol=4e-15 * size)
    place, turn = pose_of_twist(twist)
    assert np.array_equal(place, shift)
    x, y, z, w = turn
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    np.testing.assert_allclose(rotation, np.eye(3) + 2.0 * (w * cross + cross @ cross), atol=4e-15)


@pytest.mark.parametrize("size", [0, 1, 3])
def test_arrays_that_are_too_small_are_refused(shipped, size):
    """The compiled code trusts no length."""
    with pytest.raises(ValueError, match="are needed"):
        native.forward(
            np.zeros(size), np.zeros(2), np.zeros(native.CONFIGURATION), np.zeros(1, np.uint8)
        )


def test_floats_may_say_their_byte_order():
    """As those decoded from a recording do."""
    theta, row, status = np.zeros((1, 2)), np.zeros(native.CONFIGURATION), np.ones(1, np.uint8)
    decoded = np.zeros(16, np.uint8).view(np.dtype("d").newbyteorder("<")).reshape(1, 2)
    mechanism = Mechanism(*np.eye(3)[[0, 1, 0, 2, 1, 2]])
    constants = mechanism_constants(mechanism, ANYWHERE, limits_of())
    for angles in (theta, decoded):
        assert native.forward(constants, angles, row, status) == 0


@pytest.mark.parametrize("kind", [np.float32, np.int64, ">f8", bool])
def test_arrays_of_another_type_are_refused(kind):
    """Nor any type: integers are not read as if they were floats."""
    row, status = np.zeros(native.CONFIGURATION), np.zeros(1, np.uint8)
    with pytest.raises(TypeError, match="another type"):
        native.forward(np.zeros(native.MECHANISM), np.zeros(20, dtype=kind), row, status)


def test_a_load_of_whole_numbers_is_a_load():
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    whole = np.array([0, 0, -1, 0, 0, 0])
    found = [model.predict(np.array([0.1, 0.2]), Load(each)) for each in (whole, 1.0 * whole)]
    assert np.array_equal(found[0].twist, found[1].twist)
