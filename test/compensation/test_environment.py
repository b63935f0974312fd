import numpy as np
import pytest

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.simulation.environment import EnvironmentSpring

NORMAL = np.array([-1.0, 0.0, 0.0])
TOOL = np.array([0.0, 0.0, 0.06])


def press(table, stiffness, overlap):
    """Return force and the depth that is left, for a wall that overlaps the rigid tool."""
    configuration = table.mechanism.forward(np.array([0.1, 0.2]))
    arm = configuration.platform @ TOOL
    wall = EnvironmentSpring(NORMAL, float(NORMAL @ arm) + overlap, stiffness)
    wrench = wall.wrench(table, configuration, TOOL)
    twist = respond(table.operators_at(configuration, "closed_form"), wrench).twist
    moved = twist[:3] + np.cross(twist[3:], arm)
    assert np.allclose(wrench[3:], np.cross(arm, wrench[:3]))
    return wrench[:3] @ NORMAL, overlap - NORMAL @ moved


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
def test_spring_and_wrist_are_in_equilibrium(table, stiffness):
    force, depth = press(table, stiffness, 20e-6)
    assert force == pytest.approx(stiffness * depth, abs=1e-6 * stiffness * 20e-6 + 1e-8)
    assert force > 0.0


def test_a_rigid_wall_leaves_no_depth_and_a_soft_one_all(table):
    own_weight = press(table, 0.0, 0.0)[1]
    assert abs(press(table, 1e12, 20e-6)[1]) < 1e-10
    assert press(table, 1e-3, 20e-6)[1] == pytest.approx(20e-6 + own_weight, rel=1e-3)


def test_without_touching_there_is_no_force(table):
    assert press(table, 1e6, -50e-6)[0] == 0.0
