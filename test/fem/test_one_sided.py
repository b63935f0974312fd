"""Walls that lift off: against the condensed two-sided wall, rigid play, scaling, equilibrium."""

import numpy as np
import pytest
from scipy.optimize import linprog

from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.fem.one_sided import PatchedWrist, patch_bushing, solve_patches
from wrist_stiffness.fem.parts import RINGS, assemble_body, wrist_parts
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators

SIZES = MeshSettings(
    link=4e-3, bore=2.4e-3, bushing=0.8e-3, bushing_corner=0.3e-3, bushing_arc=2.8e-3
)
LOAD = np.array([1.0, -2.0, 1.5, 0.02, 0.01, -0.03])
POSE = (0.3, -0.2)


@pytest.fixture(scope="module")
def geometry(make_wrist):
    return make_wrist(gap=0.0, skew=0.15)


@pytest.fixture(scope="module")
def components(geometry):
    return elastic_components(geometry, SIZES, "sliding")[0]


@pytest.fixture(scope="module")
def pose(geometry):
    return mechanism_of(geometry).forward(POSE)


@pytest.fixture(scope="module")
def make_patched(geometry, components):
    def patched(wall_rings: int) -> PatchedWrist:
        parts = wrist_parts(geometry)
        bushings = {
            part.name: patch_bushing(assemble_body(part.solid, SIZES), wall_rings)
            for part in parts
            if part.solid.is_bushing
        }
        return PatchedWrist(geometry, parts, components, bushings)

    return patched


@pytest.fixture(scope="module")
def patched(make_patched):
    return make_patched(4)


def test_patches_of_a_two_sided_wall_close_in_on_the_condensed_one(make_patched, components, pose):
    """A wall held in the mean of its patches is softer; with finer ones it is held everywhere."""
    condensed = respond(contact_operators(pose, components, np.zeros(3)), LOAD).twist
    work = [
        LOAD
        @ solve_patches(make_patched(rings), pose, LOAD, lifts=False).twist
        / (LOAD @ condensed)
        for rings in (2, 4, 8)
    ]
    assert work[0] > work[1] > work[2] > 1.0
    # The pressure at the wall's ends is singular: patches half as long leave about half.
    np.testing.assert_array_less(np.diff(np.log(np.subtract(work, 1.0))), np.log(0.6))
    assert work[2] - 1.0 < 0.06


def test_a_wall_that_lifts_off_is_softer_and_pushes_only(patched, pose):
    two, one = (solve_patches(patched, pose, LOAD, lifts=lifts) for lifts in (False, True))
    assert LOAD @ one.twist > 1.2 * (LOAD @ two.twist)
    for joint, force in one.forces.items():
        on_wall = patched.bushings[joint].surface == "wall"
        assert np.all(force >= 0.0)
        assert np.any(force[on_wall] == 0.0)
        assert np.any(two.forces[joint][on_wall] < 0.0)


def test_patches_push_the_hub_outwards_and_a_motors_pin_inwards(patched):
    for joint, bushing in patched.bushings.items():
        outwards = np.array([np.cos(bushing.angle), np.sin(bushing.angle)])
        radial = np.sum(outwards * bushing.wrench[:2], axis=0)[bushing.surface == "wall"]
        # The mean over an arc of 45 degrees of what points along its middle.
        mean = np.sin(np.pi / 8) / (np.pi / 8)
        expected = -mean if joint in ("joint_1", "joint_5") else mean
        np.testing.assert_allclose(radial, expected, rtol=5e-3)


def test_platform_is_in_equilibrium(patched, pose):
    solved = solve_patches(patched, pose, LOAD, clearance=3e-6)
    total = LOAD.copy()
    for joint in ("joint_2", "joint_3"):
        part = patched.parts[ELASTIC.index(joint)]
        carrier = {"joint_2": "link_1", "joint_3": "link_3"}[joint]
        at = part.home.turned(pose.rotations[carrier])
        total += at.wrench @ patched.bushings[joint].wrench @ solved.forces[joint]
    # The springs that hold every frame take ten millionths.
    np.testing.assert_allclose(total, 0.0, atol=1e-5 * np.abs(LOAD).max())


def test_clearance_and_load_have_one_scale(patched, pose):
    """Twice the load with twice the clearance is twice the motion; clearance alone is no spring."""
    once = solve_patches(patched, pose, LOAD, clearance=2e-6).twist
    both = solve_patches(patched, pose, 2.0 * LOAD, clearance=4e-6).twist
    # Contact of the flanges' closed gaps is positively homogeneous too.
    np.testing.assert_allclose(both, 2.0 * once, rtol=1e-6, atol=1e-9 * np.abs(once).max())
    load_alone = solve_patches(patched, pose, 2.0 * LOAD, clearance=2e-6).twist
    assert LOAD @ load_alone < 0.95 * (LOAD @ both)


def test_a_light_load_finds_the_end_of_the_play(patched, pose):
    """Stiff against the load, a wrist moves as far as rigid bodies can: a linear programme."""
    clearance, light = 10e-6, 1e-2
    solved = solve_patches(patched, pose, light * LOAD, clearance)
    rigid = rigid_play(patched, pose, clearance)
    assert light * LOAD @ solved.twist == pytest.approx(light * rigid, rel=0.02)


def rigid_play(patched, pose, clearance):
    """Most that the load can move four rigid bodies within the gaps of all patches [J]."""
    frames = ("link_1", "link_2", "link_3", "platform")
    on = {
        "joint_1": ("link_1", None),
        "joint_2": ("platform", "link_1"),
        "joint_3": ("platform", "link_3"),
        "joint_4": ("link_3", "link_2"),
        "joint_5": ("link_2", None),
    }
    carrier = {"joint_1": "frame", "joint_2": "link_1", "joint_3": "link_3", "joint_4": "link_2"}
    rows, gaps = [], []
    for joint, (pushed, back) in on.items():
        bushing = patched.bushings[joint]
        at = patched.parts[ELASTIC.index(joint)].home
        at = at.turned(pose.rotations[carrier.get(joint, "frame")])
        wrench = (at.wrench @ bushing.wrench).T
        row = np.zeros((len(wrench), 24))
        row[:, 6 * frames.index(pushed) :][:, :6] = wrench
        if back is not None:
            row[:, 6 * frames.index(back) :][:, :6] = -wrench
        rows.append(row)
        gaps.append(np.where(bushing.surface == "wall", clearance, 0.0))
    held = np.zeros((4, 24))
    for k, (link, joint) in enumerate((("link_1", "joint_1"), ("link_2", "joint_5"))):
        start, axis = 6 * frames.index(link), patched.geometry.axes[joint]
        held[2 * k, start : start + 3] = held[2 * k + 1, start + 3 : start + 6] = axis
    goal = np.zeros(24)
    goal[18:] = -LOAD
    found = linprog(
        goal,
        A_ub=-np.vstack(rows),
        b_ub=np.concatenate(gaps) / 1e-6,
        A_eq=held,
        b_eq=np.zeros(4),
        bounds=(None, None),
    )
    assert found.success, found.message
    return -found.fun * 1e-6


def test_patches_answer_alike_around_the_bushing(patched):
    bushing = patched.bushings["joint_3"]
    slices = len(np.unique(bushing.angle.round(9)))
    size = len(bushing.angle) // slices
    turned = np.roll(bushing.flexibility, (size, size), axis=(0, 1))
    np.testing.assert_allclose(turned, bushing.flexibility, atol=1e-9 * np.abs(turned).max())
    assert np.linalg.eigvalsh(bushing.flexibility)[0] > 0.0
    assert np.count_nonzero(bushing.surface == "inner") == RINGS * slices
