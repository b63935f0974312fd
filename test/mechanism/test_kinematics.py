"""Kinematics against acrod, finite differences, the orthogonal closed form and its own inverse."""

import numpy as np
import pytest
from acrod.jacobian import Jacobian
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.kinematics import Mechanism

X, Y, Z = np.eye(3)
ROUNDING = 1e-12
"""The acceptance limit of the project; double precision times amplifiers of 1/|D| up to 5."""
LEAST_D = 0.2


def direction(polar_deg, azimuth_deg):
    polar, azimuth = np.radians([polar_deg, azimuth_deg])
    return np.array(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    )


def mirrored(mechanism):
    """The same link angles, home c on the other side of the plane of b0 and d0."""
    w = np.cross(mechanism.b0, mechanism.d0)
    w /= np.linalg.norm(w)
    c0 = mechanism.c0 - 2.0 * (mechanism.c0 @ w) * w
    return Mechanism(mechanism.a1, mechanism.b0, c0, mechanism.d0, mechanism.a2, mechanism.n0)


C_HORIZONTAL = Mechanism(X, Y, X, Z, Y, Z)
C_ALONG_NORMAL = Mechanism(X, Y, Z, X, Y, Z)
SKEWED = [
    Mechanism(X, direction(80, 80), direction(75, 10), direction(10, 30), direction(85, 95), Z),
    Mechanism(X, direction(70, 110), direction(60, -15), direction(35, 200), direction(100, 70), Z),
    Mechanism(
        direction(95, 5),
        direction(65, 75),
        direction(125, -20),
        direction(25, -60),
        direction(80, 120),
        direction(12, 50),
    ),
]
MECHANISMS = {
    f"{name}, {mode}": mechanism
    for name, home in {
        "c horizontal": C_HORIZONTAL,
        "c along normal": C_ALONG_NORMAL,
        "skewed 1": SKEWED[0],
        "skewed 2": SKEWED[1],
        "skewed 3": SKEWED[2],
    }.items()
    for mode, mechanism in {"as given": home, "mirrored": mirrored(home)}.items()
}


@pytest.fixture(params=list(MECHANISMS))
def mechanism(request):
    return MECHANISMS[request.param]


def poses(mechanism, count=25, seed=1):
    """Random poses that close and keep away from the singularity, over the whole turn."""
    theta = np.random.default_rng(seed).uniform(-np.pi, np.pi, (4000, 2))
    theta = theta[mechanism.closure_radicand(theta) > LEAST_D**2]
    assert len(theta) >= count
    return theta[:count]


# acrod: bodies frame, link_1, link_2, link_3, platform; 1 = revolute (actuated below the
# diagonal), 3 = cylindrical.
@pytest.fixture(scope="module")
def acrod():
    model = Jacobian(
        np.array(
            [
                [9, 1, 1, 0, 0],
                [1, 9, 0, 0, 3],
                [1, 0, 9, 3, 0],
                [0, 0, 0, 9, 3],
                [0, 0, 0, 0, 9],
            ]
        )
    )
    model.process_functions()
    return model


ACROD_JOINTS = {
    "1_2": "joint_1",
    "1_3": "joint_5",
    "2_5": "joint_2",
    "3_4": "joint_4",
    "4_5": "joint_3",
}


def acrod_rates(model, axes, points):
    """Platform twist at O and rates of the passive joints for unit motor rates.

    Returns
    -------
    twist : (6, 2)
    turns, slides : (3, 2)
        Of joint_2, joint_3, joint_4 in acrod's sense: body of the higher number against the lower.
    """
    values = []
    for name in model.parameters:
        kind, joint = name.split("_", 1)
        if kind == "r":
            joint, coordinate = joint.rsplit("_", 1)
            values.append(points[ACROD_JOINTS[joint]]["xyz".index(coordinate)])
        else:
            x, y, z = axes[ACROD_JOINTS[joint]]
            values.append(np.arctan2(np.hypot(x, y), z) if kind == "beta" else np.arctan2(y, x))
    j_active, j_passive, a_active, a_passive = (
        np.array(f(np.zeros(3), values), dtype=float)
        for f in (model.Ja_func, model.Jp_func, model.Aa_func, model.Ap_func)
    )
    assert model.active_joint_velocities == ["thd_1_2", "thd_1_3"]
    passive = -np.linalg.solve(a_passive, a_active)
    row = {name: passive[i] for i, name in enumerate(model.passive_joint_velocities)}
    turns = np.array([row["thd_2_5"], row["thd_4_5"], row["thd_3_4"]])
    slides = np.array([row["dd_2_5"], row["dd_4_5"], row["dd_3_4"]])
    return j_active + j_passive @ passive, turns, slides


def axes_of(mechanism, configuration):
    return {
        "joint_1": mechanism.a1,
        "joint_2": configuration.b,
        "joint_3": configuration.c,
        "joint_4": configuration.d,
        "joint_5": mechanism.a2,
    }


def test_jacobian_and_passive_turns_equal_acrod(mechanism, acrod):
    theta = poses(mechanism)
    jacobians = mechanism.jacobian(mechanism.forward(theta))
    points = dict.fromkeys(ACROD_JOINTS.values(), np.zeros(3))
    for pose, jacobian in zip(theta, jacobians, strict=True):
        configuration = mechanism.forward(pose)
        twist, turns, slides = acrod_rates(acrod, axes_of(mechanism, configuration), points)
        np.testing.assert_allclose(twist[3:], jacobian, atol=ROUNDING)
        np.testing.assert_allclose(twist[:3], 0.0, atol=ROUNDING)
        rows = influence(configuration).slides_limb_1
        wanted = np.stack([rows @ mechanism.a1, -rows @ mechanism.a2], axis=1)
        np.testing.assert_allclose(turns, wanted, atol=ROUNDING)
        np.testing.assert_allclose(slides, 0.0, atol=ROUNDING)


def test_displaced_motor_axes_move_platform_and_slides_as_in_acrod(mechanism, acrod):
    """A motor axis that misses O is a screw with a translation: G and the slides carry it."""
    rng = np.random.default_rng(2)
    numbers = [ELASTIC.index("joint_1"), ELASTIC.index("joint_5")]
    for pose in poses(mechanism, 10, seed=3):
        configuration = mechanism.forward(pose)
        projectors = influence(configuration)
        points = {joint: np.zeros(3) for joint in ACROD_JOINTS.values()}
        points["joint_1"], points["joint_5"] = rng.normal(size=(2, 3))
        twist, turns, slides = acrod_rates(acrod, axes_of(mechanism, configuration), points)
        motors = np.stack([mechanism.a1, mechanism.a2])
        shifts = np.cross(motors, -np.stack([points["joint_1"], points["joint_5"]]))
        g, rows = projectors.of_components()[numbers], projectors.slides()[numbers]
        np.testing.assert_allclose(twist[:3].T, (g @ shifts[..., None])[..., 0], atol=1e-11)
        np.testing.assert_allclose(twist[3:].T, (g @ motors[..., None])[..., 0], atol=ROUNDING)
        np.testing.assert_allclose(slides.T, (rows @ shifts[..., None])[..., 0], atol=1e-11)
        np.testing.assert_allclose(turns.T, (rows @ motors[..., None])[..., 0], atol=ROUNDING)


def test_bodies_keep_their_axes_at_their_link_angles(mechanism):
    q = mechanism.forward(poses(mechanism, 200))
    rotations = np.stack(list(q.rotations.values()), axis=-3)
    identity = rotations @ np.swapaxes(rotations, -1, -2)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=ROUNDING)
    for body, home, axis in (
        ("link_1", mechanism.a1, mechanism.a1),
        ("link_1", mechanism.b0, q.b),
        ("link_2", mechanism.a2, mechanism.a2),
        ("link_2", mechanism.d0, q.d),
        ("link_3", mechanism.d0, q.d),
        ("link_3", mechanism.c0, q.c),
        ("platform", mechanism.b0, q.b),
        ("platform", mechanism.c0, q.c),
    ):
        turned = q.rotations[body] @ home
        np.testing.assert_allclose(turned, np.broadcast_to(axis, turned.shape), atol=ROUNDING)


def test_motors_turn_right_handed_about_their_axes(mechanism):
    quarter = np.pi / 2.0
    for body, axis, theta in (
        ("link_1", mechanism.a1, (0.01, 0.0)),
        ("link_2", mechanism.a2, (0.0, 0.01)),
    ):
        rotation = mechanism.forward(np.array(theta)).rotations[body]
        across = np.cross(axis, Z + 0.3 * X)
        across /= np.linalg.norm(across)
        wanted = np.cos(0.01) * across + np.cos(quarter - 0.01) * np.cross(axis, across)
        np.testing.assert_allclose(rotation @ across, wanted, atol=ROUNDING)


def test_singularity_and_dual_basis_follow_from_the_axes(mechanism):
    q = mechanism.forward(poses(mechanism, 200))
    triple = np.einsum("ni,ni->n", q.b, np.cross(q.d, q.c))
    np.testing.assert_allclose(q.singularity, triple, atol=ROUNDING)
    assert np.all(np.sign(q.singularity) == mechanism.assembly_mode)
    products = q.dual @ np.stack([q.b, q.c, q.d], axis=-1)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=ROUNDING)


def test_jacobian_equals_finite_differences(mechanism):
    theta = poses(mechanism, 200)
    q = mechanism.forward(theta)
    jacobian = mechanism.jacobian(q)
    # Fourth-order central differences: h^4 and eps/h leave 2e-11 for |D| > 0.2.
    h = 1e-4
    for motor in range(2):
        step = h * np.eye(2)[motor]
        rate = sum(
            weight * mechanism.forward(theta + n * step).platform
            for n, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
        )
        spin = rate / h @ np.swapaxes(q.platform, -1, -2)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
        np.testing.assert_allclose(jacobian[:, :, motor], omega, atol=1e-9)


def test_platform_alone_is_that_of_all_bodies(mechanism):
    theta = poses(mechanism, 6).reshape(2, 3, 2)
    platform = mechanism.forward(theta).platform
    np.testing.assert_allclose(mechanism.platform_rotation(theta), platform, atol=ROUNDING)
    np.testing.assert_allclose(
        mechanism.platform_rotation(theta[1, 2]), platform[1, 2], atol=ROUNDING
    )


def test_single_pose_equals_stack_and_repeats_to_the_bit(mechanism):
    theta = poses(mechanism, 6).reshape(2, 3, 2)
    stack = mechanism.forward(theta)
    for place in np.ndindex(2, 3):
        one, again = mechanism.forward(theta[place]), mechanism.forward(theta[place])
        assert np.array_equal(one.bodies, again.bodies)
        for name in ("b", "c", "d", "singularity", "dual", "bodies"):
            np.testing.assert_allclose(
                getattr(one, name), getattr(stack, name)[place], atol=ROUNDING
            )


@given(st.sampled_from(sorted(MECHANISMS)), st.integers(0, 10_000))
def test_all_inverse_solutions_lead_back_to_the_normal(name, seed):
    mechanism = MECHANISMS[name]
    theta = poses(mechanism, 1, seed)[0]
    normal = mechanism.normal(mechanism.forward(theta))
    solutions = mechanism.inverse(3.0 * normal)
    assert solutions.shape == (4, 2)
    found = solutions[np.isfinite(solutions[:, 0])]
    # Near the border of a cone a normal's rounding grows to its square root in the angles; forward
    # kinematics takes that back.
    normals = mechanism.normal(mechanism.forward(found))
    np.testing.assert_allclose(normals, np.broadcast_to(normal, normals.shape), atol=1e-7)
    gap = np.abs(np.angle(np.exp(1j * (found - theta))))
    assert np.min(gap.max(axis=-1)) < 1e-6
    np.testing.assert_allclose(mechanism.inverse_near(normal, theta), theta, atol=1e-6)


def test_inverse_gives_four_solutions_split_over_both_assembly_modes():
    """Both modes together have the two b's times two d's of a normal."""
    normal = C_HORIZONTAL.normal(C_HORIZONTAL.forward(np.array([0.3, -0.4])))
    given_, other = (m.inverse(normal) for m in (C_HORIZONTAL, mirrored_assembly(C_HORIZONTAL)))
    exists = np.isfinite(given_[:, 0])
    assert 1 <= exists.sum() < 4
    assert np.array_equal(exists, ~np.isfinite(other[:, 0]))


def mirrored_assembly(mechanism):
    """A wrist of which `inverse` must give exactly the solutions that it must not give of this."""

    class OtherMode(Mechanism):
        assembly_mode = -mechanism.assembly_mode

    return OtherMode(
        mechanism.a1, mechanism.b0, mechanism.c0, mechanism.d0, mechanism.a2, mechanism.n0
    )


def test_orthogonal_closed_form():
    theta_1, theta_2 = theta = np.random.default_rng(4).uniform(-1.4, 1.4, (2, 300))
    q = C_HORIZONTAL.forward(theta.T)
    phi = np.arctan2(np.tan(theta_2), np.cos(theta_1))
    one, nil = np.ones(300), np.zeros(300)
    turn_x = np.array(
        [
            [one, nil, nil],
            [nil, np.cos(theta_1), -np.sin(theta_1)],
            [nil, np.sin(theta_1), np.cos(theta_1)],
        ]
    )
    turn_y = np.array(
        [[np.cos(phi), nil, np.sin(phi)], [nil, one, nil], [-np.sin(phi), nil, np.cos(phi)]]
    )
    np.testing.assert_allclose(q.platform, np.einsum("ijn,jkn->nik", turn_x, turn_y), atol=ROUNDING)
    x, y, z = n = np.array(
        [np.sin(phi), -np.sin(theta_1) * np.cos(phi), np.cos(theta_1) * np.cos(phi)]
    )
    np.testing.assert_allclose(C_HORIZONTAL.normal(q), n.T, atol=ROUNDING)
    np.testing.assert_allclose(
        np.abs(q.singularity),
        np.sqrt(1.0 - np.sin(theta_1) ** 2 * np.cos(theta_2) ** 2),
        atol=ROUNDING,
    )
    wanted = np.stack([np.arctan2(-y, z), np.arctan2(x * z, y * y + z * z)], axis=-1)
    np.testing.assert_allclose(
        C_HORIZONTAL.inverse_near(n.T, np.zeros((300, 2))), wanted, atol=1e-9
    )
    np.testing.assert_allclose(C_HORIZONTAL.tilt(theta.T), np.arccos(z), atol=1e-7)


def test_inverse_near_stays_on_the_side_of_the_turn_that_it_is_given():
    theta = np.array([0.2, 0.3])
    normal = C_HORIZONTAL.normal(C_HORIZONTAL.forward(theta))
    turned = theta + np.array([2.0 * np.pi, 0.0])
    np.testing.assert_allclose(C_HORIZONTAL.inverse_near(normal, turned), turned, atol=1e-9)


def driven_angle(mechanism, theta):
    """Angle between b and d by Rodrigues' formula, and its limits by the spherical triangle."""

    def turned(axis, vector, angle):
        angle = angle[:, None]
        along = axis * (axis @ vector)
        return along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector)

    b = turned(mechanism.a1, mechanism.b0, theta[:, 0])
    d = turned(mechanism.a2, mechanism.d0, theta[:, 1])
    angle = np.arctan2(np.linalg.norm(np.cross(b, d), axis=-1), np.sum(b * d, axis=-1))
    alpha_2, alpha_3 = (np.arccos(u @ mechanism.c0) for u in (mechanism.b0, mechanism.d0))
    return angle, abs(alpha_2 - alpha_3), min(alpha_2 + alpha_3, 2 * np.pi - alpha_2 - alpha_3)


def test_loop_closes_exactly_where_the_triangle_inequality_allows(mechanism):
    theta = np.random.default_rng(5).uniform(-np.pi, np.pi, (20_000, 2))
    angle, low, high = driven_angle(mechanism, theta)
    clear = np.minimum(np.abs(angle - low), np.abs(angle - high)) > 1e-6
    closes = (angle > low) & (angle < high)
    assert np.array_equal(mechanism.reachable(theta)[clear], closes[clear])


def test_both_limits_of_the_closure_are_met_by_some_wrist():
    """Otherwise the test before says nothing about one of them."""
    theta = np.random.default_rng(5).uniform(-np.pi, np.pi, (20_000, 2))
    angles = [driven_angle(mechanism, theta) for mechanism in MECHANISMS.values()]
    assert any(np.mean(angle < low) > 0.01 for angle, low, _ in angles)
    assert any(np.mean(angle > high) > 0.01 for angle, _, high in angles)
