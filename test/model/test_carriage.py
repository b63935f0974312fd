"""Screws at components against the exact closure of a slightly changed mechanism.

The oracle is the product of exponentials of both limbs, solved for the passive joints' turns and
slides with finite rotations; it knows neither G nor N.
"""

import numpy as np
import pytest
from scipy.optimize import root

from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.evaluation import situation_of
from wrist_stiffness.model.law import Contribution
from wrist_stiffness.model.places import cross_axes

POSES = np.radians([[0.0, 0.0], [20.0, -10.0], [-35.0, 30.0], [40.0, 25.0]])

SMALL = 1e-5
"""Size of planted screws [m, rad]."""

SECOND_ORDER = 30.0 * SMALL**2
"""What first order may miss: the square of the screw times amplifiers below 3 of each limb."""

CHAINS = (
    ("frame", "joint_1", "a1", "link_1", "joint_2", "platform"),
    ("frame", "joint_5", "a2", "link_2", "joint_4", "link_3", "joint_3", "platform"),
)
"""Where the oracle can put a screw, from the frame to the platform; the motors turn at a1, a2."""


@pytest.fixture(scope="module")
def closure(model, make):
    """Return a function (theta, screws at home by slot) -> error twist, slides of joints 2 to 4."""
    axes = model.table.geometry.axes

    def limb(chain, theta, passive, screws):
        parts = []
        for slot in chain:
            if slot in ("a1", "a2"):
                number = ("a1", "a2").index(slot)
                parts.append(make.motion(axes[("joint_1", "joint_5")[number]], theta[number]))
            elif slot in passive:
                parts.append(make.motion(axes[slot], *passive[slot]))
            elif slot in screws:
                parts.append(exp_twist(screws[slot]))
        return make.compose(*parts)

    def both(x, theta, screws):
        passive = {f"joint_{j}": (x[2 * j - 4], x[2 * j - 3]) for j in (2, 3, 4)}
        return [limb(chain, theta, passive, screws) for chain in CHAINS]

    def gap(x, theta, screws):
        (r1, s1), (r2, s2) = both(x, theta, screws)
        return np.concatenate([s1 - s2, log_motion(r1.T @ r2, np.zeros(3))[3:]])

    def solve(theta, screws):
        x = np.zeros(6)
        for fraction in (0.25, 0.5, 0.75, 1.0):
            x = root(gap, x, args=(fraction * theta, screws), tol=1e-14).x
        assert np.max(np.abs(gap(x, theta, screws))) < 1e-12
        rotation, shift = both(x, theta, screws)[0]
        nominal = model.table.mechanism.forward(theta).platform
        return log_motion(rotation @ nominal.T, shift), x[1::2]

    return solve


def carried(model, theta, added):
    """Return the twist and the slides of joints 2 to 4 that G and N give a contribution."""
    at = situation_of(model, Block(np.zeros(1), theta[None], np.zeros((1, 6))), None)
    added = added(at) if callable(added) else added
    twist, gap = at.carried(added)
    slide = at.parts.sectors.slide
    sectors = [int(np.flatnonzero(slide[:, j])[0]) for j in range(3)]
    return twist[0], np.array([gap[0, i] / slide[i, j] for j, i in enumerate(sectors)])


@pytest.mark.parametrize("theta", POSES, ids=str)
@pytest.mark.parametrize("place", ["link_1", "link_2", "link_3", "frame", "platform", "joint_4"])
def test_a_screw_moves_platform_and_slides_as_the_closed_loop_does(model, closure, theta, place):
    screw = SMALL * np.array([0.3, -0.8, 0.5, 0.7, 0.2, -0.6])
    # The near side of joint_4 is the far side of link_2: the same place on the chain.
    slot = {"joint_4": "link_2"}.get(place, place)
    twist, slides = closure(theta, {slot: screw})
    by_g, by_n = carried(model, theta, lambda at: at.screw(place, screw))
    assert np.allclose(by_g, twist, atol=SECOND_ORDER)
    assert np.allclose(by_n, slides, atol=SECOND_ORDER)
    assert np.linalg.norm(twist) > 0.1 * SMALL


@pytest.mark.parametrize("theta", POSES, ids=str)
@pytest.mark.parametrize(
    ("joint", "slot"),
    [
        ("joint_1", "joint_1"),
        ("joint_2", "link_1"),
        ("joint_3", "link_3"),
        ("joint_4", "link_2"),
        ("joint_5", "joint_5"),
    ],
)
def test_misaligned_axis_is_a_changed_mechanism(model, make, closure, joint, slot, theta):
    """The screw stands before the joint, in the body on the motor's side."""
    effect = make.effect(f"axis_misalignment@{joint}")
    keys = [p.key for p in effect.parameters]
    values = dict(zip(keys, np.linspace(3.0, 8.0, len(keys)), strict=True))
    effect = effect.with_values(values)
    axes = cross_axes(model.table.geometry, joint)
    screw = np.zeros(6)
    for key, value in effect.si.items():
        kind, axis, _ = key.split("_")
        half = slice(0, 3) if kind == "shift" else slice(3, 6)
        screw[half] += value * axes["uvw".index(axis)]
    twist, slides = closure(theta, {slot: screw})
    by_g, by_n = carried(model, theta, lambda at: effect.law.advance(at, joint, effect.si, None)[0])
    # Tilts of up to 0.14 mrad: ten times the other planted screws.
    assert np.allclose(by_g, twist, atol=SECOND_ORDER * 40)
    assert np.allclose(by_n, slides, atol=SECOND_ORDER * 40)


@pytest.mark.parametrize("theta", POSES, ids=str)
@pytest.mark.parametrize("link", ["link_1", "link_2"])
def test_grown_link_is_a_changed_mechanism(model, make, closure, theta, link):
    """10 K and 11.5 ppm/K over the chord between the bores."""
    geometry = model.table.geometry
    start, end = geometry.link_ends(link)
    growth = 10.0 * 11.5e-6 * geometry.links[link].arc_radius * (end - start)
    twist, slides = closure(theta, {link: np.concatenate([growth, np.zeros(3)])})
    effect = make.effect(f"thermal_expansion@{link}")
    block = Block(np.zeros(1), theta[None], np.zeros((1, 6)), temperatures={link: np.array([30.0])})
    at = situation_of(model, block, None)
    contribution, _ = effect.law.advance(at, link, effect.si, None)
    by_g, by_n = carried(model, theta, contribution)
    assert np.allclose(by_g, twist, atol=SECOND_ORDER)
    assert np.allclose(by_n, slides, atol=SECOND_ORDER)


def test_growth_of_link_3_never_reaches_the_platform(model, closure):
    geometry = model.table.geometry
    start, end = geometry.link_ends("link_3")
    growth = 1e-4 * geometry.links["link_3"].arc_radius * (end - start)
    for theta in POSES:
        twist, _ = closure(theta, {"link_3": np.concatenate([growth, np.zeros(3)])})
        assert np.linalg.norm(twist) < 1e-12


@pytest.mark.parametrize("theta", POSES, ids=str)
@pytest.mark.parametrize("motor", [1, 2])
def test_turned_motor_is_the_rigid_pose_at_another_angle(model, make, theta, motor):
    other = theta.copy()
    other[motor - 1] += np.radians(5e-3)
    forward = model.table.mechanism.forward
    turned = log_motion(forward(other).platform @ forward(theta).platform.T, np.zeros(3))
    block = Block(np.zeros(1), theta[None], np.zeros((1, 6)))
    effect = make.effect(f"encoder_offset@motor_{motor}", offset_mdeg=5.0)
    at = situation_of(model, block, None)
    twist = at.carried(effect.law.advance(at, f"motor_{motor}", effect.si, None)[0])[0][0]
    assert np.allclose(twist, turned, atol=3.0 * np.radians(5e-3) ** 2)


def test_wrench_through_a_component_is_the_transpose_of_its_influence(model):
    """Virtual work: what a screw at a component moves, times the load, is the load through it."""
    at = situation_of(
        model,
        Block(np.zeros(1), POSES[1][None], np.array([[1.0, -0.5, 0.3, 0.01, 0.02, 0.03]])),
        None,
    )
    rng = np.random.default_rng(1)
    screw = rng.normal(size=(1, 6))
    free = at.through - at.statics.own_weight
    push = at.contact_force @ at.parts.sectors.slide
    for limb, k in (("limb_1", 0), ("limb_2", 2)):
        twist, gap = at.carried(Contribution(**{limb: screw}))
        slides = np.zeros(3)
        for j in range(3):
            i = np.flatnonzero(at.parts.sectors.slide[:, j])[0]
            slides[j] = gap[0, i] * at.parts.sectors.slide[i, j]
        work = twist[0] @ at.load[0] + slides @ push[0]
        assert work == pytest.approx(free[0, k] @ screw[0], rel=1e-10)
