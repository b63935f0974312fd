"""A pin in its play beside joints that rub: they hold it, and both are solved together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wrist_stiffness.model import batch, pin_rest, rubbing
from wrist_stiffness.model.block import Block, Load, Sample
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.evaluation import evaluate
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.pin_play import SMALL_FORCE, WALL
from wrist_stiffness.model.places import end_screws
from wrist_stiffness.model.rubbing import Bristles, dragged, slip
from wrist_stiffness.simulation.laws.bushing import play
from wrist_stiffness.simulation.laws.joint_friction import JointFriction
from wrist_stiffness.simulation.seat import Seat
from wrist_stiffness.simulation.wrist import TrueWrist

RADIAL = 1e-5

bends = arrays(float, 2, elements=st.floats(-3.0, 3.0))


@given(bends, st.floats(0.1, 2.0))
def test_a_bristle_that_is_dragged_lies_in_the_direction_of_its_slip(bent, budget):
    """Also where it is softer one way than the other."""
    force, feet = slip(Bristles(bent[None], np.array([[0.3, 1.7]]), np.array([budget])), [0.0, 0.0])
    slipped = feet[1] - feet[0]
    assert np.linalg.norm(force[0]) <= budget * (1.0 + 1e-12)
    if slipped.any():
        assert np.linalg.norm(force[0]) == pytest.approx(budget, rel=1e-9)
        assert force[0] @ slipped == pytest.approx(budget * np.linalg.norm(slipped), rel=1e-9)


@given(arrays(float, (6, 2), elements=st.floats(-3.0, 3.0)), st.floats(0.1, 2.0), st.booleans())
def test_bristles_slip_compiled_as_in_python(moved, budget, yields):
    bristles = Bristles(moved, np.tile([0.3, 1.7], (6, 1)), np.full(6, budget))
    give = np.tile([[0.4, 0.3], [0.3, 0.9]], (6, 1, 1)) if yields else None
    with pytest.MonkeyPatch.context() as plain:
        assert rubbing.native is not None
        compiled = slip(bristles, moved[0], give)
        plain.setattr(rubbing, "native", None)
        for one, other in zip(compiled, slip(bristles, moved[0], give), strict=True):
            assert one == pytest.approx(other, abs=1e-12)


@given(bends, st.floats(0.1, 2.0))
def test_what_bristles_hold_is_the_slope_of_an_energy(bent, budget):
    compliance, step = np.array([0.3, 1.7]), 1e-6
    near = bent + np.concatenate([np.zeros((1, 2)), step * np.eye(2), -step * np.eye(2)])
    energy, force, stiffness = dragged(near, np.tile(compliance, (5, 1)), np.full(5, budget))
    told = slip(Bristles(bent[None], compliance[None], np.array([budget])), [0.0, 0.0])[0]
    assert force[0] == pytest.approx(told[0], abs=1e-12)
    assert (energy[1:3] - energy[3:]) / (2.0 * step) == pytest.approx(force[0], abs=1e-6)
    if abs(np.linalg.norm(bent / compliance) - budget) > 1e-3:
        by_steps = (force[1:3] - force[3:]) / (2.0 * step)
        assert by_steps == pytest.approx(stiffness[0], abs=1e-4)
    assert np.linalg.eigvalsh(stiffness).min() > -1e-12


def ends_of(result, joint, number):
    """Return where a pin's ends are, and the forces that they carry, (n, 2, 2) each."""
    at, added = result.situation, result.contributions[number]
    ends = end_screws(at.table.geometry, joint)
    screw = at.at_home(joint, added.limb_1 if added.limb_2 is None else added.limb_2)
    moved = np.linalg.lstsq(ends.T, screw.T, rcond=None)[0].T
    force = at.at_home(joint, at.through_place(joint)) @ ends.T
    return moved.reshape(-1, 2, 2), force.reshape(-1, 2, 2)


def turned_load(make):
    """A load that turns round at rest, in ten steps."""
    share = np.linspace(1.0, -1.0, 11)
    load = share[:, None] * np.array([0.6, -0.5, -1.0, 0.0, 0.0, 0.0])
    return Block(np.arange(11.0), np.tile(np.radians([20.0, -10.0]), (11, 1)), load)


@pytest.mark.parametrize(("loose", "joint"), [("joint_4", "joint_2"), ("joint_1", "joint_3")])
def test_a_joint_that_sticks_holds_a_pin_off_its_wall(free_model, make, loose, joint):
    """When the load turns round at rest the pin crosses its play, but for what the joint holds."""

    def crossed(coefficient):
        rubbing = make.effect(
            f"joint_friction@{joint}", coefficient=coefficient, presliding_um=0.01
        )
        play = make.effect(f"joint_clearance@{loose}", clearance_um=2e6 * RADIAL)
        result = evaluate(free_model.with_effects(rubbing, play), turned_load(make), None)
        moved, _ = ends_of(result, loose, 1)
        return np.linalg.norm(moved[-1] - moved[0])

    assert crossed(0.0) > 2.5 * RADIAL
    assert crossed(1.5) < 0.2 * crossed(0.0)


@pytest.mark.parametrize(("loose", "joint"), [("joint_1", "joint_3"), ("joint_4", "joint_3")])
def test_a_held_pin_is_in_balance(model, make, monkeypatch, loose, joint):
    """What it carries in the end, friction and flanges included, is what its walls bear."""
    monkeypatch.setattr(pin_rest, "PASSES", 40)
    rubbing = make.effect(
        f"joint_friction@{joint}", coefficient=0.05, preload_N=0.2, bristle_um_per_N=50.0
    )
    play = make.effect(f"joint_clearance@{loose}", clearance_um=5.0)
    result = evaluate(model.with_effects(rubbing, play), turned_load(make), None)
    moved, force = ends_of(result, loose, 1)
    size = np.linalg.norm(moved, axis=-1, keepdims=True)
    centring = SMALL_FORCE / 2.5e-6
    wall = (centring + WALL * np.maximum(1.0 - 2.5e-6 / size, 0.0)) * moved
    assert np.allclose(force, wall, atol=1e-4)


@pytest.mark.parametrize("loose", ["1", "14"])
def test_pins_begin_where_another_model_rested_but_have_their_own_past(
    model, make, monkeypatch, loose
):
    """Bristles stand where they were dragged by this model's friction, not by the other one's."""
    monkeypatch.setattr(batch, "CHUNK", 10)
    play = [make.effect(f"joint_clearance@joint_{each}", clearance_um=5.0) for each in loose]
    little, much = (
        (make.effect("joint_friction@joint_3", coefficient=size, preload_N=0.5), *play)
        for size in (0.02, 0.3)
    )
    block = make.block(40)
    beside = model.batch_with(block, [little, much])[1]
    (alone,) = model.batch_with(block, [much])
    scale = np.abs(alone.twist).max(axis=0)
    assert np.all(np.abs(beside.twist - alone.twist) <= 1e-9 * scale)


@pytest.mark.parametrize("loose", ["1", "12"])
def test_two_joints_hold_pins_in_a_stream_as_in_a_recording(model, make, loose):
    """The passes have histories of their own, so samples one by one are the same."""
    effects = [
        make.effect(f"joint_friction@{joint}", coefficient=0.2, preload_N=0.5)
        for joint in ("joint_3", "joint_4")
    ]
    for joint in loose:
        effects.append(make.effect(f"joint_clearance@joint_{joint}", clearance_um=5.0))
    loaded = model.with_effects(*effects)
    block = make.block(40)
    at_once, session = loaded.batch(block).twist, loaded.session()
    for row, wanted in enumerate(at_once):
        found = session.advance(
            Sample(
                block.time[row],
                block.theta[row],
                Load(block.load[row]),
                temperatures={name: each[row] for name, each in block.temperatures.items()},
            )
        )
        # Rounding, ten thousand times as large beside walls that much stiffer than the flanges.
        assert np.all(np.abs(found.twist - wanted) <= 1e-11 * np.abs(at_once).max(axis=0))


def rubbing_load():
    """Four seconds: the load turns, both motors move and then rest."""
    time = 0.1 * np.arange(40.0)
    theta = np.radians(15.0) * np.stack([np.sin(time), np.cos(1.3 * time)], axis=1)
    theta[20:] = theta[20]
    load = np.stack([np.sin(3 * time), np.cos(2 * time), np.sin(4 * time), *np.zeros((3, 40))], 1)
    return Block(time, theta, load)


def true_twist(model, block, *laws):
    """What the virtual cell says, which shares no formula with the model."""
    state = TrueWrist(model.table, laws).run(block.time, block.theta, block.load, np.zeros(40))
    return state.equilibrium.twist


@pytest.mark.parametrize("joints", ["2", "3", "4", "23", "234"])
def test_friction_alone_is_the_truth_to_a_fiftieth(model, make, joints):
    """Flanges give way to what rubs, and one joint that rubs to another."""
    block, geometry = rubbing_load(), model.table.geometry
    told, laws = [], []
    for joint in (f"joint_{number}" for number in joints):
        numbers = {"coefficient": 0.15, "preload_N": 0.2, "presliding_um": 0.01}
        told.append(make.effect(f"joint_friction@{joint}", **numbers, bristle_um_per_N=50.0))
        laws.append(JointFriction(joint, Seat.of(geometry, joint), 0.15, 0.03, 2e4, 0.0))
    true = true_twist(model, block, *laws) - true_twist(model, block)
    found = model.with_effects(*told).batch(block).twist - model.batch(block).twist
    for part in (slice(0, 3), slice(3, 6)):
        off = np.linalg.norm((found - true)[:, part])
        assert off < 0.02 * np.linalg.norm(true[:, part])


@pytest.mark.parametrize("joints", ["23", "14", "34", "234", "12345"])
@pytest.mark.parametrize("clearance_um", [2.0, 20.0])
def test_pins_rest_together_as_in_truth(model, make, joints, clearance_um):
    """Each alone, not knowing of the others, they would be 10 to 70 % off."""
    block, geometry = rubbing_load(), model.table.geometry
    places = [f"joint_{number}" for number in joints]
    laws = [
        play(place, Seat.of(geometry, place), 1e-6 * clearance_um, SMALL_FORCE, "algebraic")
        for place in places
    ]
    told = [make.effect(f"joint_clearance@{place}", clearance_um=clearance_um) for place in places]
    true = true_twist(model, block, *laws) - true_twist(model, block)
    found = model.with_effects(*told).batch(block).twist - model.batch(block).twist
    for part in (slice(0, 3), slice(3, 6)):
        off = np.linalg.norm((found - true)[:, part])
        assert off < 0.01 * np.linalg.norm(true[:, part])


def test_a_second_pin_moves_the_first_also_beside_a_model_that_has_one(model, make):
    one, two = (make.effect(f"joint_clearance@joint_{n}", clearance_um=20.0) for n in "14")
    alone, both = model.batch_with(rubbing_load(), [(one,), (one, two)])
    wanted = model.with_effects(one, two).batch(rubbing_load()).twist
    assert np.abs(both.twist - wanted).max() < 1e-9 * np.abs(wanted).max()
    again = model.batch_with(rubbing_load(), [(one, two), (one,)])[1]
    assert np.abs(again.twist - alone.twist).max() < 1e-9 * np.abs(wanted).max()


class Stick(Law):
    """A user's own: holds back a slide as a spring does, and tells nothing of what rubs."""

    id = "stick"
    stage = "friction"
    places = ("joint_3",)
    own = ()

    def __init__(self):
        self.seen = []

    def advance(self, at, place, values, state):
        self.seen.append(at.slides[:, 1])
        force = -1e3 * at.slides[:, 1]
        return at.joint_push(place, force, 0.0 * force), None


def test_friction_of_ones_own_sees_what_others_do_but_not_its_own_force(model, make):
    """So a law that knows nothing of passes says in each of them what it says alone."""
    block = rubbing_load()

    def seen(*others):
        law = Stick()
        model.with_effects(*others, Effect(law, "joint_3")).batch(block)
        return law.seen

    bare = evaluate(model, block, None).situation.slides[:, 1]
    assert all(np.array_equal(each, bare) for each in seen())
    beside = seen(make.effect("joint_friction@joint_4", coefficient=0.15, preload_N=0.2))
    assert np.linalg.norm(beside[0] - bare) > 1e-3 * np.linalg.norm(bare)
    # The other one has found its rest beside it.
    assert np.linalg.norm(beside[-1] - beside[-2]) < 0.1 * np.linalg.norm(beside[-1] - bare)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loose", "clearance_um", "joint", "coefficient"),
    [("joint_4", 5.0, "joint_3", 0.05), ("joint_1", 5.0, "joint_4", 0.2)],
)
def test_play_beside_friction_is_nearly_the_truth(
    model, make, loose, clearance_um, joint, coefficient
):
    """With true values; what one does to the other is told to a fifth."""
    stiffness, block = 2e4, rubbing_load()
    known = {
        "play": make.effect(f"joint_clearance@{loose}", clearance_um=clearance_um),
        "friction": make.effect(
            f"joint_friction@{joint}",
            coefficient=coefficient,
            preload_N=0.2,
            presliding_um=0.01,
            bristle_um_per_N=1e6 / stiffness,
        ),
    }
    geometry = model.table.geometry

    def true(*names):
        laws = {
            "play": play(
                loose, Seat.of(geometry, loose), 1e-6 * clearance_um, SMALL_FORCE, "algebraic"
            ),
            "friction": JointFriction(
                joint, Seat.of(geometry, joint), coefficient, 0.2 * coefficient, stiffness, 0.0
            ),
        }
        return true_twist(model, block, *(laws[name] for name in names))

    def told(*names):
        return model.with_effects(*(known[name] for name in names)).batch(block).twist

    def beside(of):
        return (of("play", "friction") - of("play") - of("friction") + of())[:, 3:]

    assert np.abs(beside(true)).max() > 1e-5
    assert np.linalg.norm(beside(told) - beside(true)) < 0.2 * np.linalg.norm(beside(true))


def test_passes_find_each_other_where_samples_come_fast(model, make, monkeypatch):
    """A pin gives way to bristles; histories that do not know it creep from sample to sample."""
    time = 0.01 * np.arange(400.0)
    theta = np.radians(15.0) * np.stack([np.sin(time), np.cos(1.3 * time)], axis=1)
    load = np.stack([np.sin(3 * time), np.cos(2 * time), np.sin(4 * time), *np.zeros((3, 400))], 1)
    rubbing = make.effect(
        "joint_friction@joint_3",
        coefficient=0.05,
        preload_N=0.2,
        presliding_um=0.01,
        bristle_um_per_N=50.0,
    )
    play = make.effect("joint_clearance@joint_4", clearance_um=5.0)
    block = Block(time, theta, load)

    def twist(*effects):
        return model.with_effects(*effects).batch(block).twist[:, 3:]

    found = twist(rubbing, play)
    monkeypatch.setattr(pin_rest, "PASSES", 40)
    settled = twist(rubbing, play)
    beside = settled - twist(rubbing) - twist(play) + twist()
    assert np.linalg.norm(found - settled) < 0.05 * np.linalg.norm(beside)
