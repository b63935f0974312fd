"""A plan keeps to its rules, to the wrist's limits and to the loads that the user listed."""

import numpy as np
import pytest

from wrist_stiffness.errors import InputError, LoadRangeError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.effects.motor_turn import Backlash
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import effect_named, find_law
from wrist_stiffness.planning import plan as planning
from wrist_stiffness.planning import pool
from wrist_stiffness.planning import question as design_question
from wrist_stiffness.planning.information import MeasurementNoise
from wrist_stiffness.planning.loads_file import Actuator, Weight
from wrist_stiffness.planning.plan import Conditions, plan
from wrist_stiffness.planning.question import between
from wrist_stiffness.planning.timeline import PEAK, Pace, Visit, run_through

WEIGHT = Weight("brass", 0.1, np.array([0.02, 0.0, -0.018]), 10.0)
GRIPPER = Actuator(
    "gripper",
    np.repeat([-1.0, -0.01], 3),
    np.repeat([1.0, 0.01], 3),
    np.array([0.0, 0.0, -0.018]),
    True,
    1.0,
)
SPEED = np.radians(30.0)


@pytest.fixture(autouse=True)
def small_pool(monkeypatch):
    """Fewer settings to choose from, for the time of the tests."""
    monkeypatch.setattr(pool, "POOL", 10)


def conditions(model, sources=(WEIGHT, GRIPPER), minutes=None, seed=0, **pace):
    values = {"speed": SPEED, "dwell_s": 2.0, "in_motion": True, **pace}
    white = np.repeat([1e-6, np.radians(1e-3)], 3)
    noise = MeasurementNoise(white, model.table.geometry.limits.encoder_step)
    seconds = None if minutes is None else 60.0 * minutes
    return Conditions(sources, Pace(**values), noise, seconds, seed)


def rivals():
    backlash = effect_named("backlash@motor_1").with_values({"width_mdeg": 10.0})
    return between([[backlash, effect_named("drive_compliance@motor_1")]], [], generator())


def generator():
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def longer(model):
    patch = pytest.MonkeyPatch()
    patch.setattr(pool, "POOL", 10)
    try:
        return plan(model, rivals(), conditions(model, minutes=25.0))
    finally:
        patch.undo()


@pytest.mark.slow
def test_the_duration_is_kept_and_used(longer):
    assert 22.0 * 60.0 < longer.timeline.duration_s <= 25.0 * 60.0


@pytest.mark.slow
def test_the_shortest_plan_is_arranged_twice_at_most(model, monkeypatch):
    """Without visits only the warm-up can be drawn again, which may always be too long."""
    lasted, arranged = [], planning._Pool.arranged

    def told(*of_visits):
        timeline = arranged(*of_visits)
        lasted.append(timeline.duration_s)
        return timeline

    monkeypatch.setattr(planning._Pool, "arranged", told)
    for seed in range(2):
        with pytest.raises(InputError, match="minutes are less than the"):
            plan(model, rivals(), conditions(model, minutes=1.0, seed=seed))
        most = lasted.pop() + 0.01
        found = plan(model, rivals(), conditions(model, minutes=most / 60.0, seed=seed))
        assert found.visits == ()
        assert found.timeline.duration_s <= most
        assert len(lasted) <= 2
        lasted.clear()


@pytest.mark.parametrize(("whole", "further"), [(False, True), (True, False)])
def test_between_rivals_poses_may_be_moved_outward(model, whole, further):
    """Most effects differ most there; a whole wrist is measured where it was drawn."""
    asked = conditions(model)
    drawn = pool.draw_settings(
        model.table.workspace, asked.sources, model.table.geometry.gravity, generator()
    )
    known = {tuple(each.theta) for each in drawn}
    visits = planning._Pool(model, asked, whole, generator()).visits_of(range(len(drawn)))
    assert {tuple(each.theta) for each in visits} <= known
    every = planning._Pool(model, asked, whole, generator()).timeline.dwells
    reach = max(np.linalg.norm(each.visit.theta) for each in every)
    assert (reach > 1.05 * max(np.linalg.norm(theta) for theta in known)) == further


def test_a_plan_without_room_for_a_visit_is_the_shortest_one(model):
    """Arranged anew it would draw another warm-up, which may be too long."""
    settings, rng = planning._Pool(model, conditions(model), False, generator()), generator()
    shortest = settings.arranged([], rng)
    visits, timeline = settings.within(shortest.duration_s, [0, 1], shortest, rng)
    assert visits == []
    assert timeline is shortest


def test_moves_keep_to_speed_joint_limits_and_domain(model, longer):
    knots = longer.timeline.knots
    time = np.array([knot[0] for knot in knots])
    theta = np.array([knot[1] for knot in knots])
    assert np.all(np.diff(time) > 0.0)
    peak = PEAK * np.abs(np.diff(theta, axis=0)) / np.diff(time)[:, None]
    assert peak.max() <= SPEED * (1.0 + 1e-9)
    limits, along = model.table.geometry.limits, np.linspace(0.0, 1.0, 30)[:, None, None]
    path = (theta[:-1] + along * np.diff(theta, axis=0)).reshape(-1, 2)
    assert np.all((path >= limits.joint_lower) & (path <= limits.joint_upper))
    assert model.table.workspace.domain(path).all()
    dwells = np.array([dwell.visit.theta for dwell in longer.timeline.dwells])
    assert model.table.workspace.operative(dwells).all()


def test_every_load_is_listed_and_in_the_tables_range(model, longer):
    assert {dwell.load.name for dwell in longer.timeline.dwells} <= {"", "brass", "gripper"}
    assert model.accepts(longer.timeline.block).all()
    for dwell in longer.timeline.dwells:
        if dwell.load.name == "brass":
            assert np.allclose(dwell.wrench[:3], [0.0, 0.0, -0.981])
        if dwell.load.name == "":
            assert not dwell.wrench.any()


def test_without_listed_loads_none_is_proposed(model):
    found = plan(model, rivals_without_load(), conditions(model, sources=(), minutes=5.0))
    assert {dwell.load.name for dwell in found.timeline.dwells} == {""}


def rivals_without_load():
    backlash = effect_named("backlash@motor_1").with_values({"width_mdeg": 10.0})
    return between([[backlash, effect_named("encoder_eccentricity@motor_1")]], [], generator())


def of_few_laws(monkeypatch, *names):
    few = {name: find_law(name) for name in names}
    monkeypatch.setattr(design_question, "catalogue", lambda: few)
    return design_question.commissioning(generator())


def test_a_commissioning_approaches_each_pose_from_both_sides_in_random_order(model, monkeypatch):
    question = of_few_laws(monkeypatch, "backlash")
    found = plan(model, question, conditions(model, minutes=8.0, in_motion=False))
    sides = {}
    order = []
    for visit in dict.fromkeys(dwell.visit for dwell in found.timeline.dwells):
        if visit.purpose == "setting":
            sides.setdefault(tuple(visit.theta), []).append(visit.approach)
            order.append(tuple(visit.theta))
    assert len(sides) > 3
    for approaches in sides.values():
        assert np.allclose(np.sum(approaches, axis=0), 0.0)
    neighbours = sum(a == b for a, b in zip(order[:-1], order[1:], strict=True))
    assert neighbours < 0.3 * len(order)


def test_between_rivals_only_the_sides_that_tell_are_visited(model, longer):
    """A lost motion needs both sides of something; no pose needs both for its own sake."""
    visits = longer.visits
    assert len({tuple(visit.approach) for visit in visits}) > 1
    sides = {}
    for visit in visits:
        sides.setdefault(tuple(visit.theta), set()).add(tuple(visit.approach))
    assert any(len(approaches) == 1 for approaches in sides.values())
    performed = {d.visit for d in longer.timeline.dwells if d.purpose.startswith("setting")}
    assert performed == set(visits)


def test_the_last_motion_is_the_approach_that_the_table_names(longer):
    knots = longer.timeline.knots
    for dwell in longer.timeline.dwells:
        before = [knot[1] for knot in knots if knot[0] <= dwell.time_s + 1e-9]
        steps = np.diff(before, axis=0)
        last = steps[np.any(steps != 0.0, axis=1)][-1]
        assert np.array_equal(np.sign(np.round(last, 9)), dwell.visit.approach)


def test_warm_up_reference_poses_holds_and_zero_loads(longer):
    timeline = longer.timeline
    first = timeline.dwells[0]
    assert 0.07 * timeline.duration_s < first.time_s < 0.15 * timeline.duration_s
    reference = np.array([d.time_s for d in timeline.dwells if d.purpose == "reference pose"])
    assert reference[0] == first.time_s
    assert np.diff(reference).max() <= 600.0
    assert timeline.dwells[-1].purpose == "reference pose"
    assert sum(d.hold_s == 60.0 for d in timeline.dwells) == 2
    for number, visit in enumerate(dict.fromkeys(d.visit for d in timeline.dwells)):
        own = [d for d in timeline.dwells if d.visit is visit]
        loaded = [bool(d.load.name) for d in own]
        if any(loaded):
            # The load goes off again while the wrist rests, or was not on when it came to rest.
            assert sorted(loaded) == [False, True], number


@pytest.mark.slow
def test_the_same_seed_gives_the_same_plan_and_another_one_another(model):
    plans = [
        plan(model, rivals(), conditions(model, minutes=5.0, seed=seed, in_motion=False)).timeline
        for seed in (3, 3, 4)
    ]
    tables = [np.array([knot[0] for knot in each.knots]) for each in plans]
    assert np.array_equal(tables[0], tables[1])
    assert not np.array_equal(tables[0], tables[2])


def test_a_plan_without_a_duration_ends_where_its_questions_are_settled(model, longer):
    short = plan(model, rivals(), conditions(model))
    assert all(answer.settled for answer in short.answers)
    assert short.timeline.duration_s < 0.5 * longer.timeline.duration_s


def test_a_pose_sensor_that_needs_rest_is_not_asked_in_motion(model):
    found = plan(model, rivals(), conditions(model, minutes=6.0, in_motion=False, dwell_s=8.0))
    assert not found.timeline.moving.any()
    assert {d.hold_s for d in found.timeline.dwells} == {8.0, 60.0}


def test_a_commissioning_calibrates_and_tells_apart(model, monkeypatch):
    """With a catalogue of three laws, one of which needs a thermometer."""
    names = ("backlash", "drive_compliance", "thermal_softening")
    found = plan(model, of_few_laws(monkeypatch, *names), conditions(model, minutes=8.0))
    assert found.timeline.duration_s <= 480.0
    assert found.cannot.keys() == {f"thermal_softening@joint_{i}" for i in range(1, 6)}
    motors = [f"{name}@motor_{i}" for name in names[:2] for i in (1, 2)]
    pairs = {(answer.goal.truth, answer.goal.rival) for answer in found.answers}
    assert pairs == {(a, b) for a in motors for b in ("", *motors) if a != b}
    assert all(answer.reachable for answer in found.answers)
    assert all(answer.settled for answer in found.answers if not answer.goal.rival)
    always = {*design_question.SESSION, *design_question.WRIST}
    assert found.calibration.keys() == always
    assert min(found.calibration.values()) >= 1.0
    assert found.calibration["axis_misalignment@joint_2"] > 3.0


def test_exact_twins_get_no_plan_but_a_clear_answer(model):
    """Two names for one lost motion: nothing that anybody can do tells them apart."""

    class LostMotion(Backlash):
        id = "lost_motion"

    twins = [
        Effect(law, "motor_1", {"width_mdeg": Estimate(30.0)}) for law in (Backlash(), LostMotion())
    ]
    found = plan(model, between([twins], [], generator()), conditions(model))
    assert found.timeline is None
    assert [answer.reachable for answer in found.answers] == [False, False]
    assert max(answer.discrimination for answer in found.answers) < 0.5


def test_too_short_a_time_and_loads_out_of_range_are_refused(model):
    begun = []
    with pytest.raises(InputError, match=r"plan: 2 minutes are less than the \d.\d that warm-up"):
        plan(model, rivals(), conditions(model, minutes=2.0), progress=lambda *_: begun.append(1))
    assert not begun, "the laws were evaluated before"
    far = Weight("far", 0.1, np.array([0.2, 0.2, 0.0]), 1.0)
    with pytest.raises(LoadRangeError, match="load far: beyond the table's range of 5 N and 0.1"):
        plan(model, rivals(), conditions(model, sources=(far,)))


def test_nothing_to_separate_is_refused():
    lonely = effect_named("backlash@motor_1").with_values({"width_mdeg": 10.0})
    with pytest.raises(InputError, match="leaves nothing to separate"):
        between([[lonely]], [], generator())


@pytest.mark.parametrize("speed_deg_per_s", [30.0, 200.0, 3000.0])
def test_time_rises_however_fast_the_motors_are(model, speed_deg_per_s):
    """What is sampled just before an observed moment lies after the one observed before it."""
    pace = Pace(np.radians(speed_deg_per_s), 2.0, True)
    visit = Visit(np.array([0.3, -0.2]), np.array([1.0, 1.0]))
    timeline = run_through([visit], model.table.workspace, pace)
    assert np.all(np.diff(timeline.block.time) >= 0.0)
    assert timeline.moving.sum() == 3
