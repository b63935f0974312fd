"""Laws on elastic parts and springs: energy, limits, and each other."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, LINKS
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.statics import component_shares
from wrist_stiffness.model.block import Load
from wrist_stiffness.model.effects.stiffness import COUPLINGS, KEYS, FrameCompliance
from wrist_stiffness.model.evaluation import evaluate
from wrist_stiffness.model.parameters import si_factor

POSE = (20.0, -10.0)
LOAD = (0.4, -0.3, -1.0, 0.01, -0.02, 0.005)


@pytest.mark.parametrize(
    "name", [*(f"link_stiffness@{k}" for k in LINKS), *(f"bushing_stiffness@{k}" for k in JOINTS)]
)
def test_softer_part_adds_its_share_of_the_compliance(weightless, make, name):
    block = make.rest(POSE, LOAD)
    k = ELASTIC.index(name.split("@")[1])
    configuration = weightless.table.mechanism.forward(block.theta[0])
    share = component_shares(configuration, weightless.table.components)[k] @ LOAD
    extra = make.added(weightless, make.effect(name, flexibility_percent=30.0), block)[0]
    assert np.allclose(extra, 0.3 * share, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("joint", ["joint_2", "joint_3", "joint_4"])
def test_softer_bushing_under_closed_flanges_is_a_softer_table(model, make, joint):
    """Contact included: all that the bushing's own material decides is 1.8 times as large."""
    effects = [
        make.effect(f"bushing_stiffness@{joint}", flexibility_percent=80.0),
        # Pressed shut, so that the flange carries whatever its gap was.
        make.effect(f"flange_contact@{joint}", gap_um=-20.0),
    ]
    table = model.table
    flexibility = table.components.flexibility.copy()
    flexibility[ELASTIC.index(joint)] *= 1.8
    old = table.components.contact[joint]
    flange = replace(
        old,
        screw=1.8 * old.screw,
        approach=1.8 * old.approach,
        weight_approach=1.8 * old.weight_approach,
    )
    contact = {**table.components.contact, joint: flange}
    parts = replace(table.components, flexibility=flexibility, contact=contact)
    softer = replace(model, table=replace(table, components=parts), effects=(effects[1],))
    block = make.rest(POSE, LOAD)
    found = evaluate(model.with_effects(*effects), block, None)
    assert found.active[0, table.components.sectors.component == ELASTIC.index(joint)].any()
    assert np.allclose(found.twist, softer.batch(block).twist, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("joint", JOINTS)
def test_settled_creep_and_warm_softening_are_lost_stiffness(weightless, make, joint):
    """Without contact a delayed, warm or scaled bushing is one and the same."""
    block = make.rest(POSE, LOAD, temperatures={joint: np.array([30.0])})
    softer = make.added(
        weightless, make.effect(f"bushing_stiffness@{joint}", flexibility_percent=20.0), block
    )
    for name, key, value in (
        ("creep", "delayed_percent", 20.0),
        ("thermal_softening", "softening_percent_per_K", 2.0),
    ):
        assert np.allclose(
            make.added(weightless, make.effect(f"{name}@{joint}", **{key: value}), block),
            softer,
            rtol=1e-9,
            atol=1e-18,
        )


def test_hardening_saturates_at_a_rigid_bushing(weightless, make):
    effect = make.effect("bushing_hardening@joint_4", hardening_percent_per_N=10.0)
    k = ELASTIC.index("joint_4")
    before = 0.0
    for size in (0.5, 1.0, 2.0):
        block = make.rest(POSE, size * np.array(LOAD))
        missing = -make.added(weightless, effect, block)[0]
        configuration = weightless.table.mechanism.forward(block.theta[0])
        share = component_shares(configuration, weightless.table.components)[k] @ block.load[0]
        g = influence(configuration).of_components()[k]
        force = np.linalg.norm(g.T @ block.load[0, :3])
        part = float(missing @ share / (share @ share))
        assert part == pytest.approx(0.1 * force / (1.0 + 0.1 * force), rel=1e-9)
        assert before < part < 1.0
        before = part


@pytest.mark.parametrize("motor", [1, 2])
def test_drive_winds_up_by_its_torque(weightless, make, motor):
    """The torque of a motor is the load's work on a turn of it: a column of J."""
    block = make.rest(POSE, LOAD)
    compliance = np.radians(0.5)
    effect = make.effect(f"drive_compliance@motor_{motor}", compliance_mdeg_per_Nm=500.0)
    mechanism = weightless.table.mechanism
    column = mechanism.jacobian(mechanism.forward(block.theta[0]))[:, motor - 1]
    torque = column @ LOAD[3:]
    twist = make.added(weightless, effect, block)[0]
    assert np.allclose(twist[3:], column * compliance * torque, rtol=1e-9)
    assert np.allclose(twist[:3], 0.0, atol=1e-18)


@pytest.mark.parametrize(
    "name",
    [
        "mount_compliance@motor_1",
        "mount_compliance@motor_2",
        "frame_compliance@frame",
        "platform_compliance@platform",
    ],
)
def test_springs_store_energy_and_are_reciprocal(weightless, make, name):
    """Each adds a symmetric positive semi-definite compliance, whatever its axes and centre."""
    rng = np.random.default_rng(3)
    root = np.sqrt([1e-6] * 3 + [1e-3] * 3)[:, None] * rng.normal(size=(6, 6))
    own = root @ root.T
    places = {key: (i, i) for i, key in enumerate(KEYS)} | COUPLINGS
    effect = make.effect(name)
    effect = effect.with_values({key: own[at] / si_factor(key) for key, at in places.items()})
    assert len(places) == len(effect.parameters) == 21
    columns = [
        make.added(weightless, effect, make.rest(POSE, 0.1 * unit))[0] / 0.1 for unit in np.eye(6)
    ]
    compliance = np.stack(columns, axis=1)
    scale = np.abs(compliance).max()
    assert np.allclose(compliance, compliance.T, atol=1e-9 * scale)
    assert np.linalg.eigvalsh(compliance).min() > -1e-9 * scale


def test_a_spring_that_gives_back_more_than_it_got_cannot_be():
    """Any spring of energies above 0 can, however its axes are turned; any other cannot."""
    rng = np.random.default_rng(4)
    root = np.sqrt([1e-6] * 3 + [1e-3] * 3)[:, None] * np.linalg.qr(rng.normal(size=(40, 6, 6)))[0]
    soft = rng.uniform(0.1, 3.0, size=(40, 6))
    soft[20:, 0] = -0.1
    own = np.einsum("nij,nj,nkj->nik", root, soft, root)
    places = {key: (i, i) for i, key in enumerate(KEYS)} | COUPLINGS
    can = FrameCompliance().possible({key: own[:, i, j] for key, (i, j) in places.items()})
    assert can.tolist() == [True] * 20 + [False] * 20


def test_frame_gives_under_all_that_hangs_on_it(free_model, make):
    """All weights but those of the motor bushings' halves in the frame, and the load."""
    effect = make.effect(
        "frame_compliance@frame", x_um_per_N=3.0, z_um_per_N=2.0, turn_y_mdeg_per_Nm=90.0
    )
    parts = free_model.table.components
    hanging = parts.weight_motor_side + parts.weight_platform_side
    for joint in ("joint_1", "joint_5"):
        hanging[ELASTIC.index(joint)] = parts.weight_platform_side[ELASTIC.index(joint)]
    weights = hanging.sum(axis=0) + parts.platform_weight
    total = weights @ free_model.table.geometry.gravity + np.array(LOAD)
    twist = make.added(free_model, effect, make.rest((0.0, 0.0), LOAD))[0]
    expected = [3e-6 * total[0], 0.0, 2e-6 * total[2], 0.0, np.radians(0.09) * total[4], 0.0]
    assert np.allclose(twist, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("motor", "joint"), [(1, "joint_1"), (2, "joint_5")])
def test_bracket_gives_at_the_bushing(weightless, make, motor, joint):
    """Deflection and turn at the bushing's centre, seen from O by the velocity of a rigid body."""
    geometry = weightless.table.geometry
    centre = geometry.bushings[joint].radius * geometry.axes[joint]
    effect = make.effect(
        f"mount_compliance@motor_{motor}", y_um_per_N=2.0, turn_z_mdeg_per_Nm=300.0
    )
    g = influence(weightless.table.mechanism.forward(np.radians(POSE)))
    carry = (g.limb_1, g.limb_2)[motor - 1]
    force, moment = carry.T @ LOAD[:3], carry.T @ LOAD[3:]
    turn = np.array([0.0, 0.0, np.radians(0.3) * (moment - np.cross(centre, force))[2]])
    shift = np.array([0.0, 2e-6 * force[1], 0.0]) - np.cross(turn, centre)
    twist = make.added(weightless, effect, make.rest(POSE, LOAD))[0]
    expected = np.concatenate([carry @ shift, carry @ turn])
    assert np.allclose(twist, expected, rtol=1e-8, atol=1e-16)


def test_platform_spring_gives_at_its_centre(free_model, make):
    """A force through the plate's centre does not turn a spring there."""
    centre = free_model.table.geometry.platform.centre
    force = np.array([1.0, 0.5, 0.0])
    effect = make.effect(
        "platform_compliance@platform", x_um_per_N=1.0, y_um_per_N=1.0, turn_x_mdeg_per_Nm=100.0
    )
    through = make.rest((0.0, 0.0), [*force, *np.cross(centre, force)])
    twist = make.added(free_model, effect, through)[0]
    assert np.allclose(twist, [1e-6, 0.5e-6, 0.0, 0.0, 0.0, 0.0], atol=1e-15)
    at_centre = make.added(free_model, effect, make.rest((0.0, 0.0), force))[0]
    assert at_centre[3] == pytest.approx(np.radians(0.1) * np.cross(-centre, force)[0])


def test_wider_flange_gap_opens_the_contact(model, make):
    """Far open flanges are no flanges; a forced-shut gap pushes."""
    block = make.rest(POSE, LOAD)
    wide = [make.effect(f"flange_contact@joint_{j}", gap_um=900.0) for j in (2, 3, 4)]
    parts = replace(model.table.components, contact={})
    bare = replace(model, table=replace(model.table, components=parts))
    assert np.allclose(
        model.with_effects(*wide).batch(block).twist, bare.batch(block).twist, rtol=1e-9
    )
    shut = make.effect("flange_contact@joint_2", gap_um=-20.0)
    assert model.with_effects(shut).predict(block.theta[0], Load(np.array(LOAD))).active.any()


def test_contact_is_solved_with_everything_in_it(model, make):
    """No sector overlaps or pulls, and none pushes across an open gap, with all effects at once."""
    loaded = model.with_effects(
        make.effect("axis_misalignment@joint_1", shift_u_um=30.0, tilt_v_mdeg=40.0),
        make.effect("joint_clearance@joint_3", clearance_um=15.0),
        make.effect("thermal_expansion@link_2"),
        make.effect("gravity@link_3", mass_g=40.0, x_mm=20.0),
        make.effect("joint_friction@joint_2", coefficient=0.2, preload_N=2.0),
        make.effect("flange_contact@joint_4", gap_um=-10.0),
        make.effect("load_bias@load_sensor", fx_N=0.2),
    )
    block = make.block(temperatures={"link_2": np.linspace(20.0, 40.0, 60)})
    result = evaluate(loaded, block, None)
    gap = result.situation.free[1]
    force = result.situation.contact_force
    opening = gap + (result.situation.operators.approach @ force[..., None])[..., 0]
    scale = np.abs(gap).max()
    assert opening.min() > -1e-9 * scale
    assert force.min() >= 0.0
    assert np.abs(force * opening).max() < 1e-9 * scale * force.max()
    assert result.active.any()
    assert not result.active.all()
