"""Effects that no recording can tell apart, and directions that nothing can feel."""

import numpy as np
import pytest

from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.effects.axis_misalignment import SHIFTS, TILTS
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.places import cross_axes

NEAR_SIDE = {"joint_2": "link_1", "joint_3": "link_3", "joint_4": "link_2"}
"""The link on the motor's side of a joint: the far side of the joint before."""


def constant_screw(place, direction):
    law = FormulaLaw("planted", place, np.asarray(direction, dtype=float), "size", [], ["size"])
    return Effect(law, place, {"size": Estimate(1e-5)})


def poses(make, n=12):
    """Poses all over the workspace, unloaded."""
    block = make.block(n)
    return make.block(n, load=np.zeros((n, 6)), theta=2.0 * block.theta)


@pytest.mark.parametrize("joint", NEAR_SIDE)
def test_far_side_of_one_joint_is_near_side_of_the_next(model, make, joint):
    """With flanges in contact too: the place on the limb is the same."""
    axes = cross_axes(model.table.geometry, joint)
    misaligned = make.effect(f"axis_misalignment@{joint}", shift_u_um=10.0)
    planted = constant_screw(NEAR_SIDE[joint], [*axes[0], 0.0, 0.0, 0.0])
    block = poses(make)
    assert np.allclose(
        make.added(model, misaligned, block), make.added(model, planted, block), atol=1e-15
    )


@pytest.mark.parametrize("joint", NEAR_SIDE)
@pytest.mark.parametrize(("half", "felt"), [(0, SHIFTS), (3, TILTS)])
def test_the_felt_directions_are_all_that_can_be_felt(free_model, make, joint, half, felt):
    """Among all directions of the body as many are felt as the law has, over all poses.

    But for joint_3's v, which slides link_3 along joint_4: without flanges nothing shows it.
    """
    block = poses(make)
    axes = cross_axes(free_model.table.geometry, joint)
    columns = []
    for axis in axes:
        direction = np.zeros(6)
        direction[half : half + 3] = axis
        planted = constant_screw(NEAR_SIDE[joint], direction)
        columns.append(make.added(free_model, planted, block).ravel())
    size = np.linalg.norm(columns, axis=1)
    felt = len(felt[joint]) - (joint == "joint_3" and half == 0)
    assert np.all(size[felt:] < 1e-9 * size.max())
    singular = np.linalg.svd(columns[:felt], compute_uv=False)
    assert singular[-1] > 0.05 * singular[0]


def test_a_shift_that_slides_link_3_is_gaps_of_its_joints(model, make):
    """To move by v across joint_3 it slides along both of its axes, an angle apart."""
    block, small = make.block(), 1e-3
    axes = model.table.geometry.axes
    cosine = axes["joint_3"] @ axes["joint_4"]
    sine = np.sqrt(1.0 - cosine**2)

    def gap(joint):
        return make.added(model, make.effect(f"flange_contact@{joint}", gap_um=small), block)

    shifted = make.effect("axis_misalignment@joint_3", shift_v_um=small)
    slid = -gap("joint_4") / sine - gap("joint_3") * cosine / sine
    moved = make.added(model, shifted, block)
    assert np.linalg.norm(moved - slid) < 0.01 * np.linalg.norm(moved)


@pytest.mark.parametrize(("motor", "joint"), [("motor_1", "joint_1"), ("motor_2", "joint_5")])
def test_encoder_offset_is_a_turned_axis(model, make, motor, joint):
    block = make.block()
    assert np.allclose(
        make.added(model, make.effect(f"encoder_offset@{motor}", offset_mdeg=30.0), block),
        make.added(model, make.effect(f"axis_misalignment@{joint}", tilt_w_mdeg=30.0), block),
        atol=1e-15,
    )


def test_frame_and_platform_screws_reach_the_platform_whole(model, make):
    """And leave slides and contact alone."""
    screw = np.array([0.3, -0.2, 0.5, 0.1, 0.7, -0.4])
    block = make.block()
    assert np.allclose(
        make.added(model, constant_screw("frame", screw), block), 1e-5 * screw, atol=1e-14
    )
    turned = make.added(model, constant_screw("platform", screw), block)
    body = model.table.mechanism.forward(block.theta).platform
    assert np.allclose(turned[:, :3], 1e-5 * body @ screw[:3], atol=1e-14)


def test_backlash_is_a_zero_offset_until_the_other_approach(free_model, make):
    """One load and one approach cannot tell backlash from a zero; the other approach can."""
    up = np.radians([0.0, 5.0, 10.0])
    for angles, alike in ((up, True), (np.concatenate([up, up[::-1]]), False)):
        n = len(angles)
        block = make.block(n, theta=np.stack([angles, angles], axis=1), load=np.zeros((n, 6)))
        lost = make.added(free_model, make.effect("backlash@motor_1", width_mdeg=20.0), block)
        zero = make.added(
            free_model, make.effect("encoder_offset@motor_1", offset_mdeg=-10.0), block
        )
        assert np.allclose(lost[1:], zero[1:], atol=1e-12) == alike
