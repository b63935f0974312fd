"""Stops in the way of true wrists, held against the lookup's own response."""

import numpy as np
import pytest
from stops import Stops

from wrist_stiffness.lookup.response import respond

THETA = np.array([0.1, 0.2])
TOOL = np.array([0.0, 0.0, 0.06])
WALL, HOLE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
NONE = np.zeros(3)
INFINITE = np.inf


def settle(table, along, about, highest, stiffness, lowest=-INFINITE, load=NONE, there=True):
    """Return the push of a stop [N or N m], and how far the platform went along it."""
    n = 2
    wanted = table.mechanism.forward(THETA).platform
    stops = Stops(
        *(np.tile(each, (n, 1)) for each in (along, about, TOOL)),
        np.tile(wanted, (n, 1, 1)),
        *(np.full(n, each) for each in (lowest, highest, stiffness)),
    )
    wrench = np.append(load, NONE)
    rotation, shift, push = stops.settle(
        table, np.tile(THETA, (n, 1)), np.tile(wrench, (n, 1)), np.array([True, there])
    )
    if not there:
        assert not push[1].any()
    assert np.allclose(push[0, 3:], np.cross(wanted @ TOOL, push[0, :3]) + push[0, 3:] * about)
    operators = table.operators_at(table.mechanism.forward(THETA), "closed_form")
    twist = respond(operators, wrench + push[0]).twist
    assert np.allclose(shift[0], twist[:3], rtol=0.0, atol=1e-8)
    went = along @ (twist[:3] + np.cross(twist[3:], wanted @ TOOL)) + about @ twist[3:]
    assert stops.coordinate(rotation, shift)[0] == pytest.approx(went, abs=1e-8)
    return push[0, :3] @ along + push[0, 3:] @ about, went


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
def test_a_wall_pushes_back_as_a_spring_where_the_tool_is_in_it(table, stiffness):
    push, went = settle(table, WALL, NONE, -20e-6, stiffness)
    # The push is found to 1e-5 N, and places to 1e-8 m by first order.
    assert push == pytest.approx(-stiffness * (went + 20e-6), abs=2e-5 + 2e-8 * stiffness)
    assert push < 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_hole_holds_the_direction_from_both_sides(table, side):
    low, high = sorted([side * 2e-4, side * 6e-4])
    push, went = settle(table, NONE, HOLE, high, 1e3, low)
    assert push * side > 0.0
    assert push == pytest.approx(1e3 * (side * 2e-4 - went), abs=3e-5)


def test_a_rigid_wall_is_not_entered_and_a_far_one_not_felt(table):
    assert settle(table, WALL, NONE, -20e-6, 1e12)[1] == pytest.approx(-20e-6, abs=2e-8)
    assert settle(table, WALL, NONE, 50e-6, 1e12)[0] == 0.0
    assert settle(table, WALL, NONE, -20e-6, 1e6, there=False)[0] < 0.0


def test_a_load_towards_the_wall_is_carried_by_wall_and_wrist(table):
    free, _ = settle(table, WALL, NONE, 0.0, 1e6)
    pressed, _ = settle(table, WALL, NONE, 0.0, 1e6, load=np.array([2.0, 0.0, 0.0]))
    assert -2.0 < pressed - free < 0.0
