"""What hidden laws do to the whole wrist: loops that close, creep that settles, play that ends."""

import numpy as np
import pytest

from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.simulation.catalogue import HiddenEffect, build
from wrist_stiffness.simulation.heat import HEATED
from wrist_stiffness.simulation.laws.bushing import Creep
from wrist_stiffness.simulation.laws.law import UniformSoftness
from wrist_stiffness.simulation.wrist import TrueWrist

ANGLES = np.array([0.2, -0.3])
LEVER = np.repeat([1.0, 0.03], 3)
"""Turns count as lengths at 30 mm."""


def twists(table, laws, load, theta=None, time_s=None):
    """Twists of the platform (n, 6), turns as lengths, for loads (n, 6) in the order of time."""
    n = len(load)
    theta = np.tile(ANGLES, (n, 1)) if theta is None else theta
    time_s = np.arange(n) * 0.1 if time_s is None else time_s
    state = TrueWrist(table, laws).at(time_s, theta, load, np.zeros((n, len(HEATED))))
    rigid = np.swapaxes(table.mechanism.forward(theta).platform, -1, -2)
    return LEVER * log_motion(state.rotation @ rigid, state.shift)


def pushed(force):
    """Loads (n, 6) of forces (n,) along one skew direction."""
    return force[:, None] * np.array([0.5, 0.6, -0.6, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("joint", ["joint_2", "joint_3", "joint_4"])
def test_friction_hysteresis_opens_over_a_cycle_and_closes(joint, wrist):
    table, quarter, cycles = wrist(), 60, 6
    turn = np.linspace(0.0, 2.0 * np.pi * cycles, 4 * quarter * cycles + 1)
    theta = ANGLES + np.radians(3.0) * np.sin(turn)[:, None] * [1.0, -0.6]
    load = pushed(np.ones(len(turn)))
    law = build(HiddenEffect("joint_friction", joint, "coulomb", 0.2, 2), table)
    moved = twists(table, [law], load, theta) - twists(table, [], load, theta)
    # The bristles turn into the direction of slip little by little: the loop settles first.
    before, last = moved[-8 * quarter : -4 * quarter], moved[-4 * quarter :]
    size = np.max(np.abs(moved))
    assert np.max(np.abs(last - before)) < 1e-3 * size
    # The same angles going back and coming forth.
    back, forth = moved[5 * quarter : 7 * quarter + 1], moved[7 * quarter : 9 * quarter + 1]
    assert np.max(np.abs(back - forth[::-1])) > 0.5 * size


def test_creep_settles_where_a_softer_bushing_would_be(wrist):
    table, share = wrist(flanged=False), 0.4
    load = pushed(np.concatenate([[0.0], np.ones(60)]))
    time_s = np.concatenate([[0.0], np.linspace(0.1, 300.0, 60)])
    creeping = twists(
        table, [Creep("joint_3", np.array([share]), np.array([12.0]))], load, time_s=time_s
    )
    soft = twists(table, [UniformSoftness("joint_3", share)], load)
    stiff = twists(table, [], load)
    # Under its own weight the wrist has stood for long: that part has settled at the start.
    still = soft - (stiff[1:] + soft[0] - stiff[0])[0]
    left = np.linalg.norm(creeping - soft, axis=1) / np.linalg.norm(still[-1])
    assert left[0] < 1e-6
    assert left[1] > 0.99
    assert np.all(np.diff(left[1:]) <= 1e-12)
    assert left[-1] < 1e-6


@pytest.mark.parametrize("form", ["algebraic", "exponential"])
@pytest.mark.parametrize("joint", ["joint_1", "joint_3", "joint_5"])
def test_play_vanishes_with_its_gap_and_never_exceeds_it(joint, form, wrist):
    """Each end of the pin crosses half the gap: the platform moves by that times the influence."""
    table = wrist(flanged=False)
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    load = np.zeros((25, 6))
    load[:, 0], load[:, 1] = np.cos(turn), np.sin(turn)
    bare = twists(table, [], load)
    sizes = []
    for gap in (1e-5, 1e-6, 1e-9):
        law = build(HiddenEffect("joint_clearance", joint, form, gap, 2), table)
        sizes.append(np.max(np.abs(twists(table, [law], load) - bare)) / gap)
    assert 0.1 < sizes[1] < 10.0
    assert sizes[0] == pytest.approx(sizes[1], rel=0.05)
    assert sizes[2] == pytest.approx(sizes[1], rel=0.05)


def test_backlash_loop_closes_in_the_readings_whatever_the_path(wrist):
    """The same angles after the same last motion give the same platform, from far or near."""
    table = wrist()
    law = build(HiddenEffect("backlash", "motor_1", "train", 1e-3, 2), table)
    for start in (-0.5, -0.05):
        path = np.concatenate([np.linspace(0.0, start, 20), np.linspace(start, 0.1, 20)])
        shaft = np.stack([path, np.zeros(40)], axis=1)
        turn = law.turn(np.arange(40.0), shaft)
        assert turn[-1, 0] == pytest.approx(-5e-4, abs=1e-12)
