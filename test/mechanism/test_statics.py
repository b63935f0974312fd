"""The influence law against a full elastic model of springs and free pairs, ignorant of G."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.mechanism.components import (
    ELASTIC,
    PASSIVE_JOINTS,
    ElasticComponents,
    FlangeContact,
)
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.statics import (
    changed_operators,
    component_rotations,
    component_shares,
    contact_operators,
    platform_twist,
    slides,
    turned_flexibilities,
    weight_wrench,
)
from wrist_stiffness.mechanism.vectors import block_diagonal

# Frame on the motor side and on the platform side of each elastic component.
FRAMES = {
    "joint_1": ("ground", "pin_1"),
    "link_1": ("pin_1", "pin_2"),
    "joint_2": ("pin_2", "wall_2"),
    "joint_5": ("ground", "pin_5"),
    "link_2": ("pin_5", "pin_4"),
    "joint_4": ("pin_4", "wall_4"),
    "link_3": ("hub_4", "pin_3"),
    "joint_3": ("pin_3", "wall_3"),
}
FREE_PAIRS = {
    "joint_2": ("wall_2", "platform"),
    "joint_3": ("wall_3", "platform"),
    "joint_4": ("wall_4", "hub_4"),
}
MOVING = [
    "pin_1",
    "pin_2",
    "wall_2",
    "pin_5",
    "pin_4",
    "wall_4",
    "hub_4",
    "pin_3",
    "wall_3",
    "platform",
]
ROUNDING = 1e-9  # relative; the full model's condition number is about 1e6


def random_mechanism(rng):
    while True:
        a1, b0, c0, d0, a2, n0 = (v / np.linalg.norm(v) for v in rng.normal(size=(6, 3)))
        mechanism = Mechanism(a1, b0, c0, d0, a2, n0)
        if abs(mechanism.forward(np.zeros(2)).singularity) > 0.4:
            return mechanism


def random_components(rng, sectors=4):
    flexibility = []
    for _ in ELASTIC:
        root = rng.normal(size=(6, 6)) + 3.0 * np.eye(6)
        flexibility.append(1e-7 * root @ root.T)
    contact = {}
    for joint in PASSIVE_JOINTS:
        root = rng.normal(size=(sectors, sectors)) + 3.0 * np.eye(sectors)
        contact[joint] = FlangeContact(
            sign=np.where(np.arange(sectors) % 2, 1.0, -1.0),
            screw=1e-8 * rng.normal(size=(6, sectors)),
            approach=1e-7 * root @ root.T,
            weight_approach=1e-9 * rng.normal(size=(sectors, 3)),
            gap=1e-6 * rng.uniform(0.0, 2.0, sectors),
        )
    weights = 0.01 * rng.normal(size=(2, 8, 6, 3))
    return ElasticComponents(
        np.array(flexibility), weights[0], weights[1], 0.01 * rng.normal(size=(6, 3)), contact
    )


class FullModel:
    """Screws of all bodies and slides as unknowns; free pairs by Lagrange multipliers."""

    def __init__(self, mechanism, theta, components):
        self.configuration = mechanism.forward(theta)
        self.components = components
        flexibility = turned_flexibilities(self.configuration, components)
        stiffness = np.linalg.inv(flexibility)
        n = 6 * len(MOVING)
        self.k = np.zeros((n, n))
        self.load = np.zeros(n)
        self.stiffness = dict(zip(ELASTIC, stiffness, strict=True))
        for name, (near, far) in FRAMES.items():
            difference = self.row(far) - self.row(near)
            self.k += difference.T @ self.stiffness[name] @ difference
        axes = {
            "joint_2": self.configuration.b,
            "joint_3": self.configuration.c,
            "joint_4": self.configuration.d,
        }
        ties = []
        for joint, (wall, hub) in FREE_PAIRS.items():
            across = np.linalg.svd(axes[joint][None])[2][1:]
            for half in (0, 3):
                directions = np.zeros((2, 6))
                directions[:, half : half + 3] = across
                ties.append(directions @ (self.row(hub) - self.row(wall)))
        self.ties = np.concatenate(ties)
        self.axes = axes

    def row(self, frame):
        out = np.zeros((6, 6 * len(MOVING)))
        if frame != "ground":
            i = MOVING.index(frame)
            out[:, 6 * i : 6 * i + 6] = np.eye(6)
        return out

    def add_load(self, frame, wrench):
        self.load += self.row(frame).T @ wrench

    def add_screw(self, name, screw):
        near, far = FRAMES[name]
        self.load += (self.row(far) - self.row(near)).T @ self.stiffness[name] @ screw

    def add_weights(self, gravity):
        rotations = component_rotations(self.configuration)
        for i, name in enumerate(ELASTIC):
            turn = block_diagonal(rotations[i])
            field = rotations[i].T @ gravity
            for frame, weights in zip(
                FRAMES[name],
                (self.components.weight_motor_side, self.components.weight_platform_side),
                strict=True,
            ):
                if frame != "ground":
                    self.add_load(frame, turn @ weights[i] @ field)
        platform = self.configuration.platform
        self.add_load(
            "platform",
            block_diagonal(platform) @ self.components.platform_weight @ platform.T @ gravity,
        )

    def solve(self):
        m = len(self.ties)
        matrix = np.block([[self.k, self.ties.T], [self.ties, np.zeros((m, m))]])
        size = np.sqrt(np.max(np.diagonal(self.k)))
        scale = np.concatenate([np.full(len(self.k), 1.0 / size), np.full(m, size)])
        u = scale * np.linalg.solve(
            scale[:, None] * matrix * scale, scale * np.concatenate([self.load, np.zeros(m)])
        )
        self.u = u[: len(self.k)]
        return self.screw("platform")

    def screw(self, frame):
        return self.row(frame) @ self.u

    def slide(self, joint):
        wall, hub = FREE_PAIRS[joint]
        return self.axes[joint] @ (self.screw(hub) - self.screw(wall))[:3]


def close(actual, wanted):
    return np.allclose(actual, wanted, rtol=ROUNDING, atol=ROUNDING * np.max(np.abs(wanted)))


@pytest.fixture(params=range(12))
def case(request):
    rng = np.random.default_rng(request.param)
    mechanism = random_mechanism(rng)
    theta = rng.uniform(-0.3, 0.3, 2)
    while not mechanism.reachable(theta) or abs(mechanism.forward(theta).singularity) < 0.2:
        theta = 0.5 * theta
    return rng, mechanism, theta, random_components(rng)


def test_compliance_equals_full_elastic_model(case):
    rng, mechanism, theta, components = case
    load = rng.normal(size=6)
    full = FullModel(mechanism, theta, components)
    full.add_load("platform", load)
    configuration = mechanism.forward(theta)
    compliance = component_shares(configuration, components).sum(axis=0)
    assert close(compliance @ load, full.solve())


def test_screws_reach_platform_and_slides_as_in_full_model(case):
    rng, mechanism, theta, components = case
    configuration = mechanism.forward(theta)
    projectors = influence(configuration)
    screws = 1e-5 * rng.normal(size=(8, 6))
    full = FullModel(mechanism, theta, components)
    for name, screw in zip(ELASTIC, screws, strict=True):
        full.add_screw(name, screw)
    assert close(platform_twist(projectors, screws), full.solve())
    assert close(slides(projectors, screws), [full.slide(joint) for joint in PASSIVE_JOINTS])


def test_own_weight_equals_full_model(case):
    rng, mechanism, theta, components = case
    gravity = rng.normal(size=3) * 5.0
    full = FullModel(mechanism, theta, components)
    full.add_weights(gravity)
    configuration = mechanism.forward(theta)
    wrench = weight_wrench(configuration, components, gravity, influence(configuration))
    screw = (turned_flexibilities(configuration, components) @ wrench[..., None])[..., 0]
    assert close(platform_twist(influence(configuration), screw), full.solve())
    wanted = [
        full.screw(far) - (0.0 if near == "ground" else full.screw(near))
        for near, far in FRAMES.values()
    ]
    order = [ELASTIC.index(name) for name in FRAMES]
    assert close(screw[order], np.array(wanted))


def test_virtual_work_jacobian_is_the_same_law(case):
    _, mechanism, theta, _ = case
    configuration = mechanism.forward(theta)
    jacobian = mechanism.jacobian(configuration)
    projectors = influence(configuration)
    assert np.allclose(projectors.limb_1 @ mechanism.a1, jacobian[:, 0], atol=1e-12)
    assert np.allclose(projectors.limb_2 @ mechanism.a2, jacobian[:, 1], atol=1e-12)


def test_shares_add_up_and_are_positive(case):
    rng, mechanism, theta, components = case
    configuration = mechanism.forward(theta)
    shares = component_shares(configuration, components)
    load = rng.normal(size=6)
    energy = np.einsum("i,kij,j->k", load, shares, load)
    assert np.all(energy > -1e-18)
    compliance = contact_operators(configuration, components, np.zeros(3)).compliance
    assert energy.sum() == pytest.approx(load @ compliance @ load, rel=1e-12)


def test_contact_operators_equal_full_model_with_forced_contact(case):
    """Contact forces put on walls and hubs of the full model open the gaps by A and move by B."""
    rng, mechanism, theta, components = case
    gravity = rng.normal(size=3) * 5.0
    configuration = mechanism.forward(theta)
    operators = contact_operators(configuration, components, gravity)
    sectors = len(operators.gap)
    force, load = rng.uniform(0.0, 1.0, sectors), rng.normal(size=6)
    screws = 1e-6 * rng.normal(size=(8, 6))
    twist = (
        operators.compliance @ load
        + operators.weight_twist
        + platform_twist(influence(configuration), screws)
        + operators.force_twist @ force
    )
    gap = (
        operators.gap
        + operators.force_twist.T @ load
        + np.einsum("mki,ki->m", operators.screw_gap, screws)
        + operators.approach @ force
    )

    full = FullModel(mechanism, theta, components)
    full.add_load("platform", load)
    full.add_weights(gravity)
    for name, screw in zip(ELASTIC, screws, strict=True):
        full.add_screw(name, screw)
    start, rotations = 0, component_rotations(configuration)
    per_joint = {}
    for joint in PASSIVE_JOINTS:
        part = components.contact[joint]
        rows = slice(start, start + len(part.gap))
        turn = rotations[ELASTIC.index(joint)]
        push = np.zeros(6)
        push[:3] = full.axes[joint] * (part.sign @ force[rows])
        wall, hub = FREE_PAIRS[joint]
        full.add_load(hub, push)
        full.add_load(wall, -push)
        full.add_screw(joint, block_diagonal(turn) @ part.screw @ force[rows])
        per_joint[joint] = (part, rows, turn)
        start += len(part.gap)
    assert close(twist, full.solve())
    for joint, (part, rows, turn) in per_joint.items():
        near, far = FRAMES[joint]
        i = ELASTIC.index(joint)
        bent = (
            full.screw(far)
            - full.screw(near)
            - screws[i]
            - block_diagonal(turn) @ part.screw @ force[rows]
        )
        wrench = full.stiffness[joint] @ bent
        wanted = (
            part.gap
            + part.sign * full.slide(joint)
            + (block_diagonal(turn) @ part.screw).T @ wrench
            + part.approach @ force[rows]
            + part.weight_approach @ (turn.T @ gravity)
        )
        assert close(gap[rows], wanted)


def test_stiff_closed_flanges_turn_cylinders_into_revolutes(case):
    """Gaps closed on both sides by nearly rigid flanges leave no slide."""
    rng, mechanism, theta, components = case
    stiff = {
        joint: FlangeContact(
            np.array([1.0, -1.0]),
            np.zeros((6, 2)),
            1e-14 * np.eye(2),
            np.zeros((2, 3)),
            np.zeros(2),
        )
        for joint in PASSIVE_JOINTS
    }
    components = ElasticComponents(
        components.flexibility,
        *(0.0 * components.weight_motor_side,) * 2,
        0.0 * components.platform_weight,
        stiff,
    )
    operators = contact_operators(mechanism.forward(theta), components, np.zeros(3))
    load = rng.normal(size=6)
    force, _ = solve_contact(operators.approach, operators.force_twist.T @ load)
    full = FullModel(mechanism, theta, components)
    for joint, (wall, hub) in FREE_PAIRS.items():
        locked = np.zeros(6)
        locked[:3] = full.axes[joint]
        full.ties = np.vstack([full.ties, locked @ (full.row(hub) - full.row(wall))])
    full.add_load("platform", load)
    twist = operators.compliance @ load + operators.force_twist @ force
    wanted = full.solve()
    assert np.allclose(twist, wanted, rtol=1e-5, atol=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize(("name", "factor"), [("link_2", 3.0), ("joint_3", 3.0), ("joint_3", 1.0)])
def test_operators_after_a_change_of_one_part_are_those_made_anew(case, name, factor):
    """A factor of 1: nothing but the flanges changes."""
    rng, mechanism, theta, components = case
    gravity = rng.normal(size=3) * 5.0
    configuration = mechanism.forward(theta)
    flexibility, contact = components.flexibility.copy(), dict(components.contact)
    flexibility[ELASTIC.index(name)] *= factor
    if name in contact:
        own = contact[name]
        contact[name] = replace(
            own,
            screw=3.0 * own.screw,
            approach=3.0 * own.approach,
            weight_approach=3.0 * own.weight_approach,
            gap=own.gap + 1e-5,
        )
    after = replace(components, flexibility=flexibility, contact=contact)
    before = contact_operators(configuration, components, gravity)
    weight = weight_wrench(configuration, components, gravity, influence(configuration))
    found = changed_operators(before, configuration, components, after, gravity, weight)
    wanted = contact_operators(configuration, after, gravity)
    for field in ("compliance", "force_twist", "approach", "gap", "weight_twist", "screw_gap"):
        assert close(getattr(found, field), getattr(wanted, field))
    assert not close(found.approach, before.approach)
