"""Hidden truths on the made-up arm, and on plain tables where every answer is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.diagnosis import (
    Candidate,
    Nuisance,
    Observations,
    Parameter,
    Settings,
    ShapeParameter,
    diagnose,
)
from wrist_stiffness.errors import InputError

QUICK = Settings(permutations=999)


def line(covariate, lower=-np.inf, plausible=None):
    """The same slope over one condition in every component."""

    def columns(table, _):
        return np.stack([table.covariate(covariate)] * table.n_components, axis=1)[:, :, None]

    return Candidate("line", covariate, (Parameter("slope", lower, plausible=plausible),), columns)


def offset():
    def columns(table):
        return np.broadcast_to(
            np.eye(table.n_components), (*table.values.shape, table.n_components)
        )

    return Nuisance("offset", columns)


def plain(rng, n=120, m=2):
    conditions = {name: rng.uniform(-1, 1, n) for name in ("x", "z", "w")}
    return Observations(rng.normal(size=(n, m)), conditions)


def by_name(arm, name):
    return next(candidate for candidate in arm.catalogue() if candidate.name == name)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 30.0])
def test_a_hidden_effect_with_an_inexact_law_is_named_alone(arm, rng, size):
    truth = by_name(arm, "compliance@joint_2")
    table = arm.hide(arm.campaign(rng), [(truth, size)], rng, law_error=0.05)
    result = diagnose(table, arm.catalogue(), arm.base(), rng, QUICK)
    assert result.verdict == "effect"
    assert [truth.name in finding.names for finding in result.findings] == [True]
    assert result.findings[0].heldout_rmse_ratio < 1
    assert result.after["s_um"] < result.before["s_um"]


@pytest.mark.slow
def test_an_effect_outside_the_catalogue_is_unknown(arm, rng):
    table = arm.hide(arm.campaign(rng), [(arm.outsiders()["cable"], 10.0)], rng)
    result = diagnose(table, arm.catalogue(), arm.base(), rng, QUICK)
    assert result.verdict == "unknown"
    assert result.unexplained.energy_share >= 0.10
    assert result.unexplained.depends_on


def test_of_what_an_effect_explains_is_said_where_and_beyond_what(rng):
    """Noise as large as the effect stays in the error, and is no part of that share."""
    table = plain(rng)
    table = table.with_values(table.values + 1.5 * table.covariate("x")[:, None])
    result = diagnose(table, (line("x"), line("z")), (offset(),), rng, QUICK)
    (finding,) = result.findings
    share = "where it was fitted it explains 100.0 % of what the rest of the model leaves above the"
    assert f"{share} noise" in finding.evidence
    assert result.after["value_si"] > 0.5 * result.before["value_si"]


def test_noise_alone_misses_nothing(rng):
    result = diagnose(plain(rng), (line("x"), line("z"), line("w")), (offset(),), rng, QUICK)
    assert result.verdict == "none"
    assert result.findings == ()


def test_two_effects_are_found_one_after_the_other_and_refitted_together(rng):
    table = plain(rng)
    hidden = np.outer(3 * table.covariate("x") + 1.5 * table.covariate("z"), [1, 1])
    table = table.with_values(table.values + hidden)
    result = diagnose(table, (line("x"), line("z"), line("w")), (offset(),), rng, QUICK)
    assert [finding.name for finding in result.findings] == ["line@x", "line@z"]
    for finding, truth in zip(result.findings, (3.0, 1.5), strict=True):
        value, error = finding.parameters["slope"]
        assert abs(value - truth) < 4 * error
        # 96 training units of 2 components over a uniform condition: 1 / sqrt(192 / 3).
        assert error == pytest.approx(0.125, rel=0.3)


@pytest.mark.parametrize(("large", "named"), [(10.0, ["line@x", "line@z"]), (40.0, ["line@x"])])
def test_what_an_inexact_law_may_leave_of_a_large_effect_names_no_second_one(rng, large, named):
    """Laws are right to a tenth of their effect's size: 1.5 is more than that of 10, not of 40."""
    table = plain(rng)
    hidden = large * table.covariate("x") + 1.5 * table.covariate("z")
    table = table.with_values(table.values + hidden[:, None])
    result = diagnose(table, (line("x"), line("z"), line("w")), (offset(),), rng, QUICK)
    assert [finding.name for finding in result.findings] == named


def test_twins_share_a_class(rng):
    table = plain(rng)
    table = table.with_values(table.values + np.outer(2 * table.covariate("x"), [1, 1]))
    twin = Candidate(
        "twin",
        "x",
        (Parameter("slope"),),
        lambda t, _: 3.0 * np.stack([t.covariate("x")] * 2, axis=1)[:, :, None],
    )
    result = diagnose(table, (line("z"), line("x"), twin), (offset(),), rng, QUICK)
    assert set(result.findings[0].names) == {"line@x", "twin@x"}
    assert result.findings[0].stability == 1


def test_a_shape_is_found_between_the_points_of_its_grid(rng):
    table = plain(rng)
    saturation = Candidate(
        "saturation",
        "spring",
        (Parameter("size"),),
        lambda t, s: np.stack([np.tanh(t.covariate("x") / s[0])] * 2, axis=1)[:, :, None],
        (ShapeParameter("knee", (0.05, 0.2, 0.8)),),
    )
    truth = 20 * np.tanh(table.covariate("x") / 0.35)
    table = table.with_values(table.values + truth[:, None])
    result = diagnose(table, (line("x"), saturation), (offset(),), rng, QUICK)
    assert result.findings[0].name == "saturation@spring"
    value, error = result.findings[0].parameters["knee"]
    assert abs(value - 0.35) < 4 * error < 0.1


def test_an_impossible_sign_is_not_named(rng):
    table = plain(rng)
    table = table.with_values(table.values - np.outer(3 * table.covariate("x"), [1, 1]))
    softer = line("x", lower=0.0)
    result = diagnose(table, (softer, line("z")), (offset(),), rng, QUICK)
    assert result.verdict == "unknown"
    assert result.findings == ()
    assert result.unexplained.depends_on[0] == "x"


def test_what_the_base_absorbs_is_not_excited(rng):
    constant = Candidate(
        "offset",
        "sensor",
        (Parameter("size"),),
        lambda t, _: np.ones((*t.values.shape, 1)),
        needs="a reference",
    )
    result = diagnose(plain(rng), (constant, line("x")), (offset(),), rng, QUICK)
    assert [(e.effect, e.needs) for e in result.not_excited] == [("offset", "a reference")]


def test_a_catalogue_that_the_data_do_not_excite_leaves_the_base_alone(rng):
    nothing = diagnose(plain(rng), (line("x", plausible=0.01),), (offset(),), rng, QUICK)
    assert (nothing.verdict, nothing.findings) == ("none", ())
    assert [each.component for each in nothing.not_excited] == ["x"]


def test_structure_without_any_catalogue_is_unknown(rng):
    table = plain(rng)
    table = table.with_values(table.values + np.outer(3 * table.covariate("x"), [1, 1]))
    found = diagnose(table, (), (offset(),), rng, QUICK)
    assert (found.verdict, found.not_excited) == ("unknown", ())
    assert found.unexplained.depends_on[0] == "x"


def test_an_effect_too_small_to_be_seen_is_not_excited(rng):
    faint = line("x", plausible=0.01)
    result = diagnose(plain(rng), (faint, line("z")), (offset(),), rng, QUICK)
    assert [e.component for e in result.not_excited] == ["x"]


def test_lost_beams_are_left_out(rng):
    table = plain(rng)
    values = table.values + np.outer(3 * table.covariate("x"), [1, 1])
    values[[10, 70, 110]] = [[500, -300], [80, 0], [-4000, 90]]
    result = diagnose(table.with_values(values), (line("x"), line("z")), (offset(),), rng, QUICK)
    assert result.lost_units == 3
    assert [finding.name for finding in result.findings] == ["line@x"]


def test_an_effect_that_fails_in_another_session_is_thrown_out(rng):
    n = 160
    session = np.repeat([0, 1], n // 2)
    table = Observations(rng.normal(size=(n, 2)), {"x": rng.uniform(-1, 1, n)}, session=session)
    sign = np.where(session == 0, 1, -1)
    values = table.values + np.outer(3 * sign * table.covariate("x"), [1, 1])
    result = diagnose(table.with_values(values), (line("x"),), (offset(),), rng, QUICK)
    assert result.verdict == "unknown"
    assert result.findings == ()
    assert "line@x fitted here makes the sealed part worse" in result.unexplained.evidence


def test_blank_components_are_allowed(rng):
    table = plain(rng, m=3)
    values = table.values + np.outer(3 * table.covariate("x"), [1, 1, 1])
    values[:, 2] = np.nan
    values[::7, 0] = np.nan
    result = diagnose(table.with_values(values), (line("x"), line("z")), (offset(),), rng, QUICK)
    assert [finding.name for finding in result.findings] == ["line@x"]


def test_the_same_seed_gives_the_same_answer(rng):
    table = plain(rng)
    answers = [
        diagnose(table, (line("x"), line("z")), (offset(),), np.random.default_rng(3), QUICK)
        for _ in range(2)
    ]
    assert answers[0] == answers[1]


def test_the_result_is_plain_json(rng):
    table = plain(rng)
    table = table.with_values(table.values + np.outer(3 * table.covariate("x"), [1, 1]))
    told = diagnose(table, (line("x"),), (offset(),), rng, QUICK).as_json()
    assert json.loads(json.dumps(told)) == told
    assert told["schema"] == 1
    assert told["findings"][0]["class"] == [{"effect": "line", "component": "x"}]


@pytest.mark.parametrize(
    ("n", "candidates", "message"),
    [
        (8, (line("x"),), "8 units are too few .* of the 6 that are left it needs 12"),
        (14, (line("x"),), "14 units are too few .* 3 are put aside .* of the 11"),
        (40, (line("x"), line("x")), "line@x is listed twice"),
    ],
)
def test_unusable_questions_are_refused(rng, n, candidates, message):
    with pytest.raises(InputError, match=message):
        diagnose(plain(rng, n), candidates, (offset(),), rng)


def test_a_short_first_session_is_refused(rng):
    table = replace(plain(rng, 40), session=np.repeat([0, 1], [2, 38]))
    with pytest.raises(InputError, match="38 are put aside to judge by, and of the 2"):
        diagnose(table, (line("x"),), (offset(),), rng)


@pytest.mark.parametrize("columns", [24, 30])
def test_a_base_that_fits_every_number_is_refused(rng, columns):
    """Twelve units of two components teach."""
    flexible = Nuisance("flexible", lambda t: rng.normal(size=(*t.values.shape, columns)))
    with pytest.raises(InputError, match="24 measured numbers .* the base alone fits 24"):
        diagnose(plain(rng, 15), (line("x"),), (flexible,), rng)


@pytest.mark.parametrize("aside", [3, 6, 11])
def test_of_a_few_sealed_units_none_is_lost(aside):
    """A rich model follows most of them, and what it does not follow looks far off."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        table = plain(rng, 40 + aside)
        table = replace(table, session=np.repeat([0, 1], [40, aside]))
        steps = Nuisance("steps", lambda t: np.eye(2)[None] * np.ones((t.n_units, 1, 1)))
        found = diagnose(table, tuple(map(line, "xzw")), (steps,), rng)
        assert found.lost_units == 0


def test_a_table_of_blanks_is_refused(rng):
    table = plain(rng)
    with pytest.raises(InputError, match="nothing was measured"):
        diagnose(table.with_values(np.full((120, 2), np.nan)), (line("x"),), (offset(),), rng)


def test_a_crowd_of_lookalikes_names_nothing(rng):
    table = plain(rng)
    table = table.with_values(table.values + np.outer(2 * table.covariate("x"), [1, 1]))

    def twin(number):
        def columns(t, _):
            return (1.0 + number) * np.stack([t.covariate("x")] * 2, axis=1)[:, :, None]

        return Candidate("twin", f"x_{number}", (Parameter("slope"),), columns)

    few = Settings(permutations=999, most_members=3)
    twins = tuple(twin(number) for number in range(4))
    crowd = diagnose(table, (line("z"), *twins), (offset(),), rng, few)
    assert (crowd.verdict, crowd.findings) == ("unknown", ())
    (named,) = diagnose(table, (line("z"), *twins[:3]), (offset(),), rng, few).findings
    assert len(named.names) == 3


def test_what_fails_without_the_doubted_effect_beside_it_is_told(rng):
    """Fitted alone, the slope over z stands for x, which goes with z in the first session only."""
    session, z = np.repeat([0, 1], [100, 40]), rng.uniform(-1, 1, 140)
    x = np.where(session == 0, z + rng.uniform(-0.3, 0.3, 140), 0.0)
    values = rng.normal(size=(140, 2)) + (12 * x - 6 * z)[:, None]
    table = Observations(values, {"x": x, "z": z}, session=session)
    twins = tuple(replace(line("x"), effect=f"line_{number}") for number in range(4))
    few = Settings(most_members=3)
    found = diagnose(table, (line("z"), *twins), (offset(),), rng, few)
    assert (found.verdict, found.findings) == ("unknown", ())
    assert "3 others explain it about as well as line_" in found.unexplained.evidence
    assert "line@z fitted here makes the sealed part worse" in found.unexplained.evidence


def test_what_resamples_do_not_choose_again_is_not_named(rng):
    table = plain(rng)
    table = table.with_values(table.values + np.outer(table.covariate("x"), [1, 1]))
    catalogue = (line("x"), line("z"))
    (named,) = diagnose(table, catalogue, (offset(),), rng).findings
    assert named.name == "line@x"
    never = replace(Settings(), least_stability=1.01)
    doubted = diagnose(table, catalogue, (offset(),), rng, never)
    assert (doubted.verdict, doubted.findings) == ("unknown", ())
    assert (
        "line@x explains it best, but only 100 % of the resamples" in doubted.unexplained.evidence
    )


def whole_fit(name, direction, strain=0.0):
    """A candidate that was fitted alone, with three numbers, before it became a column."""

    def columns(table, _):
        return direction(table)[:, :, None]

    share = (Parameter("share", 0.0),)
    return Candidate("fit", name, share, columns, fitted=2, strain=strain)


def test_of_effects_that_were_fitted_alone_one_enters(rng):
    """Each has relieved the same priors: two would count that twice."""
    table = plain(rng)
    both = [np.outer(table.covariate(name), [1.0, 1.0]) for name in ("x", "z")]
    table = table.with_values(table.values + both[0] + both[1])
    fits = tuple(whole_fit(f"{n}", lambda t, own=own: own[t.rows]) for n, own in enumerate(both))
    found = diagnose(table, fits, (offset(),), rng)
    assert len(found.findings) == 1
    assert found.verdict == "unknown"
    free = tuple(replace(each, fitted=0) for each in fits)
    assert len(diagnose(table, free, (offset(),), rng).findings) == 2


def test_of_two_that_explain_alike_the_one_that_strains_the_base_stands_back(rng):
    table = plain(rng)
    change = np.outer(table.covariate("x"), [1.0, 1.0])
    table = table.with_values(table.values + change)
    easy = whole_fit("easy", lambda t: change[t.rows], strain=-20.0)
    forced = whole_fit("forced", lambda t: change[t.rows], strain=20.0)
    (named,) = diagnose(table, (forced, easy), (offset(),), rng).findings
    assert named.names == ("fit@easy",)


@pytest.mark.parametrize(("alpha", "least"), [(0.005, 999), (0.0003, 3333)])
def test_permutations_by_which_nothing_could_be_found_are_refused(alpha, least):
    """Neither an effect at alpha nor structure, of which noise is taken for it once in 1000."""
    with pytest.raises(InputError, match=f"{least - 1} permutations .* at least {least} are"):
        Settings(alpha=alpha, permutations=least - 1)
    Settings(alpha=alpha, permutations=least)
