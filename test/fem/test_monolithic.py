"""The condensed model of the mechanism room against the whole wrist on the same meshes.

    0 <= force, opening >= 0, force x opening = 0

Both sides share the meshes and the axes; the whole-wrist model knows neither the condensed
matrices nor the influence G.
"""

from dataclasses import replace

import numpy as np
import pytest
from whole_wrist.model import build_wrist, factor_pose
from whole_wrist.solve import Disturbance, solve_pose

from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.mechanism.components import ELASTIC, LINKS
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.statics import contact_operators, platform_twist

AGREEMENT = 1e-6
"""Platform twist under loads and own weight; what is left is the rounding of two solvers."""

MISFIT_AGREEMENT = 1e-5
"""With a misaligned axis or a warm link, whose screws are larger than the elastic ones."""

POSES = 10
GAP = 2e-6
OPEN = 1.0
GRAVITY = np.array([3.0, -2.0, -9.0])
"""Own weight along no axis [m/s^2]."""


@pytest.fixture(scope="module")
def geometry(make_wrist):
    """Skewed link angles; a flange at one side of joint_2 and joint_4, at both of joint_3."""
    wrist = make_wrist(gap=GAP, skew=0.15)
    flanges = {"joint_2": {"inner_gap": None}, "joint_4": {"outer_gap": None}}
    bushings = {name: replace(wrist.bushings[name], **without) for name, without in flanges.items()}
    return replace(wrist, bushings=wrist.bushings | bushings)


@pytest.fixture(scope="module")
def components(geometry, coarse):
    return elastic_components(geometry, coarse)[0]


@pytest.fixture(scope="module")
def poses(geometry, coarse):
    """Factored poses, each with a load."""
    wrist = build_wrist(geometry, coarse)
    mechanism = mechanism_of(geometry)
    rng = np.random.default_rng(20)
    angles = rng.uniform(-0.6, 0.6, (POSES, 2))
    loads = rng.normal(size=(POSES, 6)) * [2, 2, 2, 0.03, 0.03, 0.03]
    return [
        (factor_pose(wrist, mechanism.forward(theta)), load)
        for theta, load in zip(angles, loads, strict=True)
    ]


def condensed_twist(configuration, components, wrench, gravity, screws):
    operators = contact_operators(configuration, components, gravity)
    misfit = np.zeros((len(ELASTIC), 6))
    for name, screw in screws.items():
        misfit[ELASTIC.index(name)] = screw
    gap = operators.gap + operators.force_twist.T @ wrench
    gap += np.einsum("mki,ki->m", operators.screw_gap, misfit)
    force, _ = solve_contact(operators.approach, gap)
    free = operators.compliance @ wrench + operators.weight_twist
    free += platform_twist(influence(configuration), misfit)
    return free + operators.force_twist @ force, force


def relative_difference(twist, other):
    """Of translation and rotation, each on its own scale."""
    halves = [np.linalg.norm((twist - other)[h]) / np.linalg.norm(other[h]) for h in HALVES]
    return max(halves)


HALVES = (slice(0, 3), slice(3, 6))


def opened(model):
    return replace(model, gaps=np.full_like(model.gaps, OPEN))


@pytest.mark.slow
def test_open_flanges(poses, components):
    wide = {
        joint: replace(contact, gap=np.full_like(contact.gap, OPEN))
        for joint, contact in components.contact.items()
    }
    components = replace(components, contact=wide)
    for model, load in poses:
        solution = solve_pose(opened(model), load)
        twist, _ = condensed_twist(model.configuration, components, load, np.zeros(3), {})
        assert not solution.forces.any()
        assert relative_difference(solution.twist, twist) < AGREEMENT


@pytest.mark.slow
def test_closed_flanges(poses, components):
    closed = 0
    for model, load in poses:
        solution = solve_pose(model, load)
        twist, force = condensed_twist(model.configuration, components, load, np.zeros(3), {})
        closed += int(np.count_nonzero(solution.forces))
        assert relative_difference(solution.twist, twist) < AGREEMENT
        np.testing.assert_allclose(force, solution.forces, atol=1e-6)
        assert np.all(solution.openings > -1e-12)
        assert np.all(np.abs(solution.forces * solution.openings) < 1e-12)
    assert closed > 2 * POSES


@pytest.mark.slow
def test_own_weight_with_open_and_closed_flanges(poses, components):
    for model, load in poses:
        for wrench in (np.zeros(6), load):
            solution = solve_pose(model, wrench, Disturbance(gravity=GRAVITY))
            twist, _ = condensed_twist(model.configuration, components, wrench, GRAVITY, {})
            assert relative_difference(solution.twist, twist) < AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("name", ELASTIC)
def test_misaligned_axis_under_closed_flanges(poses, components, name):
    rng = np.random.default_rng(ELASTIC.index(name))
    model, load = poses[ELASTIC.index(name)]
    screw = rng.normal(size=6) * np.repeat([20e-6, 5e-4], 3)
    solution = solve_pose(model, load, Disturbance(gravity=GRAVITY, screws={name: screw}))
    twist, _ = condensed_twist(model.configuration, components, load, GRAVITY, {name: screw})
    assert solution.forces.any()
    assert relative_difference(solution.twist, twist) < MISFIT_AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("name", LINKS)
def test_warm_or_cold_link_under_closed_flanges(poses, components, geometry, name):
    """Thermal strain solved as a load is the growth of the chord between the link's bores."""
    model, load = poses[LINKS.index(name)]
    link = geometry.links[name]
    chord = np.subtract(*geometry.link_ends(name)[::-1]) * link.arc_radius
    per_kelvin = link.material.expansion * model.configuration.rotations[name] @ chord
    closed = 0
    for rise in (20.0, -20.0):
        screw = np.concatenate([rise * per_kelvin, np.zeros(3)])
        solution = solve_pose(model, load, Disturbance(gravity=GRAVITY, warming={name: rise}))
        twist, _ = condensed_twist(model.configuration, components, load, GRAVITY, {name: screw})
        closed += int(np.count_nonzero(solution.forces))
        assert relative_difference(solution.twist, twist) < MISFIT_AGREEMENT
    assert closed > 0


@pytest.mark.slow
def test_sliding_bushings(geometry, coarse):
    """Normal ties alone, solved whole with no slide or turn imposed, give what is condensed."""
    sliding, _ = elastic_components(geometry, coarse, "sliding")
    wrist, mechanism = build_wrist(geometry, coarse, slides=True), mechanism_of(geometry)
    rng = np.random.default_rng(26)
    closed = 0
    for name in ("link_1", "joint_3", "joint_4"):
        model = factor_pose(wrist, mechanism.forward(rng.uniform(-0.6, 0.6, 2)))
        load = rng.normal(size=6) * [2, 2, 2, 0.03, 0.03, 0.03]
        screw = rng.normal(size=6) * np.repeat([20e-6, 5e-4], 3)
        for screws in ({}, {name: screw}):
            solution = solve_pose(model, load, Disturbance(gravity=GRAVITY, screws=screws))
            twist, force = condensed_twist(model.configuration, sliding, load, GRAVITY, screws)
            closed += int(np.count_nonzero(solution.forces))
            assert relative_difference(solution.twist, twist) < AGREEMENT
            np.testing.assert_allclose(force, solution.forces, atol=1e-6)
    assert closed > 0


@pytest.mark.slow
def test_energy_balance(poses):
    """Work of load, weight and contact forces is twice the strain energy of all elements."""
    for model, load in poses[:3]:
        solution = solve_pose(model, load, Disturbance(gravity=GRAVITY))
        energy = work = 0.0
        for part, moved in zip(model.placed, solution.displacements, strict=True):
            energy += float(moved @ (part.stiffness @ moved)) / 2
            in_part = part.turn[:3, :3].T @ GRAVITY
            work += float(moved @ (part.turn @ (part.body.weight @ in_part)))
        platform = model.wrist.geometry.platform
        place = model.configuration.platform @ platform.centre_of_gravity
        weight = platform.mass * GRAVITY
        work += float(solution.twist @ (load + np.concatenate([weight, np.cross(place, weight)])))
        work -= float(solution.forces @ model.gaps)
        assert solution.forces.any()
        assert energy == pytest.approx(work / 2, rel=1e-8)


@pytest.mark.slow
def test_reciprocity(poses):
    """Twist by one load does the same work on another load as the other way round."""
    model = opened(poses[0][0])
    twists = np.array([solve_pose(model, unit).twist for unit in np.eye(6)])
    scale = np.sqrt(np.outer(np.diag(twists), np.diag(twists)))
    np.testing.assert_allclose(twists / scale, twists.T / scale, atol=1e-9)
    assert np.linalg.eigvalsh(twists / scale)[0] > 0


@pytest.mark.slow
def test_slides_are_free_until_a_flange_closes(poses):
    """With open flanges no axial force passes a passive joint, whatever the load."""
    model, load = poses[1]
    slides = {}
    for state in (opened(model), model):
        screws = solve_pose(state, load).screws
        slides[state is model] = np.abs(screws[-6::2]).max()
    assert slides[True] < slides[False]


@pytest.mark.slow
def test_flanges_on_both_sides_without_play_stop_the_slide(make_wrist, coarse):
    wrist = make_wrist(gap=0.0)
    model = factor_pose(build_wrist(wrist, coarse), mechanism_of(wrist).forward([0.3, -0.2]))
    load = np.array([1.0, -2.0, 1.5, 0.02, 0.01, -0.03])
    stopped, free = (solve_pose(m, load).screws[-6::2] for m in (model, opened(model)))
    # Only the flanges' own bending is left of the slide.
    assert np.abs(stopped).max() < 0.2 * np.abs(free).max()


def test_the_slide_formula_of_the_mechanism(poses):
    """A rigid screw at link_3 slides the joints as the closed form of the axes says."""
    model, _ = poses[2]
    name, screw = "link_3", np.array([10e-6, -5e-6, 8e-6, 0.0, 0.0, 0.0])
    slides = solve_pose(opened(model), np.zeros(6), Disturbance(screws={name: screw})).screws[-6::2]
    pose = model.configuration
    # Limb 2 moves the platform only through e = c x d; joint_3 and joint_4 take up the rest.
    b, c, d = pose.b, pose.c, pose.d
    volume = float(np.dot(b, np.cross(c, d)))
    limb = screw[:3]
    normals = np.array([np.cross(c, d), -np.cross(d, b), -np.cross(b, c)])
    expected = normals @ limb / volume
    np.testing.assert_allclose(slides, expected, atol=1e-6 * np.abs(expected).max())
