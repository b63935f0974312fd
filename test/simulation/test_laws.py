"""Each hidden law does what nature does: oracles are closed forms, energies and limits."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.registry import catalogue
from wrist_stiffness.simulation.catalogue import (
    ALL,
    CATALOGUE,
    STRANGERS,
    HiddenEffect,
    build,
    places,
)
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.effect_entry import Draw
from wrist_stiffness.simulation.heat import CAPACITY, HEATED, TO_ROOM, HeatNetwork
from wrist_stiffness.simulation.instrument import LoadSensor, Noise
from wrist_stiffness.simulation.laws.bushing import Creep, play
from wrist_stiffness.simulation.laws.drive import Backlash
from wrist_stiffness.simulation.laws.law import Bending, Law
from wrist_stiffness.simulation.laws.platform import Inertia
from wrist_stiffness.simulation.laws.time_delay import DelayLine
from wrist_stiffness.simulation.seat import Seat
from wrist_stiffness.simulation.wrist import TrueWrist

QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))
# Creep and friction find their equilibrium to this [m, rad].
HISTORY = 1e-10
COLD = np.zeros(len(HEATED))


def plausible(effect, component, form, factor=1.0):
    magnitude = factor * ALL[effect].plausible
    return HiddenEffect(effect, component, form, magnitude, shape_seed=3)


def state_at(table, laws, theta, load, kelvin=COLD, time_s=None):
    """True states at given angles (n, 2) and loads (n, 6)."""
    theta, load = np.atleast_2d(theta), np.atleast_2d(load)
    time_s = np.arange(len(theta)) * 1.0 if time_s is None else time_s
    return TrueWrist(table, laws).at(time_s, theta, load, np.tile(kelvin, (len(theta), 1)))


@pytest.mark.parametrize(
    ("law", "hook", "said"),
    [
        (Law, "red_pose", "Law: no hook 'red_pose'; did you mean read_pose?"),
        (Law, "bend", "Law: no hook 'bend'"),
        (Bending, "bends", "Bending: no hook 'bends'; did you mean bend?"),
    ],
)
def test_a_hook_that_nobody_calls_is_refused(law, hook, said):
    with pytest.raises(InputError) as refused:
        law("platform", **{hook: lambda *told: told})
    assert str(refused.value).startswith(said)


def block_of(table, n, time_s=None):
    theta = np.tile([0.2, -0.3], (n, 1))
    return state_at(table, [], theta, np.zeros((n, 6)), time_s=time_s).block


def recorded(table, hidden, sizes, seconds=4.0, rate=20.0):
    """Everything the sensors said, the cell being run in blocks of these sizes in turn."""
    settings = CellSettings(rate_hz=rate, hidden=hidden, instrument="ideal", load_sensor=QUIET)
    cell = VirtualCell(table, settings, np.random.default_rng(0))
    time_s = np.arange(round(seconds * rate)) / rate
    parts, first = [], 0
    while first < len(time_s):
        now = time_s[first : first + sizes[len(parts) % len(sizes)]]
        parts.append(cell.run(now, cell.desired(now)))
        first += len(now)
    names = ("encoder", "wrench", "measured_shift", "measured_rotation")
    return [np.concatenate([getattr(part, name) for part in parts]) for name in names]


def one_place_a_form():
    """First place of every form of every effect."""
    return list(
        {(effect, form): (effect, c, form) for effect, c, form in places(ALL)[::-1]}.values()
    )


@pytest.mark.parametrize("place", one_place_a_form(), ids="-".join)
def test_history_does_not_depend_on_how_the_run_is_cut(place, wrist):
    hidden = (plausible(*place),)
    whole, cut = (recorded(wrist(), hidden, sizes) for sizes in ([1000], [1, 17, 4]))
    for one, other in zip(whole, cut, strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=HISTORY)


def test_every_law_of_the_model_can_be_hidden_and_eight_strangers_too():
    assert CATALOGUE.keys() == catalogue().keys()
    assert len(STRANGERS) >= 8
    assert not CATALOGUE.keys() & STRANGERS.keys()


@pytest.mark.parametrize("place", places(ALL), ids="-".join)
def test_every_place_and_form_makes_a_law(place, wrist):
    build(plausible(*place), wrist())


@pytest.mark.parametrize("place", one_place_a_form(), ids="-".join)
def test_law_vanishes_with_its_magnitude(place, wrist):
    """A thousandth of the magnitude leaves at most a fiftieth of the effect."""
    none, little, much = (
        recorded(wrist(), hidden, [1000])
        for hidden in ((), (plausible(*place, 1e-3),), (plausible(*place),))
    )
    small, large = (
        max(np.max(np.abs(a - b)) for a, b in zip(run, none, strict=True)) for run in (little, much)
    )
    if place[0] in THRESHOLDS and large == 0.0:
        pytest.skip("nothing passes its threshold in the first seconds")
    assert small < 0.02 * large


THRESHOLDS = ("flange_contact", "plastic_set", "loose_seat", "head_change", "cable_stop")

BENDING = [
    place
    for place in places(CATALOGUE)
    if place[0] in ("joint_clearance", "bushing_hardening", "thermal_softening")
    or place[2] == "stiffening"
]


@pytest.mark.parametrize("place", BENDING, ids="-".join)
def test_bending_law_has_an_energy_and_its_tangent_is_the_slope(place, wrist):
    table, rng = wrist(), np.random.default_rng(1)
    law = build(plausible(*place), table)
    block = state_at(table, [], [0.3, -0.2], np.zeros(6), kelvin=COLD + 7.0).block
    wrench = np.concatenate([rng.normal(size=(1, 3)), 0.02 * rng.normal(size=(1, 3))], axis=1)
    _, tangent = law.bend(block, wrench)
    np.testing.assert_allclose(tangent[0], tangent[0].T, atol=1e-9 * np.abs(tangent).max())
    scale = np.repeat([1.0, 0.02], 3)
    for i in range(6):
        step = np.zeros((1, 6))
        step[0, i] = 1e-5 * scale[i]
        ahead, behind = (law.bend(block, wrench + sign * step)[0] for sign in (1.0, -1.0))
        slope = (ahead - behind)[0] / (2e-5 * scale[i])
        np.testing.assert_allclose(slope, tangent[0, :, i], atol=1e-6 * np.abs(tangent).max())


def test_pin_lies_at_half_the_clearance_where_the_reaction_pushes(wrist):
    table = wrist()
    seat = Seat.of(table.geometry, "joint_3")
    law = play("joint_3", seat, 20e-6, 1e-3, "algebraic")
    block = block_of(table, 1)
    to_origin = seat.to_origin(block.rotation("joint_3"))[0]
    push = np.cross(seat.axis, [0.3, 0.5, -0.7])
    at_centre = np.concatenate([10.0 * push, np.zeros(3)])
    screw, _ = law.bend(block, (np.linalg.inv(to_origin).T @ at_centre)[None])
    local = np.linalg.inv(to_origin) @ screw[0]
    np.testing.assert_allclose(local[:3], 10e-6 * push / np.linalg.norm(push), atol=1e-9)
    np.testing.assert_allclose(local[3:], 0.0, atol=1e-9)


def test_moment_tilts_the_pin_until_both_ends_touch(wrist):
    table = wrist()
    seat = Seat.of(table.geometry, "joint_3")
    law = play("joint_3", seat, 20e-6, 1e-3, "exponential")
    block = block_of(table, 1)
    to_origin = seat.to_origin(block.rotation("joint_3"))[0]
    about = np.cross(seat.axis, [0.0, 0.6, 0.8])
    at_centre = np.concatenate([np.zeros(3), about])
    screw, _ = law.bend(block, (np.linalg.inv(to_origin).T @ at_centre)[None])
    local = np.linalg.inv(to_origin) @ screw[0]
    turn = 20e-6 / seat.length  # each end crosses half the clearance, the ends are a length apart
    np.testing.assert_allclose(local[3:], turn * about / np.linalg.norm(about), atol=1e-6)
    np.testing.assert_allclose(local[:3], 0.0, atol=1e-12)


@pytest.mark.parametrize("widths", [[2e-3], [1e-3, 2e-3, 3e-3]], ids=["single", "train"])
def test_backlash_loses_its_width_and_its_loop_closes(widths):
    law = Backlash("motor_2", np.array(widths))
    cycle = 0.1 * np.sin(np.linspace(0.0, 6.0 * np.pi, 601))
    shaft = np.stack([np.zeros(601), cycle], axis=1)
    turn = law.turn(np.arange(601.0), shaft)
    assert np.all(turn[:, 0] == 0.0)
    lost = turn[:, 1]
    up, down = 200, 300  # both at angle zero, on the way up and on the way down
    assert lost[down] - lost[up] == pytest.approx(np.mean(widths), abs=1e-12)
    np.testing.assert_allclose(lost[201:401], lost[401:601], atol=1e-12)


def test_creep_is_the_standard_solid_and_recovers(wrist):
    table = wrist()
    for step in (0.1, 2.0):
        law = Creep("joint_2", np.array([0.3]), np.array([10.0]))
        n = round(40.0 / step)
        block = block_of(table, n + 1, np.arange(n + 1) * step)
        wrench = np.zeros((n + 1, 6))
        wrench[1:, 0] = 1.0
        screw = law.flow(block, wrench, remember=True)
        k = ELASTIC.index("joint_2")
        full = 0.3 * block.flexibility[0, k, :, 0]
        # The load rises linearly over the first step: the mean of the steps within it.
        late = block.time_s[1:, None] - step
        rise = 1.0 - 10.0 / step * (1.0 - np.exp(-step / 10.0)) * np.exp(-late / 10.0)
        np.testing.assert_allclose(screw[1:], rise * full, atol=1e-9 * np.abs(full).max())
        later = block_of(table, n, block.time_s[-1] + np.arange(1, n + 1) * 10.0 * step)
        gone = law.flow(later, np.zeros((n, 6)), remember=True)
        assert np.max(np.abs(gone[-1])) < 1e-6 * np.max(np.abs(screw[-1]))


def rubbed(table, joint, mu, time_s, theta, load):
    """Run with friction in one joint: the law, its forces and its paths, (n, 2) each."""
    law = build(HiddenEffect("joint_friction", joint, "coulomb", mu, 2), table)
    told, rub = [], law.rub

    def listen(block, pose, state, acting, remember):
        out = rub(block, pose, state, acting, remember)
        if remember:
            path = state.slips[:, ("joint_2", "joint_3", "joint_4").index(joint)].copy()
            path[:, 1] += law.turn_of(block)
            told.append((out / [1.0, law.seat.radius], path * [1.0, law.seat.radius]))
        return out

    law.rub = listen
    TrueWrist(table, [law]).at(time_s, theta, load, np.zeros((len(time_s), len(HEATED))))
    # A row of samples that does not settle is halved: each part is remembered once, in its order.
    return law, *(np.concatenate(each) for each in zip(*told, strict=True))


@pytest.mark.parametrize("joint", ["joint_2", "joint_3", "joint_4"])
def test_friction_never_creates_energy(joint, wrist):
    """Work done on the joint is stored in the bristles or lost, along any path."""
    rng = np.random.default_rng(4)
    knots = np.cumsum(rng.normal(size=(12, 2)), axis=0) * np.radians(3.0)
    fine = np.linspace(0.0, 11.0, 800)
    theta = np.stack([np.interp(fine, np.arange(12), knots[:, i]) for i in range(2)], axis=1)
    load = np.zeros((800, 6))
    load[:, 2] = -np.abs(np.sin(fine))
    law, force, path = rubbed(wrist(), joint, 0.3, fine, theta, load)
    middle = 0.5 * (force[1:] + force[:-1])
    work = np.cumsum(-np.sum(middle * np.diff(path, axis=0), axis=1))
    stored = 0.5 * np.sum(force[1:] ** 2, axis=1) / law.stiffness
    lost = work - stored
    assert lost[-1] > 5.0 * np.max(stored)
    # The trapezoid rule gives a little away where the bristles break loose within a step.
    assert np.min(np.diff(lost)) > -0.05 * lost[-1] / len(lost)


def test_friction_holds_the_slide_at_rest_and_motion_frees_it(wrist):
    table, n = wrist(flanged=False), 200
    rest = np.tile([0.2, -0.3], (n, 1))
    moving = rest + np.linspace(-0.8, 0.0, n)[:, None]
    load = np.zeros((n, 6))
    load[:, 1] = np.linspace(0.0, 1.0, n)
    _, held, _ = rubbed(table, "joint_4", 0.3, np.arange(n) * 0.1, rest, load)
    _, dragged, path = rubbed(table, "joint_4", 0.3, np.arange(n) * 0.1, moving, load)
    slip = np.diff(path, axis=0)[-1]
    # In motion the whole budget lies against the slip, which is nearly all turn.
    opposed = -dragged[-1] @ slip / np.linalg.norm(dragged[-1]) / np.linalg.norm(slip)
    assert opposed > 0.9999
    assert np.abs(dragged[-1, 0]) < 0.3 * np.abs(held[-1, 0])


def test_cable_friction_loses_energy_round_a_loop(wrist):
    table = wrist()
    law = build(HiddenEffect("cable_wrench", "platform", "rubbing", 5.0, 3), table)
    turns = np.linspace(0.0, 4.0 * np.pi, 801)
    theta = 0.4 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    state = state_at(table, [], theta, np.zeros((801, 6)))
    wrench = law.wrench(state.block)
    turn = log_motion(
        state.rotation[1:] @ np.swapaxes(state.rotation[:-1], -1, -2), np.zeros((800, 3))
    )[:, 3:]
    power = np.sum(0.5 * (wrench[1:, 3:] + wrench[:-1, 3:]) * turn, axis=1)
    first, second = power[:400].sum(), power[400:].sum()
    assert second < 0.0
    assert first == pytest.approx(second, rel=0.2)


def test_inertia_is_newtons_law_on_a_circle(wrist):
    """Motor 1 alone turns the platform about its own axis: tangential and centripetal forces."""
    table = wrist()
    mass, place, alpha = 0.3, np.array([0.01, 0.02, -0.03]), 4.0
    time_s = np.arange(400) * 1e-3
    angle = 0.5 * alpha * time_s**2
    theta = np.stack([angle, np.zeros(400)], axis=1)
    state = state_at(table, [], theta, np.zeros((400, 6)), time_s=time_s)
    wrench = Inertia(mass, place, 1e-6).wrench(state.block)
    a1 = table.mechanism.a1
    at = state.block.configuration.platform @ place
    rate = alpha * time_s[:, None]
    wanted = -mass * (alpha * np.cross(a1, at) + rate**2 * np.cross(a1, np.cross(a1, at)))
    # Differences of the last three samples lag by one of them.
    np.testing.assert_allclose(wrench[3:, :3], wanted[2:-1], atol=1e-3 * np.abs(wanted).max())


def test_delay_line_gives_the_past():
    line, slow = DelayLine(0.25), []
    time_s = np.arange(0.0, 4.0, 0.1)
    for first in range(0, 40, 3):
        slow.append(line(time_s[first : first + 3], 2.0 * time_s[first : first + 3, None]))
    np.testing.assert_allclose(
        np.concatenate(slow)[:, 0], 2.0 * np.maximum(time_s - 0.25, 0.0), atol=1e-12
    )


def test_motors_warm_the_wrist_and_heat_is_kept():
    network = HeatNetwork()
    time_s = np.arange(0.0, 20000.0, 10.0)
    still = np.zeros((len(time_s), 2))
    kelvin = network.run(time_s, still, np.full(len(time_s), 3.0))
    given = float(np.sum(TO_ROOM * (kelvin[-1] - 3.0)))
    assert given == pytest.approx(2 * 0.4, rel=1e-3)  # both motors' standby goes to the room
    assert kelvin[-1, 0] > kelvin[-1, HEATED.index("platform")] > 3.0
    stored = np.diff(kelvin, axis=0) @ CAPACITY / 10.0
    flow = 0.8 - (kelvin[1:] - 3.0) @ TO_ROOM
    np.testing.assert_allclose(stored, flow, atol=1e-9)


def test_a_wrist_that_grows_as_a_whole_only_carries_its_plate_outward(wrist):
    """With bearings at the bars' radii nothing is left between the bodies: similar wrists."""
    table = wrist(flanged=False)
    geometry = table.geometry
    bushings = dict(geometry.bushings)
    for joint, link in (("joint_1", "link_1"), ("joint_5", "link_2")):
        radius = geometry.links[link].arc_radius
        bushings[joint] = replace(bushings[joint], radius=radius)
    geometry = replace(geometry, bushings=bushings)
    strain, replaced = 1e-5, SimpleNamespace(geometry=geometry)
    laws = [
        ALL["thermal_expansion"].make(Draw(replaced, body, "linear", strain, None))
        for body in ("frame", "link_1", "link_2", "platform")
    ]
    theta = np.array([[0.3, -0.4], [-0.5, 0.2]])
    warm, cold = (
        state_at(table, laws, theta, np.zeros((2, 6)), kelvin=COLD + kelvin) for kelvin in (1, 0)
    )
    grown = warm.equilibrium.twist - cold.equilibrium.twist
    outward = warm.block.configuration.platform @ (strain * geometry.platform.centre)
    np.testing.assert_allclose(grown[:, :3], outward, atol=1e-12)
    np.testing.assert_allclose(grown[:, 3:], 0.0, atol=1e-12)


@pytest.mark.parametrize("form", ["frame", "platform"])
def test_load_point_is_undone_by_moving_the_moment_back(form, wrist):
    table = wrist()
    law = build(HiddenEffect("load_point", "load_sensor", form, 0.01, 8), table)
    home = state_at(table, [], np.zeros((3, 2)), np.zeros((3, 6))).block
    # Of unit forces along x, y and z it reads the moments e x point.
    moments = law.read_load(home, np.eye(3, 6))[:, 3:]
    point = -0.5 * np.cross(np.eye(3), moments).sum(axis=0)
    assert np.linalg.norm(point) == pytest.approx(0.01)
    wrench = np.array([[0.3, -0.5, 0.2, 0.01, 0.02, -0.03]])
    block = block_of(table, 1)
    read = law.read_load(block, wrench)
    if form == "platform":
        point = block.configuration.platform[0] @ point
    np.testing.assert_allclose(read[0, 3:] + np.cross(point, read[0, :3]), wrench[0, 3:])
    assert np.array_equal(read[:, :3], wrench[:, :3])


def test_unknown_names_and_excessive_magnitudes_are_refused(wrist):
    table = wrist()
    for wrong, message in (
        (HiddenEffect("gremlins", "joint_1", "plain", 1.0, 0), "gremlins"),
        (HiddenEffect("creep", "motor_1", "power_law", 0.1, 0), "motor_1"),
        (HiddenEffect("creep", "joint_1", "sudden", 0.1, 0), "sudden"),
        (HiddenEffect("backlash", "motor_1", "single", 1.0, 0), "limit of 0.02 rad"),
        (HiddenEffect("time_delay", "motor_1", "plain", float("nan"), 0), "nan"),
    ):
        with pytest.raises(InputError, match=message):
            build(wrong, table)
    with pytest.raises(InputError, match="no flange"):
        TrueWrist(
            wrist(flanged=False),
            [build(HiddenEffect("flange_contact", "joint_2", "open", 1e-6, 0), table)],
        )
