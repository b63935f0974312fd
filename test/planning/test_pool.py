"""Settings that a plan may choose from reach to the end of what the wrist may do."""

import numpy as np
import pytest

from wrist_stiffness.planning.loads_file import Actuator, Weight
from wrist_stiffness.planning.pool import TILT_SHARE, draw_settings, moved_outward
from wrist_stiffness.planning.timeline import APPROACH, straight

HANDLE = np.array([0.0, 0.0, -0.018])


@pytest.fixture(scope="module")
def pairs(table):
    """Settings and the same moved outward; the gripper alone can exceed the table's range."""
    sources = (
        Weight("brass", 0.1, np.array([0.02, 0.0, -0.018]), 10.0),
        Actuator("gripper", *np.outer([-1.0, 1.0], [20.0] * 3 + [0.1] * 3), HANDLE, True, 1.0),
    )
    gravity = table.geometry.gravity
    drawn = draw_settings(table.workspace, sources, gravity, np.random.default_rng(3))
    return [(each, moved_outward(each, table.workspace)) for each in drawn[:30]]


def allowed(table, setting, theta):
    """Tell whether a pose may be visited with the setting's load, from every side."""
    workspace = table.workspace
    if not workspace.operative(theta):
        return False
    if workspace.mechanism.tilt(theta) > TILT_SHARE * workspace.limits.operative_tilt:
        return False
    for side in ([1, 1], [1, -1], [-1, 1], [-1, -1]):
        before = theta - APPROACH * np.array(side)
        for start, end in ((np.zeros(2), before), (before, theta), (theta, np.zeros(2))):
            if not straight(workspace, start, end):
                return False
    way = theta + APPROACH * np.linspace(-1.0, 1.0, 9)[:, None] * setting.approach
    wrench = setting.load.wrench(workspace.mechanism.forward(way).platform)
    limits = table.geometry.limits
    force, moment = (np.linalg.norm(wrench[:, i : i + 3], axis=1).max() for i in (0, 3))
    # A gripper may press to the very end of the range: turning its couple rounds.
    return force <= limits.force * (1.0 + 1e-12) and moment <= limits.moment * (1.0 + 1e-12)


def test_a_setting_moves_straight_outward_and_no_further_than_it_may(table, pairs):
    further = 0
    for drawn, moved in pairs:
        near, far = np.linalg.norm(drawn.theta), np.linalg.norm(moved.theta)
        assert far >= near
        assert moved.theta / far == pytest.approx(drawn.theta / near)
        assert allowed(table, drawn, moved.theta)
        assert not allowed(table, drawn, moved.theta * (1.0 + np.radians(8.0) / far))
        further += far > 1.2 * near
    assert further > len(pairs) / 2


def test_load_and_approach_stay_as_they_were(pairs):
    for drawn, moved in pairs:
        assert moved.load is drawn.load
        assert np.array_equal(moved.approach, drawn.approach)
        assert (moved.carried, moved.speed) == (drawn.carried, drawn.speed)
