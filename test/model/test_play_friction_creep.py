"""Laws with gaps and memory: sign, limits, closed loops, energy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wrist_stiffness.mechanism.components import JOINTS, PASSIVE_JOINTS
from wrist_stiffness.model.block import Block, Load, Sample
from wrist_stiffness.model.evaluation import evaluate
from wrist_stiffness.model.memory import lag, play
from wrist_stiffness.model.pin_play import SMALL_FORCE, WALL, Play
from wrist_stiffness.model.places import cross_axes, end_screws
from wrist_stiffness.model.rubbing import Bristles, pressing, slip

RADIAL = 1e-5

paths = arrays(float, st.tuples(st.integers(1, 40), st.just(2)), elements=st.floats(-1.0, 1.0))


def open_play(force):
    """A pin without flanges under end forces (4,) [N]."""
    nothing = np.zeros((1, 0)), np.zeros((1, 0, 4)), np.zeros((1, 0, 0))
    return Play(RADIAL, np.array([force], dtype=float), *nothing).resting()[0]


def test_pin_lies_on_the_side_of_its_force():
    assert np.allclose(open_play([3.0, 4.0, -2.0, 0.0]) / RADIAL, [0.6, 0.8, -1, 0], atol=0.01)


@given(arrays(float, 4, elements=st.floats(-5.0, 5.0)))
def test_play_yields_to_its_forces_up_to_the_walls(force):
    x = open_play(force)
    assert force @ x >= 0.0
    assert np.linalg.norm(x.reshape(2, 2), axis=1).max() <= RADIAL * 1.01


@pytest.mark.parametrize("joint", JOINTS)
def test_end_screws_are_a_rigid_pin(model, joint):
    """Each screw moves its own end by one across the axis and leaves the other where it is."""
    geometry = model.table.geometry
    bushing, axis = geometry.bushings[joint], geometry.axes[joint]
    ends = [(bushing.radius + half * bushing.length) * axis for half in (0.5, -0.5)]
    across = cross_axes(geometry, joint)[:2]
    for number, screw in enumerate(end_screws(geometry, joint)):
        own, other = ends if number < 2 else ends[::-1]
        assert np.allclose(screw[:3] + np.cross(screw[3:], own), across[number % 2], atol=1e-12)
        assert np.allclose(screw[:3] + np.cross(screw[3:], other), 0.0, atol=1e-12)


@pytest.mark.parametrize("joint", JOINTS)
def test_next_to_no_play_moves_the_platform_next_to_nothing(model, make, joint):
    """Walls yield far less than the joints themselves: a fit that wants no play finds none."""
    block, play = make.block(25), make.effect(f"joint_clearance@{joint}", clearance_um=1e-3)
    without, loose = model.batch_with(block, [[], [play]])
    moved = np.abs(loose.twist - without.twist)
    assert 0.0 < moved[:, :3].max() < 1e-7
    assert moved[:, 3:].max() < 5e-6


@pytest.mark.parametrize("joint", JOINTS)
def test_flanges_push_the_pin_back_within_its_play(model, make, joint):
    """The pin is in balance with walls and flanges, and no flange bears more than a few loads."""
    loaded = model.with_effects(make.effect(f"joint_clearance@{joint}", clearance_um=2e6 * RADIAL))
    block = make.block(25)
    result = evaluate(loaded, block, None)
    at = result.situation
    assert result.active.any()
    assert result.situation.contact_force.max() < 3.0
    ends = end_screws(at.table.geometry, joint)
    force = (at.at_home(joint, at.through_place(joint)) @ ends.T).reshape(-1, 2, 2)
    added = result.contributions[0]
    screw = at.at_home(joint, added.limb_1 if added.limb_2 is None else added.limb_2)
    moved = np.linalg.lstsq(ends.T, screw.T, rcond=None)[0].T.reshape(-1, 2, 2)
    size = np.linalg.norm(moved, axis=-1, keepdims=True)
    assert size.max() < 1.05 * RADIAL
    centring = SMALL_FORCE / RADIAL
    wall = (centring + WALL * np.maximum(1.0 - RADIAL / size, 0.0)) * moved
    assert np.allclose(force, wall, atol=1e-5)


@pytest.mark.parametrize("joint", JOINTS)
def test_play_vanishes_with_its_gap_and_follows_its_load(weightless, make, joint):
    """Without friction or weight the load's work on the play is positive, both ways."""
    for sign in (1.0, -1.0):
        block = make.rest((20.0, -10.0), sign * np.array([0.5, -0.4, -1.0, 0.01, 0.02, -0.01]))
        whole, half = (
            make.added(weightless, make.effect(f"joint_clearance@{joint}", clearance_um=c), block)[
                0
            ]
            for c in (2.0, 1.0)
        )
        assert whole @ block.load[0] > 0.0
        # An end that carries newtons lies tens of nanometres in its wall.
        assert np.allclose(half, 0.5 * whole, atol=0.1 * np.abs(whole).max())
        none = make.effect(f"joint_clearance@{joint}", clearance_um=0.0)
        assert not make.added(weightless, none, block).any()


@given(paths, st.floats(0.0, 1.0))
def test_play_is_a_clamp_after_a_clamp(values, width):
    start = values[0]
    followed, y = play(values, width, start), start
    for u, at_once in zip(values, followed, strict=True):
        y = np.minimum(np.maximum(y, u - width), u + width)
        assert np.array_equal(y, at_once)


@given(paths, st.floats(0.01, 10.0), st.integers(0, 100))
def test_lag_is_a_step_after_a_step(values, time_constant, seed):
    interval = np.random.default_rng(seed).uniform(0.0, 2.0, len(values))
    before, start = np.array([0.3, -0.2]), np.array([0.1, 0.5])
    slow = lag(values, interval, time_constant, before, start)
    x, u_before = start, before
    for u, dt, at_once in zip(values, interval, slow, strict=True):
        # A ramp is followed late by the time constant, once the start has died away.
        late = (u - u_before) / max(dt, 1e-300) * time_constant
        x = u - late + (x - u_before + late) * np.exp(-dt / time_constant)
        u_before = u
        assert np.allclose(x, at_once, rtol=1e-11, atol=1e-11 * (1.0 + np.abs(late)))


PERIOD = 100


def swing(degrees):
    """Three equal periods of both motors in step, unloaded."""
    phase = 2.0 * np.pi * np.arange(3 * PERIOD) / PERIOD
    theta = np.radians(degrees) * np.stack([np.sin(phase), 0.7 * np.sin(phase)], axis=1)
    return Block(0.02 * np.arange(3.0 * PERIOD), theta, np.zeros((3 * PERIOD, 6)))


def motor_1_turn(model, block, twist):
    """Return by how much motor 1 must have turned for a platform twist, (n,) [rad]."""
    mechanism = model.table.mechanism
    column = mechanism.jacobian(mechanism.forward(block.theta))[:, :, 0]
    turn = np.einsum("ni,ni->n", twist[:, 3:], column) / np.einsum("ni,ni->n", column, column)
    assert np.allclose(twist[:, 3:], turn[:, None] * column, atol=1e-15)
    return turn


def test_backlash_lies_half_a_width_behind_and_closes_its_loop(weightless, make):
    block = swing(10.0)
    effect = make.effect("backlash@motor_1", width_mdeg=50.0)
    turned = motor_1_turn(weightless, block, make.added(weightless, effect, block))[PERIOD:]
    speed = np.gradient(block.theta[:, 0])[PERIOD:]
    far = np.abs(speed) > 0.3 * np.abs(speed).max()
    assert np.allclose(turned[far], -np.radians(0.025) * np.sign(speed[far]), rtol=1e-9)
    assert np.allclose(turned[PERIOD:], turned[:PERIOD], atol=1e-12)
    assert np.abs(turned).max() <= np.radians(0.025) * (1 + 1e-9)


def test_motor_at_rest_keeps_the_side_it_came_from(weightless, make):
    angle = np.radians([0.0, 5.0, 5.0, 5.0])
    block = Block(np.arange(4.0), np.stack([angle, 0 * angle], axis=1), np.zeros((4, 6)))
    effect = make.effect("backlash@motor_1", width_mdeg=40.0)
    turned = motor_1_turn(weightless, block, make.added(weightless, effect, block))[1:]
    assert np.allclose(turned, -np.radians(0.020), rtol=1e-9)


@given(paths, st.floats(0.01, 3.0))
def test_friction_never_creates_energy(moved, budget):
    """Each slip goes along with the force on the bristle's foot; no force exceeds the budget."""
    foot = moved[0]
    compliance = np.array([[0.3, 1.7]])
    for position in moved:
        force, later = slip(Bristles(position[None], compliance, np.array([budget])), foot)
        assert np.array_equal(later[0], foot)
        assert force[0] @ (later[1] - foot) >= -1e-15
        assert np.linalg.norm(force[0]) <= budget * (1.0 + 1e-12)
        foot = later[1]


@pytest.mark.parametrize("joint", PASSIVE_JOINTS)
def test_force_and_moment_press_a_pin_to_its_sleeve(model, joint):
    """A force at the middle once, a moment by a force at each end, nothing along the axis."""
    geometry = model.table.geometry
    bushing, axis = geometry.bushings[joint], geometry.axes[joint]
    across = cross_axes(geometry, joint)[0]
    middle = bushing.radius * axis
    force = np.concatenate([3.0 * across, np.cross(middle, 3.0 * across)])
    moment = np.concatenate([np.zeros(3), 0.02 * across])
    along = np.concatenate([5.0 * axis, 0.1 * axis])
    found = pressing(geometry, joint, np.array([force, moment, along, force + along]))
    assert found == pytest.approx([3.0, 2.0 * 0.02 / bushing.length, 0.0, 3.0], abs=1e-12)


def test_turning_frees_the_slide():
    """One budget: a joint that turns far has nothing left against its slide."""
    steps = np.linspace(0.0, 1.0, 200)
    budget, compliance = np.full(200, 1.0), np.full((200, 2), 0.01)
    at_rest, turning = (
        slip(Bristles(np.stack([turn, 0.005 * steps], 1), compliance, budget), np.zeros(2))[0]
        for turn in (0 * steps, steps)
    )
    assert at_rest[-1, 1] == pytest.approx(0.5)
    assert abs(turning[-1, 1]) < 0.02
    assert turning[-1, 0] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("joint", PASSIVE_JOINTS)
def test_friction_is_a_closed_loop_that_vanishes_with_its_coefficient(free_model, make, joint):
    block = swing(20.0)
    rubbing = make.effect(f"joint_friction@{joint}", coefficient=0.3, preload_N=2.0)
    loop = make.added(free_model, rubbing, block)
    size = np.abs(loop).max()
    assert np.allclose(loop[2 * PERIOD :], loop[PERIOD : 2 * PERIOD], atol=1e-3 * size)
    # The same pose on the way up and on the way down.
    up, down = loop[PERIOD + 5], loop[PERIOD + PERIOD // 2 - 5]
    assert np.abs(up - down).max() > 0.1 * size > 1e-10
    smooth = make.effect(f"joint_friction@{joint}", coefficient=0.0)
    assert np.abs(make.added(free_model, smooth, block)).max() < 1e-6 * size


@pytest.mark.parametrize("joint", PASSIVE_JOINTS)
def test_a_bristle_gives_way_by_a_distance_and_by_so_much_a_newton(free_model, make, joint):
    """Under half the budget the first one is half as soft, the second one as soft as before."""
    theta = np.radians([20.0, -10.0]) + np.array([[0.0, 0.0], [1e-7, 1e-7]])
    block = Block(np.arange(2.0), theta, np.zeros((2, 6)))

    def moved(**values):
        # Nothing slips: so tiny a move bends the bristle alone.
        rubbing = make.effect(f"joint_friction@{joint}", coefficient=1.0, **values)
        return np.abs(make.added(free_model, rubbing, block)).max()

    by_distance = [moved(preload_N=p, presliding_um=200.0) for p in (100.0, 50.0)]
    by_newton = [
        moved(preload_N=p, presliding_um=0.01, bristle_um_per_N=1000.0) for p in (100.0, 50.0)
    ]
    assert by_distance[1] == pytest.approx(0.5 * by_distance[0], rel=0.1)
    assert by_newton[1] == pytest.approx(by_newton[0], rel=0.01)
    assert by_newton[0] < 0.5 * moved(preload_N=100.0, presliding_um=0.01)


@pytest.mark.parametrize("joint", PASSIVE_JOINTS)
def test_a_pin_in_its_play_feels_the_friction_of_another_joint(free_model, make, joint):
    """Both ends lie along the force that they carry, whatever part of it rubs."""
    place = "joint_5" if joint == "joint_2" else "joint_1"
    rubbing = make.effect(f"joint_friction@{joint}", coefficient=0.5, preload_N=2.0)
    loose = make.effect(f"joint_clearance@{place}", clearance_um=2e6 * RADIAL)
    result = evaluate(free_model.with_effects(rubbing, loose), swing(20.0), None)
    ends = end_screws(result.situation.table.geometry, place)

    def pressed(at):
        return (at.at_home(place, at.through_place(place)) @ ends.T).reshape(-1, 2, 2)

    smooth = evaluate(free_model.with_effects(loose), swing(20.0), None)
    assert np.abs(pressed(result.situation) - pressed(smooth.situation)).max() > 0.1
    added = result.contributions[1]
    screw = result.situation.at_home(place, added.limb_1 if added.limb_2 is None else added.limb_2)
    moved = np.linalg.lstsq(ends.T, screw.T, rcond=None)[0].T.reshape(-1, 2, 2)
    force = pressed(result.situation)
    crossed = moved[..., 0] * force[..., 1] - moved[..., 1] * force[..., 0]
    assert np.abs(crossed).max() < 1e-6 * RADIAL
    assert np.sum(moved * force, axis=-1).min() > 0.0


def test_slide_locks_when_the_load_comes_at_rest(free_model, make):
    """A stiff bristle with a large budget holds the slide that a load at rest would make."""
    joint, number = "joint_3", 1
    theta = np.tile(np.radians([20.0, -10.0]), (2, 1))
    load = np.array([np.zeros(6), [0.6, -0.5, -1.0, 0.0, 0.0, 0.0]])
    block = Block(np.arange(2.0), theta, load)
    free = evaluate(free_model, block, None)
    wanted = np.diff(free.situation.slides[:, number])[0]
    locked = free_model.with_effects(
        make.effect(f"joint_friction@{joint}", coefficient=2.0, preload_N=100.0, presliding_um=0.01)
    )
    held = evaluate(locked, block, None)
    at = held.situation
    slid = at.slides[1, number] - free.situation.slides[0, number]
    assert abs(wanted) > 1e-8
    assert abs(slid) < 0.02 * abs(wanted)


def test_creep_settles_to_its_step(weightless, make):
    """After a load step the delayed part follows 1 - exp(-t / tau)."""
    effect = make.effect("creep@joint_1", delayed_percent=40.0, time_constant_s=5.0)
    session = weightless.with_effects(effect).session()
    theta = np.radians([20.0, -10.0])
    wrench = Load(np.array([0.3, 0.2, -1.0, 0.0, 0.0, 0.0]))
    session.advance(Sample(0.0, theta, Load(np.zeros(6))))
    session.advance(Sample(1.0, theta, Load(np.zeros(6))))
    first = session.advance(Sample(1.0, theta, wrench)).twist
    settled = make.added(
        weightless,
        make.effect("bushing_stiffness@joint_1", flexibility_percent=40.0),
        make.rest((20.0, -10.0), wrench.wrench),
    )[0]
    for t in (2.0, 5.0, 60.0):
        crept = session.advance(Sample(1.0 + t, theta, wrench)).twist - first
        assert np.allclose(crept, settled * (1.0 - np.exp(-t / 5.0)), rtol=1e-6, atol=1e-15)


def test_unloaded_creep_comes_back(weightless, make):
    effect = make.effect("creep@joint_1", delayed_percent=40.0, time_constant_s=1.0)
    theta, loaded = np.radians([20.0, -10.0]), Load(np.array([0.3, 0.2, -1.0, 0.0, 0.0, 0.0]))
    session = weightless.with_effects(effect).session()
    session.advance(Sample(0.0, theta, loaded))
    kept = session.advance(Sample(0.0, theta, Load(np.zeros(6)))).twist
    gone = session.advance(Sample(40.0, theta, Load(np.zeros(6)))).twist
    assert np.linalg.norm(kept) > 1e-8
    assert np.linalg.norm(gone) < 1e-9 * np.linalg.norm(kept)


def test_uncertain_width_of_a_gap_shows_after_a_motion(model, make):
    """Half the width's uncertainty behind, as a turn of the motor; only a memory can know it."""
    loaded = model.with_effects(make.effect("backlash@motor_1", width_mdeg=(40.0, 10.0)))
    session, plain = loaded.session(), model.session()
    for time, angle in ((0.0, 0.0), (1.0, 5.0), (2.0, 10.0)):
        sample = Sample(time, np.radians([angle, 5.0]), Load(np.zeros(6)))
        unsure, sure = session.advance(sample), plain.advance(sample)
    column = model.table.mechanism.jacobian(sure.configuration)[:, 0]
    added = unsure.covariance[3:, 3:] - sure.covariance[3:, 3:]
    expected = np.outer(column, column) * np.radians(5e-3) ** 2
    assert np.allclose(added, expected, atol=0.02 * np.abs(expected).max())
