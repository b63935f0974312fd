"""Laws of what the model is told and of what the pose sensor says."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.model.block import Block

POSE = (20.0, -10.0)
TRUE = np.array([0.4, -0.3, -1.0, 0.01, -0.02, 0.005])


def same(model, effect, said, true):
    """Tell whether the effect makes of the said load what the true one does without it."""
    with_effect = model.with_effects(effect).batch(said).twist
    without = model.batch(true).twist
    assert not np.allclose(model.batch(said).twist, without, rtol=1e-3, atol=0.0)
    return np.allclose(with_effect, without, rtol=1e-9, atol=1e-18)


def test_sensor_that_reads_too_much(model, make):
    effect = make.effect("load_scale@load_sensor", scale_percent=25.0)
    assert same(model, effect, make.rest(POSE, 1.25 * TRUE), make.rest(POSE, TRUE))


def test_axes_that_read_one_another(model, make):
    """A sensor with a wrong calibration matrix; the gain of fz is load_scale's."""
    rng = np.random.default_rng(4)
    full_scale = np.repeat([1.0, 0.01], 3)
    talk = 0.05 * rng.normal(size=(6, 6)) * full_scale[:, None] / full_scale
    taken = np.eye(6) - np.linalg.inv(np.eye(6) + talk)
    scale = 1.0 / (1.0 - taken[2, 2]) - 1.0
    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    units = {"ff": ("percent", 100.0), "fm": ("N_per_Nm", 1.0), "mf": ("Nmm_per_N", 1e3)}
    units["mm"] = units["ff"]
    values = {}
    for (i, axis), (j, source) in product(enumerate(axes), enumerate(axes)):
        name, factor = units[axis[0] + source[0]]
        values[f"{axis}_from_{source}_{name}"] = factor * (taken[i, j] + (i == j) * -taken[2, 2])
    del values["fz_from_fz_percent"]
    crossed = make.effect("load_cross_talk@load_sensor", **values)
    scaled = make.effect("load_scale@load_sensor", scale_percent=100.0 * scale)
    said = TRUE + talk @ TRUE
    told = model.with_effects(crossed, scaled).batch(make.rest(POSE, said)).twist
    assert np.allclose(told, model.batch(make.rest(POSE, TRUE)).twist, rtol=1e-9, atol=1e-18)


def test_sensor_that_is_not_tared(model, make):
    effect = make.effect("load_bias@load_sensor", fx_N=0.2, mz_Nmm=5.0)
    bias = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.005])
    assert same(model, effect, make.rest(POSE, TRUE + bias), make.rest(POSE, TRUE))


def test_load_beside_its_point(model, make):
    """A lever arm fixed in U turns with the platform, one in F does not."""
    turn = model.table.mechanism.forward(np.radians(POSE)).platform
    arms = {"base": np.array([0.0, 3e-3, 0.0]), "platform": turn @ [0.0, 3e-3, 0.0]}
    for where, arm in arms.items():
        effect = make.effect("load_point@load_sensor", **{f"{where}_y_mm": 3.0})
        true = TRUE + np.append(np.zeros(3), np.cross(arm, TRUE[:3]))
        assert same(model, effect, make.rest(POSE, TRUE), make.rest(POSE, true))


@pytest.mark.parametrize("where", ["base", "platform"])
def test_sensor_that_is_turned(model, make, where):
    """A quarter turn about z of F, or of the platform."""
    effect = make.effect("load_misalignment@load_sensor", **{f"{where}_z_mdeg": 90e3})
    said = np.array([3.0, 1.0, -2.0, 0.03, 0.01, -0.02])
    body = np.eye(3)
    if where == "platform":
        body = model.table.mechanism.forward(np.radians(POSE)).platform
    inside = block_diagonal(body.T) @ said
    true = block_diagonal(body) @ [-inside[1], inside[0], inside[2], -inside[4], *inside[[3, 5]]]
    assert same(model, effect, make.rest(POSE, said), make.rest(POSE, true))


def test_payload_is_a_weight_at_its_centre(model, make):
    effect = make.effect("gravity@platform", mass_g=30.0, x_mm=10.0, z_mm=-25.0)
    turn = model.table.mechanism.forward(np.radians(POSE)).platform
    weight = 0.030 * model.table.geometry.gravity
    wrench = np.concatenate([weight, np.cross(turn @ [0.010, 0.0, -0.025], weight)])
    loaded = model.batch(make.rest(POSE, TRUE + wrench)).twist
    assert np.allclose(
        model.with_effects(effect).batch(make.rest(POSE, TRUE)).twist, loaded, rtol=1e-9
    )


def test_tilted_base_is_another_gravity(model, make):
    table = model.table
    gravity = table.geometry.gravity
    rotation, _ = exp_twist(np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.0]))
    values = {**table.header.geometry}
    values["site"] = {**values["site"], "gravity_m_s2": (rotation @ gravity).tolist()}
    tilted = replace(model, table=replace(table, header=replace(table.header, geometry=values)))
    effect = make.effect(
        "gravity@platform",
        tilt_x_mdeg=1e3 * float(np.degrees(0.1)),
        tilt_y_mdeg=1e3 * float(np.degrees(-0.2)),
    )
    block = make.rest(POSE, TRUE)
    assert np.allclose(
        model.with_effects(effect).batch(block).twist, tilted.batch(block).twist, rtol=1e-8
    )


@pytest.mark.parametrize(
    ("link", "near", "bushing"), [("link_1", 0, "joint_1"), ("link_2", 1, "joint_5")]
)
def test_mass_on_a_link_by_maxwell(free_model, make, link, near, bushing):
    """A weight on a link moves the platform as a load on the platform moves the weight."""
    from wrist_stiffness.mechanism.components import ELASTIC
    from wrist_stiffness.mechanism.statics import turned_flexibilities

    configuration = free_model.table.mechanism.forward(np.radians(POSE))
    flexibility = turned_flexibilities(configuration, free_model.table.components)
    effect = make.effect(f"gravity@{link}", mass_g=50.0, x_mm=12.0, y_mm=-7.0, z_mm=20.0)
    weight = 0.050 * free_model.table.geometry.gravity
    point = configuration.rotations[link] @ [0.012, -0.007, 0.020]
    wrench = np.concatenate([weight, np.cross(point, weight)])
    from wrist_stiffness.mechanism.influence import influence

    g = influence(configuration)
    carry = block_diagonal((g.limb_1, g.limb_2)[near])
    twist = make.added(free_model, effect, make.rest(POSE, TRUE))[0]
    for axis in range(6):
        load = carry.T @ np.eye(6)[axis]
        motor_side = flexibility[ELASTIC.index(bushing)] @ load
        platform_side = motor_side + flexibility[ELASTIC.index(link)] @ load
        assert twist[axis] == pytest.approx(wrench @ (0.5 * (motor_side + platform_side)), rel=1e-8)


def test_pull_of_a_cable_follows_the_pose_with_hysteresis(model, make):
    effect = make.effect(
        "cable_wrench@platform", fx_1_N_per_rad=0.5, mz_2_Nmm_per_rad=3.0, hysteresis_deg=4.0
    )
    angle = np.radians([-20.0, 10.0, -20.0])
    theta = np.stack([angle, 0.5 * angle], axis=1)
    block = Block(np.arange(3.0), theta, np.tile(TRUE, (3, 1)))
    followed = theta.copy()
    followed[1] -= np.radians(2.0)
    followed[2] += np.radians(2.0)
    wrench = np.zeros((3, 6))
    wrench[:, 0], wrench[:, 5] = 0.5 * followed[:, 0], 3e-3 * followed[:, 1]
    pulled = model.batch(replace(block, load=block.load + wrench)).twist
    assert np.allclose(model.with_effects(effect).batch(block).twist, pulled, rtol=1e-9)


def test_inertia_is_mass_times_acceleration(model, make):
    """The path of the centre of gravity differentiated twice, without the Jacobian."""
    dt = 1e-4
    time = dt * np.arange(41)
    theta = np.stack([0.4 * np.sin(8.0 * time), 0.3 * np.cos(6.0 * time)], axis=1)
    arm, mass = np.array([0.01, -0.005, -0.03]), 2.0
    platform = model.table.mechanism.forward(theta).platform
    path = platform @ arm
    acceleration = (path[2:] - 2.0 * path[1:-1] + path[:-2]) / dt**2
    force = -mass * acceleration
    wrench = np.concatenate([force, np.cross(path[1:-1], force)], axis=1)
    effect = make.effect(
        "inertia@platform", mass_g=2000.0, x_mm=10.0, y_mm=-5.0, z_mm=-30.0, inertia_gmm2=0.0
    )
    speed = np.gradient(theta, dt, axis=0, edge_order=2)
    block = Block(time, theta, np.zeros((41, 6)), theta_dot=speed)
    at = model.with_effects(effect)
    moved = at.batch(block).twist[2:-1] - model.batch(block).twist[2:-1]
    loads = replace(block.take(slice(2, -1)), load=wrench[1:])
    expected = model.batch(loads).twist - model.batch(block.take(slice(2, -1))).twist
    assert np.allclose(moved, expected, rtol=0.05, atol=0.01 * np.abs(expected).max())


def test_round_inertia_resists_turning(model, make):
    effect = make.effect("inertia@platform", inertia_gmm2=1e6)
    time = np.array([0.0, 0.01])
    theta = np.array([[0.0, 0.0], [1e-4, 0.0]])
    block = Block(time, theta, np.zeros((2, 6)), theta_dot=np.array([[0.0, 0.0], [0.5, 0.0]]))
    jacobian = model.table.mechanism.jacobian(model.table.mechanism.forward(theta[1]))
    moment = -1e-3 * jacobian[:, 0] * 0.5 / 0.01
    loaded = replace(block, load=np.array([np.zeros(6), [0.0, 0.0, 0.0, *moment]]))
    assert np.allclose(
        model.with_effects(effect).batch(block).twist[1], model.batch(loaded).twist[1], rtol=1e-9
    )


@pytest.mark.parametrize("size", [1e-5, 5e-3])
def test_registrations_compose_exactly(model, make, size):
    """T_measured = exp(X) T_err exp(Y in F) T_nominal, at a millimetre and 0.3 degrees too."""
    values = {
        key: scale * size
        for key, scale in (
            ("shift_x_um", 1e5), ("shift_z_um", -2e5), ("turn_x_mdeg", 4e4), ("turn_y_mdeg", 3e4),
        )
    }  # fmt: skip
    screw = size * np.array([0.1, 0.0, -0.2, np.radians(40.0), np.radians(30.0), 0.0])
    block = make.rest(POSE, TRUE)
    frame, target = (
        make.effect(f"{name}@pose_sensor", **values)
        for name in ("measurement_frame", "target_mounting")
    )
    twist = model.batch(block).twist[0]
    nominal = model.table.mechanism.forward(block.theta[0]).platform, np.zeros(3)
    back = nominal[0].T, np.zeros(3)
    both = model.with_effects(frame, target).batch(block)
    expected = make.compose(exp_twist(screw), exp_twist(twist), nominal, exp_twist(screw), back)
    assert np.allclose(both.measured[0], log_motion(*expected), rtol=1e-9, atol=1e-17)
    assert np.array_equal(both.twist[0], twist)


def test_drift_grows_from_the_first_sample(model, make):
    block = replace(make.rest(POSE, TRUE, n=3), time=np.array([100.0, 1900.0, 3700.0]))
    effect = make.effect("drift@pose_sensor", shift_y_um_per_h=8.0, turn_x_mdeg_per_h=2.0)
    result = model.with_effects(effect).batch(block)
    drifted = result.measured - result.twist
    assert np.allclose(drifted[:, 1], [0.0, 4e-6, 8e-6], atol=1e-10)
    assert np.allclose(drifted[:, 3], np.radians([0.0, 1e-3, 2e-3]), atol=1e-10)


def test_late_motor_stamps_are_other_angles(model, make):
    """Both motors late by 1 ms at 0.5 rad/s: the rigid pose has moved on."""
    speed = np.array([0.5, -0.3])
    block = make.rest(POSE, TRUE, theta_dot=speed[None])
    late = [make.effect(f"time_delay@motor_{i}", delay_ms=1.0) for i in (1, 2)]
    moved = model.with_effects(*late).batch(block).twist - model.batch(block).twist
    forward = model.table.mechanism.forward
    theta = block.theta[0]
    turned = forward(theta + 1e-3 * speed).platform @ forward(theta).platform.T
    assert np.allclose(moved[0], log_motion(turned, np.zeros(3)), atol=2e-6)


def test_late_pose_stamps_show_an_earlier_pose(model, make):
    """Exact however far: 100 ms at 0.5 rad/s."""
    speed = np.array([0.5, -0.3])
    block = make.rest(POSE, TRUE, theta_dot=speed[None])
    late = make.effect("time_delay@pose_sensor", delay_ms=100.0)
    result = model.with_effects(late).batch(block)
    forward = model.table.mechanism.forward
    theta = block.theta[0]
    back = forward(theta).platform.T, np.zeros(3)
    shown = make.compose(
        exp_twist(result.twist[0]), (forward(theta - 0.1 * speed).platform, np.zeros(3)), back
    )
    assert np.allclose(result.measured[0], log_motion(*shown), rtol=1e-10)


def swing(time):
    """Return angles and speeds (n, 2) of a smooth motion."""
    phase = np.outer(time, [3.0, 2.0]) + [0.3, 1.1]
    return 0.2 * np.sin(phase), 0.2 * np.cos(phase) * [3.0, 2.0]


def late_turn(model, make, place, delay_ms, step_s):
    """Return the turn that is measured with a late stamp, and what it should be, (n, 3)."""
    time = np.arange(0.0, 2.0, step_s)
    theta, speed = swing(time)
    block = Block(time, theta, np.zeros((len(time), 6)), theta_dot=speed)
    late = model.with_effects(make.effect(f"time_delay@{place}", delay_ms=delay_ms)).batch(block)
    plain = model.batch(block).twist[:, 3:]
    true = theta.copy()
    if place == "pose_sensor":
        true = swing(time - 1e-3 * delay_ms)[0]
    else:
        column = int(place[-1]) - 1
        true[:, column] = swing(time + 1e-3 * delay_ms)[0][:, column]
    forward = model.table.mechanism.forward
    turned = forward(true).platform @ np.swapaxes(forward(theta).platform, -1, -2)
    if place == "pose_sensor":
        turned, plain = Rotation.from_rotvec(plain).as_matrix() @ turned, 0.0
    expected = plain + Rotation.from_matrix(turned).as_rotvec()
    used = time > 2.5e-3 * abs(delay_ms)
    return late.measured[used, 3:], expected[used]


@pytest.mark.parametrize(
    ("place", "delay_ms"), [("pose_sensor", 130.0), ("motor_1", -70.0), ("motor_2", -70.0)]
)
def test_what_was_between_two_samples_is_known_to_fourth_order(model, make, place, delay_ms):
    errors = [
        np.abs(np.subtract(*late_turn(model, make, place, delay_ms, step))).max()
        for step in (0.1, 0.05)
    ]
    assert errors[0] < 2e-4
    assert errors[1] < errors[0] / 8.0


@pytest.mark.parametrize(
    ("place", "sign"), [("motor_1", 1.0), ("motor_2", 1.0), ("pose_sensor", -1.0)]
)
def test_what_is_still_to_come_is_known_to_second_order(model, make, place, sign):
    """Speeds at 1 kHz; half the delay leaves an eighth of the error."""
    errors = [
        np.abs(np.subtract(*late_turn(model, make, place, sign * delay_ms, 1e-3))).max()
        for delay_ms in (40.0, 20.0)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 6.0


def test_two_first_samples_of_one_moment_do_not_know_of_each_other(model, make):
    time = np.array([0.0, 0.0, 0.1])
    theta = np.radians([[20.0, -10.0], [21.0, -10.0], [22.0, -10.0]])
    late = model.with_effects(make.effect("time_delay@pose_sensor", delay_ms=50.0))
    block = Block(time, theta, np.zeros((3, 6)), theta_dot=np.full((3, 2), 0.1))
    first = late.batch(block.take(slice(0, 1))).measured
    assert np.array_equal(late.batch(block).measured[:1], first)


def test_late_load_stamps_run_along_the_ramp(model, make):
    time = 0.1 * np.arange(6)
    said = np.outer(time, TRUE)
    block = Block(time, np.tile(np.radians(POSE), (6, 1)), said)
    true = replace(block, load=np.outer(time + 0.02, TRUE))
    late = make.effect("time_delay@load_sensor", delay_ms=20.0)
    assert np.allclose(
        model.with_effects(late).batch(block).twist[1:], model.batch(true).twist[1:], rtol=1e-9
    )


@pytest.mark.parametrize("motor", [1, 2])
@pytest.mark.parametrize(
    ("law", "values", "wave"),
    [
        ("encoder_eccentricity", {"cos_1_mdeg": 8.0}, lambda a: np.cos(a)),
        ("encoder_eccentricity", {"sin_2_mdeg": 8.0}, lambda a: np.sin(2 * a)),
        ("transmission_error", {"sin_mdeg": 8.0, "order": 100.0}, lambda a: np.sin(100 * a)),
        (
            "transmission_error",
            {"cos_3_mdeg": 8.0, "order": 20.0, "run_out_sin_percent": 30.0},
            lambda a: (1 + 0.3 * np.sin(a)) * np.cos(60 * a),
        ),
    ],
)
def test_waves_of_the_drive_are_other_angles(model, make, motor, law, values, wave):
    block = make.rest(POSE, TRUE)
    other = block.theta[0].copy()
    other[motor - 1] += np.radians(8e-3) * wave(other[motor - 1])
    forward = model.table.mechanism.forward
    turned = forward(other).platform @ forward(block.theta[0]).platform.T
    twist = make.added(model, make.effect(f"{law}@motor_{motor}", **values), block)[0]
    assert np.allclose(twist, log_motion(turned, np.zeros(3)), atol=1e-7)
    assert np.linalg.norm(twist) > 1e-6
