"""Old commands, commands beyond the limits, and plans that are corrected beside commands."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.safety import require_fresh
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import InputError, StaleCommandError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law

NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
EVERY_LOAD = StreamSettings(supervisor=SupervisorSettings(follow=True))


@pytest.fixture
def stream(make_table):
    play = Effect(find_law("backlash"), "motor_1", {"width_mdeg": Estimate(60.0)})
    model = ErrorModel("play", make_table(softness=1.0), "closed_form", (play,))
    stream = CorrectionStream(model, EVERY_LOAD, enabled=True)
    stream.loads.add(SECOND, "wrist_base", (0.3, 0.0, -2.0), (0.0, 0.0, 0.0))
    return stream


@pytest.mark.parametrize(("age_s", "limit_s"), [(0.49, 0.5), (-0.49, 0.5), (1e6, 0.0)])
def test_a_fresh_command_passes_and_a_limit_of_zero_is_none(age_s, limit_s):
    require_fresh("command", 7 * SECOND, 7 * SECOND + round(age_s * SECOND), limit_s)


@pytest.mark.parametrize(("age_s", "text"), [(0.51, "0.510 s old"), (-3.0, "3.000 s ahead")])
def test_an_old_command_and_one_of_another_clock_are_refused(age_s, text):
    with pytest.raises(StaleCommandError, match=text):
        require_fresh("command", 7 * SECOND, 7 * SECOND + round(age_s * SECOND), 0.5)


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("steps", [1.01, -1.01, 1e300])
def test_a_command_beyond_the_joint_limits_is_refused(stream, enabled, steps):
    stream.enabled = enabled
    limits = stream.model.table.geometry.limits
    edge = limits.joint_upper if steps > 0.0 else limits.joint_lower
    theta = [0.0, edge[1] + steps * limits.encoder_step]
    with pytest.raises(InputError, match="motor_2_joint at .* is beyond its limits of -78 to 78"):
        stream.on_command(SECOND, "", NAMES, theta)
    plan = [planned_point(2, [0.0, 0.0]), planned_point(2, np.clip(theta, -1e8, 1e8).tolist())]
    with pytest.raises(InputError, match="trajectory: motor_2_joint"):
        stream.on_trajectory(SECOND, "", NAMES, plan)


def test_a_command_at_the_limit_but_for_rounding_passes(stream):
    stream.enabled = False
    upper = stream.model.table.geometry.limits.joint_upper
    theta = [0.0, np.nextafter(upper[1], 9.0)]
    assert stream.on_command(SECOND, "", NAMES, theta).theta == pytest.approx(theta, abs=1e-15)


def test_a_plan_is_corrected_as_if_no_command_came_meanwhile(stream):
    """With backlash the correction depends on what was before; settings change the objective."""
    points = [planned_point(2, [0.1 * np.sin(i), -0.05 * i], [0.1, 0.2]) for i in range(4)]
    at_once = stream.on_trajectory(SECOND, "", NAMES, points)
    work = stream.trajectory_work(SECOND, "", NAMES, points)
    for i in range(100):
        try:
            next(work)
        except StopIteration as end:
            meanwhile = end.value
            break
        stream.on_command(SECOND + i, "", NAMES, [0.2 * (-1) ** i, 0.1])
        stream.settings = replace(EVERY_LOAD, objective="tool_point")
    assert i == 4 * len(points)
    assert at_once.fault is None
    for one, other in zip(at_once.points, meanwhile.points, strict=True):
        assert np.array_equal(one.positions, other.positions)
        assert np.array_equal(one.velocities, other.velocities)


def test_a_correction_fades_while_it_is_paused(stream):
    for i in range(1, 20):
        given = stream.on_command(SECOND + i * SECOND // 50, "", NAMES, [0.1, -0.2])
    before = given.theta - [0.1, -0.2]
    assert np.abs(before).max() > 1e-5
    stream.active = False
    stream.resume(0.5 * np.abs(before).max() / stream.settings.safety.slew)
    assert np.abs(stream.applied).max() == pytest.approx(0.5 * np.abs(before).max())
    stream.resume(1.0)
    assert not stream.applied.any()


@pytest.mark.parametrize("released", [True, False])
def test_after_a_pause_a_payload_must_be_seen_again(stream, released):
    """It may have been released meanwhile: the first command must not carry its correction."""
    stream.settings = StreamSettings()

    def last(first, seconds, newtons):
        for i in range(first, first + round(50 * seconds)):
            stamp = SECOND + i * SECOND // 50
            stream.loads.add(stamp, "wrist_base", [0.0, 0.0, -newtons], [0.0, 0.0, 0.0])
            given = stream.on_command(stamp, "", NAMES, [0.1, -0.2])
        return np.abs(given.theta - [0.1, -0.2]).max()

    none, full = last(0, 3.0, 0.0), last(150, 4.0, 3.0)
    assert full > none + 1e-5
    stream.active = False
    stream.resume(2.0)
    assert last(450, 0.02, 0.0 if released else 3.0) <= none
    again = last(451, 4.0, 0.0 if released else 3.0)
    assert again == pytest.approx(none if released else full, rel=0.05)
