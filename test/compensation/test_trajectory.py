"""Speeds and accelerations of a corrected plan, against differences in time of its positions."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.compiled import CorrectedRows
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.registry import find_law

NAMES = ("motor_2_joint", "gripper", "motor_1_joint")
SECOND = 1_000_000_000
EVERY_LOAD = StreamSettings(supervisor=SupervisorSettings(follow=True))
# Shares of the correction's own speed and acceleration: truncation and search error of both sides.
SPEED, ACCELERATION = 1e-3, 0.03


@pytest.fixture(scope="module")
def stream(make_table):
    """A wrist so soft that its corrections reach a degree."""
    model = ErrorModel("soft", make_table(softness=60.0), "closed_form")
    stream = CorrectionStream(model, replace(EVERY_LOAD, correction_limit=0.2), enabled=True)
    stream.loads.add(SECOND, "wrist_base", (0.3, 0.0, -2.0), (0.0, 0.0, 0.0))
    return stream


def plan(t):
    """Angles, speeds and accelerations of all joints at a time [s]."""
    angles = np.array([0.3 * np.sin(2.0 * t), t, 0.4 * np.cos(1.5 * t)])
    speeds = np.array([0.6 * np.cos(2.0 * t), 1.0, -0.6 * np.sin(1.5 * t)])
    return angles, speeds, np.array([-4.0 * angles[0], 0.0, -2.25 * angles[2]])


def corrected(stream, times):
    points = [planned_point(3, *plan(t)) for t in times]
    answer = stream.on_trajectory(SECOND, "", NAMES, points)
    assert answer.fault is None
    return answer.points


def test_speeds_and_accelerations_are_those_of_the_corrected_path(stream):
    step_s = 1e-2
    for t in np.linspace(0.0, 3.0, 7):
        before, here, after = corrected(stream, [t - step_s, t, t + step_s])
        _, speeds, accelerations = plan(t)
        added = here.velocities - speeds
        motion = [np.stack(plan(x)[0]) for x in (t - step_s, t, t + step_s)]
        change = [p.positions - m for p, m in zip((before, here, after), motion, strict=True)]
        wanted = (change[2] - change[0]) / (2.0 * step_s)
        assert np.allclose(added, wanted, rtol=0, atol=SPEED * np.abs(wanted).max() + 1e-7)
        wanted = (change[2] - 2.0 * change[1] + change[0]) / step_s**2
        added = here.accelerations - accelerations
        assert np.allclose(added, wanted, rtol=0, atol=ACCELERATION * np.abs(wanted).max() + 1e-4)
        assert np.abs(here.velocities - speeds).max() > 1e-5
        assert (here.positions[1], here.velocities[1], here.accelerations[1]) == (t, 1.0, 0.0)


def test_what_the_plan_does_not_have_is_not_made_up(stream):
    (point,) = stream.on_trajectory(SECOND, "", NAMES, [planned_point(3, plan(0.5)[0])]).points
    assert (len(point.velocities), len(point.accelerations)) == (0, 0)


def test_at_rest_a_plan_stays_at_rest(stream):
    planned = planned_point(3, [0.1, 0.0, 0.2], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0])
    (point,) = stream.on_trajectory(SECOND, "", NAMES, [planned]).points
    assert point.velocities.tolist() == [0.0, 0.5, 0.0]
    assert point.accelerations.tolist() == [0.0, 0.0, 0.0]


def test_at_the_border_the_speed_is_that_of_the_plan(stream):
    """The correction has faded with a continuous slope; beyond the border there is none.

    The differences reach back into the fade by a seventh of its width.
    """
    _, upper = stream.model.table.workspace.rectangle
    planned = planned_point(3, [0.0, 0.0, upper[0] - 1e-4], [0.0, 0.0, 1.0])
    answer = stream.on_trajectory(SECOND, "", NAMES, [planned])
    assert answer.fault is None
    (point,) = answer.points
    assert point.velocities == pytest.approx([0.0, 0.0, 1.0], abs=0.01)


def test_what_is_not_corrected_has_nothing_of_what_was_in_memory(stream, monkeypatch):
    """Beyond the border, where another search takes over, rows of answers stay as they were."""
    own = CorrectedRows.room

    def room(*sizes):
        found = own(*sizes)
        found.rows.fill(np.inf)
        return found

    monkeypatch.setattr(CorrectedRows, "room", room)
    _, upper = stream.model.table.workspace.rectangle
    planned = planned_point(3, [0.0, 0.0, upper[0] - 1e-4], [0.0, 0.0, 1.0])
    answer = stream.on_trajectory(SECOND, "", NAMES, [planned])
    assert answer.fault is None
    assert np.isfinite(answer.points[0].positions).all()


def sent(model, effects, pause_ms, speed):
    """Return what is added to a plan that begins some time after a command."""
    stream = CorrectionStream(model.with_effects(*effects), EVERY_LOAD, enabled=True)
    last_ns = SECOND + 10_000_000
    begin_ns = last_ns + 1_000_000 * pause_ms
    for stamp_ns in (SECOND, last_ns, begin_ns):
        stream.loads.add(stamp_ns, "wrist_base", (0.0, 0.0, -0.5), (0.0, 0.0, 0.0))
    for stamp_ns in (SECOND, last_ns):
        stream.on_command(stamp_ns, "", NAMES[::-2], (0.0, 0.0))
    points = [planned_point(2, (angle, 0.0), speed) for angle in (0.0, 0.1, 0.6)]
    done = stream.on_trajectory(begin_ns, "", NAMES[::-2], points)
    assert done.fault is None
    return np.array([a.positions - b.positions for a, b in zip(done.points, points, strict=True)])


def test_the_way_to_a_point_of_a_plan_is_no_motion(model):
    """Its speed is what the plan says, if anything, however soon after the last command."""
    viscous = FormulaLaw("own", "platform", np.eye(6)[3], "1e-4 * theta_dot_1 * k", [], ["k"])
    mass = effect_at(find_law("inertia"), "platform", {"mass_g": 100.0, "z_mm": -30.0})
    effects = mass, Effect(viscous, "platform", {})
    at_rest, moving = sent(model, (), 0, ()), sent(model, effects, 0, (1.0, 0.0))
    assert np.abs(moving - at_rest).max() > 1e-5
    for pause_ms in (1, 10, 500):
        found = sent(model, effects, pause_ms, ()), sent(model, effects, pause_ms, (1.0, 0.0))
        assert np.allclose(found, (at_rest, moving), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_a_correction_that_is_tried_is_no_motion_either(model, rate_hz):
    """Commands without speeds are corrected as those with them."""
    mass = effect_at(find_law("inertia"), "platform", {"mass_g": 300.0, "z_mm": -30.0})
    ends = []
    for speeds in ((), (0.0, 0.0)):
        stream = CorrectionStream(model.with_effects(mass), EVERY_LOAD, enabled=True)
        for number in range(rate_hz // 5):
            stamp_ns = SECOND + number * SECOND // rate_hz
            stream.loads.add(stamp_ns, "wrist_base", (2.0, 2.0, -3.0), (0.0, 0.0, 0.0))
            done = stream.on_command(stamp_ns, "", NAMES[::-2], (0.1, 0.3), speeds)
            assert done.fault is None
        ends.append(stream.applied.tolist())
    assert ends[0] == ends[1]
    assert any(ends[0])


def test_a_command_without_speeds_has_those_of_the_way_from_the_last(model):
    """Where no time passes, or there is no stamp, it moves on as before: it does not stop."""
    turn = FormulaLaw("own", "platform", np.eye(6)[3], "1e-3 * theta_dot_1 * k", [], ["k"])
    mass = effect_at(find_law("inertia"), "platform", {"mass_g": 30.0, "z_mm": -30.0})
    moving = model.with_effects(mass, Effect(turn, "platform", {}))
    stamps = [101, 102, 102, 104, None, 106, 106, 106, 107, 103]
    speeds = [0.0, *[0.5] * 8, 0.0]
    sent = []
    for said in (lambda speed: (), lambda speed: (speed, 0.0)):
        stream = CorrectionStream(moving, EVERY_LOAD, enabled=True)
        for number, (stamp, speed) in enumerate(zip(stamps, speeds, strict=True)):
            at = stamp or 105
            angle = 0.1 + 0.005 * (at - 101)
            stamp_ns = at * SECOND // 100
            stream.loads.add(stamp_ns, "wrist_base", (0.0, 0.0, -3.0), (0.0, 0.0, 0.0))
            done = stream.on_command(
                stamp_ns if stamp else 0, "", NAMES[::-2], (angle, 0.3), said(speed), stamp_ns
            )
            assert (done.fault is None) == (number not in (4, 9))
            sent.append(done.positions)
    assert np.allclose(sent[:10], sent[10:], rtol=0.0, atol=1e-9)


BAD = {
    "short": ((0.0, 0.0), (), (), "2 positions for 3 names"),
    "nan": ((0.0, float("nan"), 0.0), (), (), "positions .* are not finite"),
    "speed": ((0.0,) * 3, (0.0, 0.0, float("inf")), (), "velocities .* are not finite"),
    "beyond": ((0.0,) * 3, (0.0, 0.0, 1e308), (), "beyond 1e.09"),
    "speeds": ((0.0,) * 3, (0.0,), (), "1 velocities for 3 names"),
    "acceleration": ((0.0,) * 3, (), (float("nan"),) * 3, "accelerations .* are not finite"),
}


@pytest.mark.parametrize(("positions", "speeds", "accelerations", "text"), BAD.values(), ids=BAD)
def test_a_point_that_is_none_is_refused(positions, speeds, accelerations, text):
    with pytest.raises(InputError, match=text):
        planned_point(3, positions, speeds, accelerations)
