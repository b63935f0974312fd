"""Gram matrices and discriminations against dense least squares; signatures against the model."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.planning.aims import Aims, Truths, after_data, as_asked
from wrist_stiffness.planning.information import (
    FREE,
    MOTION_NOISE,
    Goal,
    Information,
    Layout,
    MeasurementNoise,
    calibrated,
    carried_over,
    discrimination,
    improvement,
    information,
    whitened,
)
from wrist_stiffness.planning.loads_file import NO_LOAD, AppliedLoad
from wrist_stiffness.planning.question import SESSION, between, commissioning
from wrist_stiffness.planning.rivals import LEAST_WHITE, dwell_noise
from wrist_stiffness.planning.signatures import plausible, signatures
from wrist_stiffness.planning.timeline import LOAD_RAMP_S, Pace, Visit, as_experiment, run_through
from wrist_stiffness.sessions.measured_session import MeasuredSession

LOAD = AppliedLoad(
    "push", np.array([0.3, 0.2, -1.0]), np.array([0.004, 0.0, 0.002]), np.zeros(3), True, True, 1.0
)
NUISANCES = ("measurement_frame@pose_sensor", "load_bias@load_sensor")
EFFECTS = {
    "backlash@motor_1": {"width_mdeg": 20.0},
    "drive_compliance@motor_1": {"compliance_mdeg_per_Nm": 500.0},
    "mount_compliance@motor_1": {},
}


@pytest.fixture(scope="module")
def timeline(model):
    rng = np.random.default_rng(1)
    visits = [
        Visit(
            np.radians(rng.uniform(-30.0, 30.0, 2)),
            rng.choice([-1.0, 1.0], 2),
            NO_LOAD if number % 3 == 0 else LOAD,
            number % 2 == 0,
            hold_s=60.0 if number == 4 else 2.0,
        )
        for number in range(9)
    ]
    pace = Pace(np.radians(30.0), 2.0, True)
    return run_through(visits, model.table.workspace, pace)


@pytest.fixture(scope="module")
def evaluated(model, timeline):
    rng = np.random.default_rng(0)
    nuisances = [(effect_named(name),) for name in NUISANCES]
    effects = []
    for name, values in EFFECTS.items():
        effect = effect_named(name).with_values(values)
        effects.append((effect,) if values else (plausible(effect, rng), plausible(effect, rng)))
    found = signatures(model, timeline.block, [*nuisances, *effects])
    return found[: len(nuisances)], found[len(nuisances) :]


NOISE = MeasurementNoise(np.array([1.0, 2.0, 1.5, 20.0, 15.0, 30.0]) * 1e-6, 2.6e-4)


@pytest.fixture(scope="module")
def known(model, timeline, evaluated):
    return information(timeline, *(evaluated[0], SESSION, evaluated[1]), model.table, NOISE)


def dense(model, timeline, nuisances, truth, rival):
    """Return d by stacking everything and solving with the whole covariance at once."""
    table, rows = model.table, timeline.rows
    blocks = []
    for visit in range(timeline.visit.max() + 1):
        own = np.flatnonzero(timeline.visit == visit)
        size = 6 * len(own)
        block = np.zeros((size, size))
        for i, a in enumerate(own):
            for j, b in enumerate(own):
                at = [timeline.block.theta[rows[k]] for k in (a, b)]
                jacobians = [table.mechanism.jacobian(table.mechanism.forward(t)) for t in at]
                shared = a == b or not (timeline.moving[a] or timeline.moving[b])
                part = np.zeros((6, 6))
                part[3:, 3:] = shared * NOISE.encoder_step**2 / 12 * jacobians[0] @ jacobians[1].T
                if a == b:
                    scale = MOTION_NOISE if timeline.moving[a] else 1.0
                    part += np.diag((scale * NOISE.white) ** 2)
                block[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = part
        blocks.append(block)
    order = np.concatenate(
        [np.flatnonzero(timeline.visit == visit) for visit in range(timeline.visit.max() + 1)]
    )
    root = np.linalg.cholesky(np.linalg.inv(block_diag(*blocks))).T

    def stacked(values):
        return root @ values[rows[order]].reshape(6 * len(order), -1)

    y = stacked(truth)
    columns = [stacked(each.columns) for each in nuisances]
    ridge = [
        np.full(c.shape[1], 1 / FREE if "frame" in n.name else 1.0)
        for c, n in zip(columns, nuisances, strict=True)
    ]
    if rival is not None:
        columns.append(stacked(rival.columns))
        ridge.append(np.full(columns[-1].shape[1], 1 / FREE))
    design = np.hstack(columns)
    augmented = np.vstack([design, np.diag(np.concatenate(ridge))])
    target = np.vstack([y, np.zeros((design.shape[1], y.shape[1]))])
    left = target - augmented @ np.linalg.lstsq(augmented, target, rcond=None)[0]
    return np.sum(left**2, axis=0)


def seen_log_det(gram, layout, name):
    """How much smaller than a plausible size the uncertainty of an effect's parameters is."""
    p = len(layout.prior)
    places = np.concatenate([np.arange(p), p + layout.columns[name]])
    prior = np.concatenate([layout.prior, np.ones(len(layout.columns[name]))])
    covariance = np.linalg.inv(gram[np.ix_(places, places)] + np.diag(prior))
    return -np.linalg.slogdet(covariance[p:, p:])[1]


@pytest.mark.parametrize(("truth", "rival"), [(0, None), (1, 2), (2, 1), (2, 0), (0, 1)])
def test_discrimination_is_the_distance_of_dense_least_squares(
    model, timeline, evaluated, known, truth, rival
):
    nuisances, effects = evaluated
    apart = dense(
        model, timeline, nuisances, effects[truth].truths, None if rival is None else effects[rival]
    )
    goal = Goal(effects[truth].name, "" if rival is None else effects[rival].name)
    if rival is not None:
        own = dense(model, timeline, nuisances, effects[truth].truths, None)
        both = (effects[each].name for each in (truth, rival))
        charge = np.diff([seen_log_det(known.total, known.layout, name) for name in both])
        apart = np.clip(apart + charge, 0.0, own)
    found = discrimination(known.total, known.layout, [goal])[0]
    # Over several truths the bound on a wrong answer is averaged.
    wrong = np.exp(-0.125 * apart).mean()
    assert found == pytest.approx(np.sqrt(-8.0 * np.log(wrong)), rel=1e-5, abs=1e-4)


def test_parameters_that_no_measurement_tells_cost_nothing():
    white = np.random.default_rng(3).normal(size=(40, 3))
    found = []
    for silent in (0, 20):
        columns = np.hstack([white[:, :1], np.zeros((40, silent)), white[:, 1:]])
        own, rival, whole = np.arange(1 + silent), np.array([1 + silent]), np.array([2 + silent])
        layout = Layout(np.zeros(0), {}, {"a": own, "b": rival}, {"a": whole})
        found.append(discrimination(columns.T @ columns, layout, [Goal("a", "b")])[0])
    assert found[0] > 1.0
    assert found[1] == pytest.approx(found[0])


def test_a_plan_between_rivals_does_not_wait_for_what_hardly_shows():
    one, other, hardly = np.eye(30)[:3] * [[20.0], [20.0], [2.0]]
    columns = np.stack([one, other, hardly, one, other, hardly], axis=1)
    places = {name: np.array([at]) for at, name in enumerate("abc")}
    truths = {name: np.array([3 + at]) for at, name in enumerate("abc")}
    layout = Layout(np.zeros(0), {}, places, truths)
    gram = columns.T @ columns
    pool = Information(gram[None], layout)

    def own(*goals):
        return Aims(Truths(np.eye(6), layout), pool, np.zeros((6, 6)), goals, everything=False)

    rivals, seen = (Goal("a", "b"), Goal("b", "a")), Goal("c", "")
    assert own(*rivals, seen).reachable == (*rivals, seen)
    assert own(*rivals, seen).settled(gram)
    assert not own(seen).settled(gram)
    assert not own(*rivals, seen).settled(gram / 100.0)


def test_visits_add_up_and_rivals_without_data_are_equally_large(known):
    assert np.allclose(known.total, known.grams.sum(axis=0))
    goals = [Goal("backlash@motor_1", ""), Goal("drive_compliance@motor_1", "")]
    before = discrimination(known.total, known.layout, goals)
    truths = as_asked(known, [[goal.truth for goal in goals]])
    equal = discrimination(truths.of(known.total), truths.layout, goals)
    assert equal == pytest.approx([before[0], before[0]])
    columns = len(known.layout.prior) + known.layout.columns["drive_compliance@motor_1"]
    scaled = np.ix_(columns, columns)
    assert np.allclose(truths.of(known.total)[scaled], known.total[scaled])


def test_a_rival_is_what_fits_the_data_that_the_best_member_explains(model, timeline, evaluated):
    """As the rival stands, and what that leaves by one least squares over all measurements."""
    nuisances, effects = evaluated
    best, rival = effects[0], effects[2]
    known = information(timeline, nuisances, NUISANCES[:1], effects, model.table, NOISE)
    truths = after_data(
        known.total, known.layout, [[best.name, rival.name]], np.random.default_rng(0)
    )
    stacked = np.concatenate(
        [
            *(each.columns for each in nuisances),
            rival.columns,
            best.truths - rival.truths[..., :1],
        ],
        axis=2,
    )
    white = np.vstack(whitened(timeline, stacked, model.table, NOISE))
    count = rival.columns.shape[2]
    ridge = np.concatenate([np.sqrt(known.layout.prior), np.ones(count)])
    matrix = np.vstack([white[:, :-1], np.diag(ridge)])
    target = np.append(white[:, -1], np.zeros(len(ridge)))
    fitted = np.linalg.lstsq(matrix, target, rcond=None)[0][-count:]
    p = len(known.layout.prior)
    place = p + truths.layout.truths[rival.name][0]
    assert truths.combined[p + known.layout.columns[rival.name], place] == pytest.approx(
        fitted, rel=1e-6
    )
    whole = p + known.layout.truths[rival.name]
    assert truths.combined[whole, place] == pytest.approx([1.0, 0.0])


def test_draws_are_as_wide_as_the_data_leave_the_values(known):
    """Many draws: nearly the prior without data, nearly the best values with very many."""
    name = "drive_compliance@motor_1"
    alike = [["backlash@motor_1", name]]
    widths = []
    for share in (1e-9, 1.0, 1e6):
        rng = np.random.default_rng(1)
        values = []
        for _ in range(200):
            truths = after_data(share * known.total, known.layout, alike, rng)
            places = len(known.layout.prior) + truths.layout.truths[name]
            row = len(known.layout.prior) + known.layout.columns[name][0]
            values += list(np.diff(truths.combined[row, places[:2]]))
        widths.append(np.std(values))
    assert widths[0] == pytest.approx(1.0, rel=0.2)
    assert widths[0] > widths[1] > 100.0 * widths[2]


def test_more_measurements_never_harm(known):
    goals = [Goal(a, b) for a in EFFECTS for b in ("", *EFFECTS) if a != b]
    part, whole = known.grams[:5].sum(axis=0), known.total
    assert np.all(
        discrimination(whole, known.layout, goals)
        >= discrimination(part, known.layout, goals) - 1e-9
    )
    assert calibrated(whole, known.layout) > calibrated(part, known.layout) > 0.0
    gains = [improvement(gram, known.layout) for gram in (part, whole)]
    assert all(gains[1][name] >= gains[0][name] >= 1.0 for name in NUISANCES)


def test_only_what_comes_on_top_of_earlier_measurements_counts(known):
    goals = [Goal("backlash@motor_1", "drive_compliance@motor_1"), Goal("backlash@motor_1", "")]
    part, layout = known.grams[:5].sum(axis=0), known.layout
    on_top = discrimination(known.total, layout, goals, part)
    whole, before = (discrimination(gram, layout, goals) for gram in (known.total, part))
    assert on_top == pytest.approx(np.sqrt(whole**2 - before**2))
    assert np.all(discrimination(part, layout, goals, part) == 0.0)


def test_columns_of_a_linear_law_make_up_its_truth(model, timeline):
    """At values of which the tangent knows nothing, evaluated by the model itself."""
    values = {"x_um_per_N": 2.0, "turn_y_mdeg_per_Nm": 150.0}
    effect = effect_named("platform_compliance@platform").with_values(values)
    (found,) = signatures(model, timeline.block, [(effect,)])
    direct = (
        model.with_effects(effect).batch(timeline.block).measured
        - model.batch(timeline.block).measured
    )
    assert np.allclose(found.truths[..., 0], direct, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "within"),
    # A delay bends more, so its step is shorter.
    [("load_scale@load_sensor", 2.0, 0.01), ("time_delay@pose_sensor", 5.0, 0.001)],
)
def test_columns_are_the_derivative_by_one_plausible_size(model, timeline, name, value, within):
    (parameter,) = effect_named(name).parameters
    effect = effect_named(name).with_values({parameter.key: value})
    (found,) = signatures(model, timeline.block, [(effect,)])
    sides = [effect.with_values({parameter.key: value + step}) for step in (-0.01, 0.01)]
    twists = [model.with_effects(side).batch(timeline.block).measured for side in sides]
    slope = (twists[1] - twists[0]) / 0.02 * parameter.scale
    assert np.allclose(found.columns[..., 0], slope, atol=within * np.abs(slope).max())


def test_an_effect_that_the_model_has_is_asked_at_other_values(model, timeline):
    effect = effect_named("backlash@motor_1").with_values({"width_mdeg": 10.0})
    larger = effect.with_values({"width_mdeg": 30.0})
    (found,) = signatures(model.with_effects(effect), timeline.block, [(larger,)])
    twists = [model.with_effects(e).batch(timeline.block).measured for e in (effect, larger)]
    assert np.allclose(found.truths[..., 0], twists[1] - twists[0], atol=1e-12)


def test_an_effect_without_its_signal_is_named_and_left_out(model, timeline):
    effect = effect_named("thermal_softening@joint_2")
    (found,) = signatures(model, timeline.block, [(plausible(effect, np.random.default_rng(0)),)])
    assert found.lacks.startswith("temperature of")


def test_a_path_out_of_range_is_refused(model, timeline):
    far = replace(timeline.block, load=10.0 * timeline.block.load)
    with pytest.raises(InputError, match="lie outside the table's domain or load range"):
        signatures(model, far, [(effect_named("backlash@motor_1"),)])


def test_questions_leave_rivals_out_of_the_nuisances():
    rng = np.random.default_rng(0)
    soft = effect_named("bushing_stiffness@joint_3")
    other = effect_named("backlash@motor_2").with_values({"width_mdeg": 8.0})
    asked = between([[soft, effect_named("joint_clearance@joint_3")], [other]], [], rng)
    names = {effect.name for effect in asked.nuisances}
    assert soft.name not in names
    assert other.name in names
    assert other.name in asked.free
    friction = effect_named("joint_friction@joint_3")
    asked = between([], [effect_named("link_stiffness@link_1"), friction], rng)
    assert asked.goals == (Goal(friction.name, ""),)
    assert "link_stiffness@link_1" in {effect.name for effect in asked.nuisances}
    whole = commissioning(rng)
    assert not {e.name for e in whole.nuisances} & {sets[0].name for sets in whole.effects}


def test_plausible_values_are_within_bounds_and_not_nothing():
    for seed in range(30):
        effect = plausible(effect_named("creep@joint_1"), np.random.default_rng(seed))
        for parameter in effect.parameters:
            value = effect.estimates[parameter.key].value
            assert parameter.lower < value <= parameter.upper


def test_an_earlier_experiment_with_its_own_setup_adds_what_a_joint_fit_would(
    model, timeline, evaluated, known
):
    """Two days in one least squares, the registration of each day free."""
    nuisances, effects = evaluated
    layout, count = known.layout, 5
    days = [Information(known.grams[:count], layout), Information(known.grams[count:], layout)]
    start = carried_over(days[0], ["measurement_frame@pose_sensor"])
    goals = [Goal("backlash@motor_1", "drive_compliance@motor_1"), Goal("backlash@motor_1", "")]
    found = discrimination(start + days[1].total, layout, goals)
    stacked = [each.columns for each in (*nuisances, effects[1])] + [effects[0].truths]
    white = whitened(timeline, np.concatenate(stacked, axis=2), model.table, NOISE)
    first, second = np.vstack(white[:count]), np.vstack(white[count:])
    design = np.block(
        [
            [first[:, :6], np.zeros_like(first[:, :6]), first[:, 6:-1]],
            [np.zeros_like(second[:, :6]), second[:, :6], second[:, 6:-1]],
        ]
    )
    y = np.concatenate([first[:, -1], second[:, -1]])
    ridge = np.concatenate([np.full(12, 1 / FREE), np.ones(6), [1 / FREE]])
    both = (goals[0].truth, goals[0].rival)
    charge = np.diff([seen_log_det(start + days[1].total, layout, name) for name in both])
    for columns, d, more in ((19, found[0], charge), (18, found[1], 0.0)):
        matrix = np.vstack([design[:, :columns], np.diag(ridge[:columns])])
        target = np.concatenate([y, np.zeros(columns)])
        left = target - matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0]
        assert d**2 == pytest.approx(left @ left + more, rel=1e-5)


def test_a_recorded_session_is_the_experiment_that_was_performed(model, timeline):
    knots = timeline.knots
    time = np.arange(0.0, knots[-1][0], 0.05)
    angles, load = (
        np.stack(
            [
                np.interp(time, [k[0] for k in knots], column)
                for column in np.transpose([k[place] for k in knots])
            ],
            axis=1,
        )
        for place in (1, 2)
    )
    rotation = model.table.mechanism.forward(angles).platform
    session = MeasuredSession(
        "day 1", Block(time, angles, load), np.zeros((len(time), 3)), rotation
    )
    found = as_experiment(model, session)
    rest = found.rows[~found.moving]
    for dwell in timeline.dwells:
        inside = (found.block.time[rest] > dwell.time_s) & (
            found.block.time[rest] < dwell.time_s + dwell.hold_s
        )
        assert inside.sum() == 1, dwell.purpose
        at = rest[inside][0]
        assert np.allclose(found.block.theta[at], dwell.visit.theta, atol=1e-4)
        assert np.allclose(found.block.load[at], dwell.wrench, atol=1e-3)
    assert np.all(np.diff(found.visit) >= 0)
    assert set(np.diff(found.visit)) <= {0, 1}
    for visit in {dwell.visit for dwell in timeline.dwells if dwell.load.name}:
        begin = min(d.time_s for d in timeline.dwells if d.visit is visit)
        end = max(d.time_s + d.hold_s for d in timeline.dwells if d.visit is visit)
        own = (found.block.time[found.rows] > begin) & (found.block.time[found.rows] < end)
        assert len(set(found.visit[own & ~found.moving])) == 1


@pytest.mark.parametrize("change_s", [0.1, 7.0])
def test_a_load_changes_as_slowly_as_its_source_says_and_no_faster_than_a_hand(model, change_s):
    """At rest it is put on after one dwell and taken off after another."""
    load = replace(LOAD, change_s=change_s)
    pose, pace = np.radians([10.0, 5.0]), Pace(np.radians(30.0), 2.0, True)
    visit = Visit(pose, np.ones(2), load)
    found = run_through([visit], model.table.workspace, pace)
    empty, full = (each.time_s for each in found.dwells)
    lasts = max(change_s, LOAD_RAMP_S)
    assert full - empty == pytest.approx(pace.dwell_s + lasts)
    assert found.ends[0] - full == pytest.approx(visit.hold_s + lasts)


@pytest.mark.parametrize("count", [0.5, 0.99])
def test_the_noise_of_a_dwell_is_its_floor_less_the_hidden_count(model, count):
    """A quarter at least of a rotation's floor is white: a count may be hidden in less of it."""
    table, mechanism = model.table, model.table.mechanism
    jacobian = mechanism.jacobian(mechanism.forward(np.zeros(2)))
    hidden = np.sum(jacobian**2) * table.geometry.limits.encoder_step**2 / 12.0
    shift, square = 2e-6, hidden / count
    noise = dwell_noise(table, {"s_um": 1e6 * shift, "phi_mdeg": np.degrees(1e3 * np.sqrt(square))})
    assert np.sum(noise.white[:3] ** 2) == pytest.approx(shift**2)
    white = max(1.0 - count, LEAST_WHITE) * square
    assert np.sum(noise.white[3:] ** 2) == pytest.approx(white)
