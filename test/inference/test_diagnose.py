"""A plain table, an answer: what is planted is named, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference import (
    Candidate,
    Nuisance,
    Observations,
    Parameter,
    Quantity,
    ShapeParameter,
    diagnose,
    load_predictor,
)
from wrist_stiffness.inference.reading import AS_MUCH

NOISE = np.eye(2)


def law(name, formula, shape=(), lower=-np.inf, plausible=1.0, where="part"):
    """A candidate that moves the first component by a formula of the conditions."""

    def columns(table, values):
        change = np.zeros((table.n_units, 2, 1))
        change[:, 0, 0] = formula(table.covariates, *values)
        return change

    return Candidate(name, where, (Parameter("size", lower, plausible=plausible),), columns, shape)


LINEAR = law("slope", lambda c: c["x"])
SQUARE = law("bow", lambda c: c["x"] ** 2)
CROSS = law("cross", lambda c: c["x"] * c["z"])
WAVE = law("wave", lambda c, k: np.sin(k * c["x"]), (ShapeParameter("k", (2.0, 3.0, 4.5, 6.0)),))
SIGN = law("play", lambda c: np.sign(c["z"]))
LAWS = (LINEAR, SQUARE, CROSS, WAVE, SIGN)
ZERO = Nuisance("zero", lambda t: np.broadcast_to(np.eye(2), (t.n_units, 2, 2)), per_session=True)


def table(rng, n=80, **more):
    """White noise of unit size over two conditions."""
    conditions = {"x": rng.uniform(-1, 1, n), "z": rng.uniform(-1, 1, n)}
    return Observations(rng.normal(size=(n, 2)), conditions, **({"covariance": NOISE} | more))


def planted(units, *effects):
    """Measurements with effects: (candidate, size, shape)."""
    values = units.values + np.array([5.0, -3.0])
    for candidate, size, *shape in effects:
        values = values + size * candidate.evaluate(units, tuple(shape))[:, :, 0]
    return units.with_values(values)


def named(result):
    return {name for each in result.findings for name in each.names}


def test_noise_alone_is_given_a_name_in_few_of_many_tables():
    verdicts = [
        diagnose(planted(table(np.random.default_rng(seed))), LAWS, (ZERO,)).verdict
        for seed in range(20)
    ]
    # Named with 90 %: a tenth of the few that are named at all may be wrong.
    assert verdicts.count("effect") <= 1
    assert verdicts.count("none") >= 17


def test_between_noise_and_an_effect_the_verdict_is_undecided():
    found = [
        diagnose(planted(table(np.random.default_rng(3)), (CROSS, size)), LAWS, (ZERO,))
        for size in (0.6, 1.0, 1.2)
    ]
    assert [each.verdict for each in found] == ["none", "undecided", "effect"]
    assert found[0].probability > 0.5 > found[1].probability
    (suspect,) = found[1].suspects
    assert suspect.names == ("cross@part",)


@pytest.mark.parametrize("told", [True, False])
def test_an_effect_is_named_with_its_size_whether_the_noise_is_told_or_not(rng, told):
    units = planted(table(rng, covariance=NOISE if told else None), (CROSS, 4.0))
    result = diagnose(units, LAWS, (ZERO,))
    assert result.verdict == "effect"
    (finding,) = result.findings
    assert finding.names == ("cross@part",)
    assert finding.probability >= 0.95
    value, error = finding.parameters["size"]
    assert abs(value - 4.0) < 4.0 * error < 2.5
    assert result.noise["value_si"] == pytest.approx(np.sqrt(2.0), rel=0.25)
    assert result.discrepancy["value_si"] < 0.5
    assert result.after["value_si"] < result.before["value_si"]
    gain, uncertainty = finding.buys["value_si"]
    assert gain > uncertainty > 0.0


def test_of_what_is_named_near_the_limit_as_much_is_right_as_was_said():
    right, said = 0, []
    for seed in range(24):
        rng = np.random.default_rng(1000 + seed)
        truth = LAWS[seed % 3]
        result = diagnose(planted(table(rng, 40), (truth, 1.5)), LAWS, (ZERO,), naming=0.5)
        for each in result.findings:
            said.append(each.probability)
            right += truth.name in each.names
    assert len(said) >= 8
    expected, spread = np.sum(said), np.sqrt(np.sum(np.array(said) * (1.0 - np.array(said))))
    assert right >= expected - 3.0 * spread - 1.0


def test_two_effects_are_told_together(rng):
    result = diagnose(planted(table(rng), (LINEAR, 4.0), (SIGN, -2.0)), LAWS, (ZERO,))
    # A wave of low order is nearly a slope over this range.
    one, two = (set(each.names) for each in result.findings)
    assert {"play@part"} in (one, two)
    assert "slope@part" in one | two
    assert (one | two) <= {"play@part", "slope@part", "wave@part"}


def test_what_cannot_be_told_apart_shares_a_class(rng):
    twin = replace(CROSS, component="other part")
    result = diagnose(planted(table(rng), (CROSS, 4.0)), (*LAWS, twin), (ZERO,))
    (finding,) = result.findings
    assert set(finding.names) == {"cross@part", "cross@other part"}
    assert [share for *_, share in finding.members] == pytest.approx([0.5, 0.5], abs=1e-6)
    assert finding.probability >= 0.95


@pytest.mark.parametrize("seed", range(6))
def test_of_two_effects_with_a_twin_each_both_are_named(seed):
    twins = (replace(SQUARE, component="other part"), replace(SIGN, component="other part"))
    units = planted(table(np.random.default_rng(seed)), (SQUARE, 50.0), (SIGN, -50.0))
    result = diagnose(units, (*LAWS, *twins), (ZERO,))
    found = {frozenset(each.names) for each in result.findings}
    assert found == {frozenset((f"{n}@part", f"{n}@other part")) for n in ("play", "bow")}
    assert all(each.probability > 0.95 for each in result.findings)


@pytest.mark.parametrize("size", [3e3, 1e4, 1e6])
def test_parameters_that_the_data_cannot_separate_share_what_they_do(rng, size):
    """One weight at one place: its moment is as much larger or smaller as its force."""

    def columns(table, shape):
        return table.covariate("x")[:, None, None] * [1.0, 0.5]

    spring = Candidate("spring", "part", (Parameter("per_N"), Parameter("per_Nm")), columns)
    x = rng.uniform(-1.0, 1.0, 80)
    units = Observations((size * x + rng.normal(size=80))[:, None], {"x": x}, np.eye(1))
    (finding,) = diagnose(units, (spring,)).findings
    (force, error), (moment, _) = (finding.parameters[name] for name in ("per_N", "per_Nm"))
    assert force + 0.5 * moment == pytest.approx(size, rel=2e-3)
    assert error > 0.3 * size


def test_a_shape_is_found_between_the_points_of_its_grid(rng):
    result = diagnose(planted(table(rng, 150), (WAVE, 5.0, 5.2)), LAWS, (ZERO,))
    (finding,) = result.findings
    value, error = finding.parameters["k"]
    assert abs(value - 5.2) < 4.0 * error < 0.6


def test_a_shape_is_that_of_the_data_however_much_larger_than_usual_the_effect_is(rng):
    power = law(
        "power", lambda c, p: c["t"] ** p, (ShapeParameter("p", (0.5, 1.0, 1.5, 2.5, 4.0)),)
    )
    units = Observations(rng.normal(size=(150, 2)), {"t": np.linspace(0.0, 1.0, 150)}, NOISE)
    (finding,) = diagnose(planted(units, (power, 200.0, 2.0)), (power,), (ZERO,)).findings
    assert finding.parameters["p"][0] == pytest.approx(2.0, abs=0.03)


def test_an_impossible_sign_is_not_named(rng):
    soft = law("soft", lambda c: c["x"] * c["z"], lower=0.0)
    wrong = diagnose(planted(table(rng), (CROSS, -4.0)), (soft,), (ZERO,))
    assert (wrong.verdict, wrong.findings) == ("unknown", ())
    (standing,) = wrong.standings
    assert standing.probability < 0.5
    assert named(diagnose(planted(table(rng), (CROSS, 4.0)), (soft,), (ZERO,))) == {"soft@part"}


def test_what_stands_at_a_bound_leaves_the_rest_to_the_others(rng):
    def columns(table, shape):
        x, z = table.covariate("x"), table.covariate("z")
        change = np.stack([x, x + 0.5 * z], axis=1)
        return np.stack([change, np.zeros_like(change)], axis=1)

    sizes = tuple(Parameter(name, 0.0, plausible=3.0) for name in ("one", "other"))
    both = Candidate("spring", "pair", sizes, columns)
    units = planted(table(rng, 300), (LINEAR, 8.0), (law("z", lambda c: c["z"]), -1.0))
    (finding,) = diagnose(units, (both,), (ZERO,)).findings
    assert finding.parameters["one"][0] == pytest.approx(8.0, abs=0.6)
    assert finding.parameters["other"][0] == 0.0


def test_what_stands_at_a_bound_is_known_as_well_as_the_data_know_it(rng):
    def columns(table, shape):
        x, z = table.covariate("x"), table.covariate("z")
        return np.stack([x, x + 0.5 * z], axis=1)[:, None, :]

    sizes = Parameter("one", 0.0, plausible=3.0), Parameter("other", 0.0, plausible=3000.0)
    both = Candidate("spring", "pair", sizes, columns)
    x, z = rng.uniform(-1.0, 1.0, (2, 300))
    values = 8.0 * x - z + rng.normal(size=300)
    units = Observations(values[:, None], {"x": x, "z": z}, np.eye(1))
    (finding,) = diagnose(units, (both,)).findings
    value, error = finding.parameters["other"]
    assert value == 0.0
    # It is what z leaves, 2 over the root of 100, beside a scatter that the bound enlarges.
    assert 0.2 < error < 0.4


def test_what_is_at_its_most_explains_what_it_can(rng):
    stop = Candidate(
        "stop",
        "part",
        (Parameter("size", 0.0, 5.0, plausible=3.0),),
        lambda table, shape: table.covariate("x")[:, None, None],
    )
    x = rng.uniform(-1.0, 1.0, 100)
    units = Observations((5.2 * x + rng.normal(size=100))[:, None], {"x": x}, np.eye(1))
    result = diagnose(units, (stop,))
    (standing,) = result.standings
    assert standing.log_gain > 5.0
    (finding,) = result.findings
    assert finding.parameters["size"][0] == 5.0


def test_an_effect_outside_the_catalogue_is_unknown_and_told_by_its_condition(rng):
    outside = law("ripple", lambda c: np.cos(5.0 * c["z"]))
    result = diagnose(planted(table(rng, 150), (outside, 4.0)), (LINEAR, SQUARE), (ZERO,))
    assert result.verdict == "unknown"
    assert result.findings == ()
    assert next(iter(result.depends_on)) == "z"
    assert result.discrepancy["value_si"] > 1.0


def test_what_no_law_explains_is_told_of_the_quantity_that_has_it(rng):
    each = Quantity("first", "um", (0,)), Quantity("second", "um", (1,))
    units = table(rng, 200, quantities=each)
    beyond = 8.0 * np.sin(6.0 * units.covariates["x"])
    values = units.values + beyond[:, None] * [0.0, 1.0]
    result = diagnose(units.with_values(values), (SIGN,), (ZERO,))
    assert result.verdict == "unknown"
    assert result.discrepancy["first_um"] == 0.0
    unexplained = float(np.sqrt(np.mean(beyond**2)))
    assert result.discrepancy["second_um"] == pytest.approx(unexplained, rel=0.1)


def test_scatter_that_no_stated_noise_explains_is_told_of_the_quantity_that_has_it(rng):
    each = Quantity("first", "um", (0,)), Quantity("second", "um", (1,))
    units = table(rng, 200, quantities=each)
    beyond = rng.normal(0.0, 8.0, 200)
    values = units.values + beyond[:, None] * [0.0, 1.0]
    stated = replace(units.with_values(values), covariance=np.eye(2))
    result = diagnose(stated, (SIGN,), (ZERO,))
    assert result.discrepancy["first_um"] < 1.0
    assert result.discrepancy["second_um"] == pytest.approx(8.0, rel=0.1)


def test_drift_of_the_instrument_is_not_named_and_only_where_rows_have_an_order():
    rng = np.random.default_rng(4)
    n = 120
    steps = np.linspace(-1.0, 1.0, n)
    wander = np.cumsum(rng.normal(size=(n, 2)), axis=0) / 8.0
    units = table(rng, n, time_s=30.0 * np.arange(n))
    warm = law("warm", lambda c: c["t"] + 0.3 * c["t"] ** 2)
    units = replace(units, covariates={**units.covariates, "t": steps})
    units = units.with_values(units.values + wander)
    in_order = diagnose(units, (*LAWS, warm), (ZERO,))
    assert named(in_order) == set()
    groups = in_order.search.base.evidence.background.groups
    assert "slow drift of the instrument" in [each.name for each in groups]
    shuffled = diagnose(units, (*LAWS, warm), (ZERO,), ordered=False)
    groups = shuffled.search.base.evidence.background.groups
    assert "slow drift of the instrument" not in [each.name for each in groups]


def test_the_order_of_rows_has_no_part_where_it_is_no_time(rng):
    units = planted(table(rng), (CROSS, 3.0))
    other = units.take(rng.permutation(units.n_units))
    one, two = (diagnose(each, LAWS, (ZERO,)) for each in (units, replace(other, row=None)))
    assert one.verdict == two.verdict
    assert [f.names for f in one.findings] == [f.names for f in two.findings]
    assert one.probability == pytest.approx(two.probability, abs=1e-6)
    assert one.findings[0].parameters["size"] == pytest.approx(two.findings[0].parameters["size"])
    assert one.after["value_si"] == pytest.approx(two.after["value_si"])


def test_what_makes_another_session_worse_is_not_handed_over(rng):
    units = table(rng, 120, session=np.repeat([0, 1], 60))
    good = planted(units, (CROSS, 4.0))
    turned = np.where(np.arange(120)[:, None] < 60, good.values, 2.0 * units.values - good.values)
    bad = diagnose(good.with_values(turned), LAWS, (ZERO,))
    assert (bad.verdict, bad.findings, bad.scope) == ("unknown", (), "another session")
    assert bad.after == bad.before
    (refused,) = [each for each in bad.standings if each.name == "cross@part"]
    assert refused.why_not == "makes the held-out error grow"
    assert refused.probability == pytest.approx(bad.suspects[0].probability)
    assert not any(each.effects for each in bad.predictor.sets)
    kept = diagnose(good, LAWS, (ZERO,))
    assert named(kept) == {"cross@part"}
    assert kept.after["value_si"] == pytest.approx(np.sqrt(2.0), rel=0.3)


@pytest.mark.parametrize("seed", [4, 12])
def test_an_instrument_that_drifts_is_no_evidence_against_a_right_effect(seed):
    """It drifts by as much as it scatters, slowly, as the conditions change."""
    rng, n = np.random.default_rng(seed), 200
    time = 10.0 * np.tile(np.arange(n), 2)
    session = np.repeat([0, 1], n)
    phase = np.concatenate(
        [np.arange(n) / n * rng.uniform(0.5, 2.0) + rng.uniform() for _ in range(4)]
    )
    conditions = dict(zip("xz", np.sin(2.0 * np.pi * phase).reshape(2, -1), strict=True))
    values = rng.normal(size=(2 * n, 2))
    for own in (session == 0, session == 1):
        size, start = rng.normal(size=(6, 2)), rng.uniform(0.0, 2.0 * np.pi, (6, 2))
        speed = np.abs(rng.normal(size=(6, 2))) / (2.0 * n)
        waves = np.sin(speed * time[own][:, None, None] + start)
        values[own] += 1.1 * np.sum(size * waves, axis=1) / np.sqrt(3.0)
    units = Observations(values, conditions, NOISE, time, session)
    result = diagnose(planted(units, (LINEAR, 1.0)), (LINEAR, SQUARE, CROSS, SIGN), (ZERO,))
    assert [each.why_not for each in result.standings if "held-out" in each.why_not] == []


def test_another_session_is_set_up_anew_before_it_judges(rng):
    units = planted(table(rng, 120, session=np.repeat([0, 1], 60)), (CROSS, 4.0))
    moved = units.with_values(units.values + 50.0 * (units.sessions == 1)[:, None])
    result = diagnose(moved, LAWS, (ZERO,))
    assert named(result) == {"cross@part"}
    assert result.after["value_si"] < 2.0


def test_repeated_conditions_fix_a_noise_that_is_not_told(rng):
    again = np.repeat(np.arange(30), 2)
    units = table(rng, 60, covariance=None, replicate=again)
    units = replace(units, covariates={k: v[2 * (again)] for k, v in units.covariates.items()})
    rough = 3.0 * rng.normal(size=(30, 2))[again]
    result = diagnose(units.with_values(units.values + rough), LAWS, (ZERO,))
    assert result.verdict == "unknown"
    assert result.noise["value_si"] == pytest.approx(np.sqrt(2.0), rel=0.35)
    assert result.discrepancy["value_si"] > 2.0


@pytest.mark.parametrize("seed", range(6))
def test_noise_that_nothing_tells_is_found_far_below_what_a_rough_model_leaves(seed):
    """Thirty waves for sixty numbers: the rough model can hold no more than a few of them."""
    rng = np.random.default_rng(seed)
    speeds, phases = rng.uniform(5, 60, 30), rng.uniform(0, 6, 30)
    units = Observations(rng.normal(size=(60, 1)), {"x": rng.uniform(-1, 1, 60)})

    def wave(n):
        def columns(table, shape):
            return np.sin(speeds[n] * table.covariate("x") + phases[n])[:, None, None]

        return Candidate(f"wave {n}", "part", (Parameter("size"),), columns)

    waves = [wave(n) for n in range(30)]
    truth = zip(waves, (20.0, -15.0, 10.0), strict=False)
    values = units.values + sum(size * each.evaluate(units, ())[:, :, 0] for each, size in truth)
    result = diagnose(units.with_values(values), waves, ordered=False)
    assert named(result) == {f"wave {n}@part" for n in range(3)}
    assert result.noise["value_si"] == pytest.approx(1.0, rel=0.25)


def test_ten_rows_of_nine_numbers_get_an_answer(rng):
    x = np.linspace(-1.0, 1.0, 10)
    own = rng.normal(size=9)

    def columns(units, shape):
        return (units.covariate("x")[:, None] * own)[:, :, None]

    bend = Candidate("bend", "arm", (Parameter("size", plausible=1.0),), columns)
    zero = Nuisance("zero", lambda t: np.broadcast_to(np.eye(9), (t.n_units, 9, 9)))
    small = Observations(5.0 * x[:, None] * own + rng.normal(size=(10, 9)), {"x": x})
    result = diagnose(small, (bend,), (zero,))
    assert named(result) == {"bend@arm"}


def test_lost_beams_are_left_out_and_told(rng):
    units = planted(table(rng), (CROSS, 4.0))
    values = units.values.copy()
    values[[11, 42]] += 60.0
    result = diagnose(units.with_values(values), LAWS, (ZERO,))
    assert result.lost == (11, 42)
    assert named(result) == {"cross@part"}


def test_blanks_are_not_measured(rng):
    units = planted(table(rng), (CROSS, 4.0))
    values = np.where(rng.uniform(size=units.values.shape) < 0.2, np.nan, units.values)
    assert named(diagnose(units.with_values(values), LAWS, (ZERO,))) == {"cross@part"}


def test_where_every_row_has_a_zero_of_its_own_nothing_could_have_shown(rng):
    x = rng.normal(size=8)
    units = Observations(3.0 * x[:, None], {"x": x}, 0.01 * np.eye(1), session=np.arange(8))
    slope = Candidate(
        "slope",
        "part",
        (Parameter("k", plausible=1.0),),
        lambda o, s: o.covariates["x"][:, None, None],
    )
    zero = Nuisance("zero", lambda o: np.ones((o.n_units, 1, 1)), per_session=True)
    assert [each.effect for each in diagnose(units, (slope,), (zero,)).not_excited] == ["slope"]
    assert diagnose(units, (slope,)).not_excited == ()


def test_what_is_told_as_missing_is_not_told_as_hidden_too(rng):
    """A large effect shows where its typical size would not: so do those that look like it."""
    x = rng.normal(size=60)
    units = Observations(x[:, None] + 0.1 * rng.normal(size=(60, 1)), {"x": x}, 0.01 * np.eye(1))
    slope, other, flat = (
        Candidate(name, "part", (Parameter("k", plausible=0.01),), law)
        for name, law in (
            ("slope", lambda o, s: o.covariates["x"][:, None, None]),
            ("other", lambda o, s: o.covariates["x"][:, None, None]),
            ("flat", lambda o, s: np.sign(o.covariates["x"])[:, None, None]),
        )
    )
    found = diagnose(units, (slope, other, flat))
    assert named(found) == {"slope@part", "other@part"}
    assert [each.effect for each in found.not_excited] == ["flat"]


def test_what_is_not_excited_is_listed_with_what_to_record(rng):
    units = table(rng, 120)
    units = replace(units, covariates={**units.covariates, "load": np.zeros(120)})
    sag = replace(law("sag", lambda c: c["load"]), needs="two loads")
    result = diagnose(planted(units), (*LAWS, sag), (ZERO,))
    assert ("sag", "two loads") in [(each.effect, each.needs) for each in result.not_excited]
    assert "cross" not in [each.effect for each in result.not_excited]


def test_a_rival_that_explains_as_much_is_told_though_its_size_is_unusual(rng):
    """Only what is usual speaks against it: a technician rules it out on the machine."""
    tiny = law("tiny", lambda c: c["x"] * c["z"], plausible=0.03)
    result = diagnose(planted(table(rng), (CROSS, 4.0)), (*LAWS, tiny), (ZERO,))
    assert named(result) == {"cross@part"}
    why = {each.name: each.why_not for each in result.standings}
    assert [name for name, reason in why.items() if reason == AS_MUCH] == ["tiny@part"]


@settings(max_examples=8)
@given(st.floats(-6.0, 6.0).filter(lambda size: abs(size) > 2.5), st.integers(0, 1000))
def test_what_was_learned_predicts_what_no_fit_has_seen(size, seed):
    rng = np.random.default_rng(seed)
    result = diagnose(planted(table(rng, 120), (CROSS, size)), LAWS, (ZERO,))
    unseen = table(rng, 200)
    truth = planted(unseen.with_values(np.zeros((200, 2))), (CROSS, size)).values
    error = result.predictor.predict(unseen) - truth
    assert np.sqrt(np.mean(error**2)) < 0.4


OUTSIDE = law("outside", lambda c: np.cos(2.0 * c["x"] + 0.7) * np.exp(-2.0 * c["z"] ** 2))


def test_what_no_law_explains_is_predicted_from_its_conditions(rng):
    laws = (LINEAR, SIGN)
    result = diagnose(planted(table(rng, 200), (OUTSIDE, 8.0), (SIGN, 3.0)), laws, (ZERO,))
    unseen = table(rng, 300)
    truth = planted(unseen.with_values(np.zeros((300, 2))), (OUTSIDE, 8.0), (SIGN, 3.0)).values
    sets = tuple(replace(each, smooth=(), beside=()) for each in result.predictor.sets)
    by_laws, whole = (
        np.sqrt(np.mean((each.predict(unseen) - truth)[:, 0] ** 2))
        for each in (replace(result.predictor, sets=sets), result.predictor)
    )
    assert whole < 0.3 * by_laws


def test_a_saved_predictor_predicts_the_same(rng, tmp_path):
    units = planted(table(rng, 200), (WAVE, 4.0, 3.3), (OUTSIDE, 8.0))
    result = diagnose(units, LAWS, (ZERO,))
    assert any(each.smooth for each in result.predictor.sets)
    assert sum(each.probability for each in result.predictor.sets) == pytest.approx(1.0)
    result.predictor.save(tmp_path / "lever.json")
    unseen = table(rng)
    again = load_predictor(tmp_path / "lever.json", LAWS, (ZERO,))
    np.testing.assert_array_equal(again.predict(unseen), result.predictor.predict(unseen))
    with pytest.raises(InputError, match="@part is not among the candidates"):
        load_predictor(tmp_path / "lever.json", (LINEAR,), (ZERO,))
    for other in ((), (replace(ZERO, per_session=not ZERO.per_session),)):
        with pytest.raises(InputError, match="zero, .* is not among the nuisances"):
            load_predictor(tmp_path / "lever.json", LAWS, other)
    (tmp_path / "lever.json").write_text("[]")
    with pytest.raises(InputError, match="no saved predictor"):
        load_predictor(tmp_path / "lever.json", LAWS, (ZERO,))


def test_a_budget_that_is_over_still_answers_and_says_so(rng):
    result = diagnose(planted(table(rng), (CROSS, 4.0)), LAWS, (ZERO,), seconds=0.0)
    assert not result.complete
    assert result.promising[0].name.startswith("cross@")
    assert result.findings == ()


def test_what_a_rival_would_change_is_told_of_every_set_that_was_fitted(rng):
    units = planted(table(rng), (CROSS, 4.0))
    result = diagnose(units, LAWS, (ZERO,))
    change = result.change_by("cross@part")[:, 0]
    expected = 4.0 * units.covariate("x") * units.covariate("z")
    assert np.sqrt(np.mean((change - expected) ** 2)) < 0.3
    with pytest.raises(InputError, match="was not fitted"):
        result.change_by("nothing@part")


def not_a_number(units, shape):
    return np.full((units.n_units, 2, 1), np.nan)


@pytest.mark.parametrize("size", [1e6, 1e9])
def test_set_up_that_is_there_twice_takes_up_what_one_does(rng, size):
    twice = Nuisance("zeros", lambda t: t.covariate("x")[:, None, None] * [[1.0, -2.5], [0.0, 0.0]])
    units = planted(table(rng), (CROSS, size), (LINEAR, size))
    result = diagnose(units, (SQUARE, CROSS, SIGN), (ZERO, twice))
    assert named(result) == {"cross@part"}
    assert result.findings[0].parameters["size"][0] == pytest.approx(size, rel=0.02)


@pytest.mark.parametrize("size", [1e9, 1e11])
def test_a_table_far_above_its_noise_gets_an_answer(rng, size):
    result = diagnose(planted(table(rng), (CROSS, size), (LINEAR, size)), (SQUARE, CROSS), (ZERO,))
    assert result.verdict == "unknown"
    result = diagnose(planted(table(rng), (CROSS, size)), LAWS, (ZERO,))
    assert named(result) == {"cross@part"}


@pytest.mark.parametrize("variance", [0.0, -1e-6])
@pytest.mark.parametrize("row", [7, 77])
def test_a_noise_of_nothing_or_less_is_refused_with_its_row(rng, variance, row):
    """Also where a drift would make up for it, and where the row belongs to what judges."""
    covariance = np.tile(NOISE, (80, 1, 1))
    covariance[row, 1, 1] = variance
    units = planted(table(rng, covariance=covariance, session=np.repeat([0, 1], 40)))
    units = replace(units, time_s=10.0 * np.arange(80))
    message = f"covariance of row {row}: a variance of {variance:.3g}, must be above 0"
    with pytest.raises(InputError, match=message):
        diagnose(units, LAWS, (ZERO,))


@pytest.mark.parametrize(
    ("laws", "base", "message"),
    [
        ((LINEAR, LINEAR), (ZERO,), "candidate slope@part is listed twice"),
        ((LINEAR,), (ZERO, ZERO), "nuisance zero is listed twice"),
        (
            (replace(LINEAR, columns=not_a_number),),
            (ZERO,),
            "slope@part returned a column that is not a number",
        ),
        (
            (replace(LINEAR, columns=lambda t, s: np.zeros((3, 2, 1))),),
            (ZERO,),
            r"slope@part returned columns \(3, 2, 1\), not \(80, 2, 1\)",
        ),
        (
            (LINEAR,),
            (replace(ZERO, columns=lambda t: np.zeros((3, 2))),),
            r"zero returned columns \(3, 2\)",
        ),
        ((LINEAR,), (replace(ZERO, prior_std=(1.0, -1.0)),), "positive prior deviations"),
    ],
)
def test_unusable_questions_are_refused(rng, laws, base, message):
    with pytest.raises(InputError, match=message):
        diagnose(table(rng), laws, base)


@pytest.mark.parametrize("naming", [0.0, 90.0])
def test_a_naming_probability_beyond_0_and_1_is_refused(rng, naming):
    with pytest.raises(InputError, match="between 0 and 1"):
        diagnose(table(rng), LAWS, (ZERO,), naming=naming)


@pytest.mark.parametrize("n", [2, 12])
def test_a_table_without_any_condition_gets_an_answer(rng, n):
    units = Observations(rng.normal(size=(n, 2)), {}, NOISE)
    assert diagnose(units, ()).verdict == "none"


def test_a_table_of_one_row_is_refused(rng):
    with pytest.raises(InputError, match="one row"):
        diagnose(table(rng, 1), LAWS)


def test_a_table_of_blanks_is_refused(rng):
    units = table(rng)
    with pytest.raises(InputError, match="nothing was measured"):
        diagnose(units.with_values(np.full((80, 2), np.nan)), LAWS, (ZERO,))


def test_an_arm_with_an_inexact_law_gets_the_right_name(arm, rng):
    laws = {each.name: each for each in arm.catalogue()}
    truth = laws["creep@joint_2"]
    units = arm.hide(arm.campaign(rng, 100), [(truth, 20.0)], rng, 0.03)
    result = diagnose(units, tuple(laws.values()), arm.base())
    assert truth.name in named(result)
    assert len(result.findings) == 1
