"""The whole way: a session of the virtual cell, or a recording, to a named effect."""

from dataclasses import replace

import numpy as np
import pytest
from measured_wrist import problem_of_a_wrist_that_misses_something, wrong_wrist

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.search import ranked
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.catalogue import HiddenEffect, build
from wrist_stiffness.simulation.cell import CellSettings

SECONDS = 120.0

BACKLASH = HiddenEffect("backlash", "motor_1", "single", 1e-3, 5)


def measured(
    in_the_cell,
    model,
    hidden=(),
    base="wrong",
    seed=3,
    session=0,
    seconds=SECONDS,
    experiment="rich",
):
    """One session of a wrist with a wrong base, ten measurements a second."""
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=seconds,
        program_seed=41 + session,
        experiment=experiment,
        hidden=hidden,
        base=base,
        base_seed=seed,
        session=session,
    )
    return in_the_cell(model.table, settings, seed + session)


@pytest.fixture(scope="module")
def worn(model, in_the_cell):
    """A day of a wrist with backlash, and what is found in it."""
    session = measured(in_the_cell, model, (BACKLASH,))
    return session, diagnose_sessions(model, [session])


@pytest.mark.slow
def test_a_wrong_base_alone_is_no_missing_effect(model, in_the_cell):
    found = diagnose_sessions(model, [measured(in_the_cell, model)])
    assert found.diagnosis.verdict == "none"
    assert found.diagnosis.probability > 0.9
    assert found.effects == ()
    assert max(found.diagnosis.discrepancy.values()) == 0.0
    # The millimetre and the fifth of a degree of the registrations are told instead.
    taken = next(line for line in found.diagnosis.absorbed if "measurement_frame" in line)
    assert float(taken.split(": ")[1].split(" um")[0]) > 100.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 6, 18])
def test_a_sound_wrist_whose_fit_stops_at_a_kink_misses_nothing(model, in_the_cell, seed):
    """Of the seeds 1 to 24 these three: slopes from the means end at 3 to 6 times the noise."""
    settings = wrong_wrist(60.0, seed, seed)
    session = in_the_cell(model.table, settings, 1)
    assert not WristProblem(model, (as_units(model, session),)).begin().rough


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "readings"), [(1, 2), (3, 2), (4, 2), (1, 3), (3, 3)])
def test_a_sound_wrist_read_a_few_times_at_each_rest_misses_nothing(
    model, in_the_cell, seed, readings
):
    """By an instrument that states nothing, 0.4 s apart, as a table of a touch probe holds them."""
    settings = wrong_wrist(240.0, seed, seed)
    session = in_the_cell(model.table, settings, seed)
    cut = as_units(model, session).cut
    ends = [np.flatnonzero(cut.label == unit)[-1] for unit in np.flatnonzero(cut.dwell)]
    rows = np.sort(np.concatenate([np.array(ends) - 4 * n for n in range(readings)]))
    few = replace(session.take(rows), covariance=None)
    units = as_units(model, few)
    assert units.cut.dwell.all()
    assert not WristProblem(model, (units,)).begin().rough


def test_backlash_behind_a_wrong_base_is_named_with_its_width(worn):
    _, found = worn
    (finding,) = found.diagnosis.findings
    assert finding.names == ("backlash@motor_1",)
    assert finding.probability > 0.99
    value, error = finding.parameters["width_mdeg"]
    assert abs(value - 1e3 * np.degrees(BACKLASH.magnitude)) < 3.0 * error
    # A hidden encoder count is 4 mdeg, and two minutes have some ten dwells for each side.
    assert error < 5.0
    assert found.effects[0].estimates["width_mdeg"].value == value
    assert found.diagnosis.after["phi_mdeg"] < 0.5 * found.diagnosis.before["phi_mdeg"]


@pytest.mark.slow
@pytest.mark.parametrize("form", ["one_sided", "linear"])
def test_a_drive_that_is_softer_one_way_is_named_and_its_law_gives(model, in_the_cell, form):
    hidden = HiddenEffect("drive_compliance", "motor_1", form, 0.05, 5)
    session = measured(in_the_cell, model, (hidden,))
    (finding,) = diagnose_sessions(model, [session]).diagnosis.findings
    assert finding.names == ("drive_compliance@motor_1",)
    if form == "linear":
        assert finding.gives == {}
        return
    about = np.concatenate([np.zeros(3), model.table.geometry.axes["joint_1"]])
    _, slopes = build(hidden, model.table).bend(None, np.outer([1.0, -1.0], about))
    soft, stiff = about @ slopes @ about
    value, error = finding.gives["asymmetry"]
    assert abs(abs(value) - abs(soft - stiff) / (soft + stiff)) < 3.0 * error < 0.1
    assert "growth" not in finding.gives
    assert "One way it is 2." in finding.evidence


@pytest.mark.slow
def test_play_and_lost_motion_together_are_both_named(model, in_the_cell):
    """The first one found takes most of the error or most of the evidence; the search goes on."""
    play = HiddenEffect("joint_clearance", "joint_3", "algebraic", 8e-7, 5)
    lost = replace(BACKLASH, magnitude=1.2e-3)
    session = measured(in_the_cell, model, (play, lost), seconds=60.0)
    found = diagnose_sessions(model, [session]).diagnosis
    names = {each.name for each in found.findings}
    assert names == {"joint_clearance@joint_3", "backlash@motor_1"}


@pytest.mark.slow
def test_every_candidate_stands_somewhere_and_says_why(worn):
    _, found = worn
    standings = {each.name: each for each in found.diagnosis.standings}
    assert standings["backlash@motor_1"].why_not == ""
    others = [each for name, each in standings.items() if name != "backlash@motor_1"]
    assert len(others) > 50
    assert all(each.why_not for each in others)
    assert all(each.probability < 0.01 for each in others)


@pytest.mark.slow
def test_what_a_rival_changes_is_told_unit_by_unit(worn):
    _, found = worn
    change = found.change_by("backlash@motor_1")
    assert change.shape == found.nominal.residual.shape
    left = np.nansum((found.nominal.residual - change)[:, 3:] ** 2)
    assert left < 0.2 * np.nansum(found.nominal.residual[:, 3:] ** 2)
    with pytest.raises(InputError, match="gravity@link_1: was not fitted"):
        found.change_by("gravity@link_1")


@pytest.mark.slow
def test_turns_alone_name_it_and_an_instrument_that_states_no_scatter_mutes_nothing(model, worn):
    nowhere = np.full_like(worn[0].shift, np.nan)
    found = diagnose_sessions(model, [replace(worn[0], shift=nowhere, covariance=None)])
    assert [finding.name for finding in found.diagnosis.findings] == ["backlash@motor_1"]


@pytest.mark.slow
def test_an_instrument_that_states_no_scatter_names_no_drift(model, in_the_cell):
    sound = replace(measured(in_the_cell, model, seconds=60.0), covariance=None)
    assert diagnose_sessions(model, [sound]).diagnosis.verdict == "none"


@pytest.mark.slow
def test_another_day_judges_what_the_first_one_shows(model, in_the_cell, worn):
    other = measured(in_the_cell, model, (BACKLASH,), session=1)
    found = diagnose_sessions(model, [worn[0], other]).diagnosis
    assert found.scope == "another session"
    assert [each.name for each in found.findings] == ["backlash@motor_1"]
    fall, error = found.findings[0].buys["phi_mdeg"]
    assert fall > 3.0 * error > 0.0


@pytest.mark.slow
def test_what_makes_another_day_worse_is_not_handed_over(model, in_the_cell, worn):
    """The motor was repaired before the second day."""
    repaired = measured(in_the_cell, model, session=1)
    found = diagnose_sessions(model, [worn[0], repaired])
    assert found.effects == ()
    assert found.diagnosis.findings == ()
    assert found.diagnosis.verdict == "unknown"


@pytest.mark.slow
@pytest.mark.parametrize("other", [0, 1], ids=["one", "two"])
def test_two_wrists_are_told_from_two_programs(model, in_the_cell, other):
    """A program of few poses leaves much in one of many, of the same wrist too."""
    programs = enumerate(("production", "heavy"))
    days = [
        measured(in_the_cell, model, seed=6 + n * other, session=n, experiment=each)
        for n, each in programs
    ]
    found = diagnose_sessions(model, days).diagnosis
    assert found.after["s_um"] > 2.0 * found.held_out_noise["s_um"]
    assert found.unforeseen["s_um"] > 1.5
    if other:
        assert (found.verdict, found.probability) == ("unknown", 1.0)
        assert found.contradicted["s_um"] > 1.5
    else:
        assert (found.verdict, found.contradicted) == ("none", {})


@pytest.mark.slow
def test_a_time_that_is_over_is_said(model, in_the_cell):
    session = measured(in_the_cell, model, (BACKLASH,), seconds=40.0)
    whole = diagnose_sessions(model, [session], seconds=1e-3)
    found = whole.diagnosis
    assert found.findings == ()
    assert not found.complete
    assert whole.proposals is None, "a law is asked for where the catalogue has none"
    backlash = next(each for each in found.standings if each.name == "backlash@motor_1")
    assert backlash in found.promising
    assert "time was over" in backlash.why_not
    assert backlash.probability is None


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"naming": 90.0}, "probability 9000 %: must be between 0 and 100 %"),
        ({"seconds": 0.0}, "0 seconds"),
    ],
)
def test_settings_that_cannot_be_are_refused(model, in_the_cell, setting, words):
    session = measured(in_the_cell, model, base="exact")
    with pytest.raises(InputError, match=words):
        diagnose_sessions(model, [session], **setting)


def test_no_session_is_refused(model):
    with pytest.raises(InputError, match="no session to diagnose"):
        diagnose_sessions(model, [])


def test_a_session_without_a_measured_pose_is_named(model, in_the_cell):
    session = measured(in_the_cell, model, base="exact")
    nothing = np.full_like(session.shift, np.nan), np.full_like(session.rotation, np.nan)
    blank = replace(session, name="tuesday", shift=nothing[0], rotation=nothing[1])
    for sessions in ([session, blank], [blank, session]):
        with pytest.raises(InputError, match="tuesday: no measured pose"):
            diagnose_sessions(model, sessions)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drive_that_is_stiffer_than_stiff_is_not_asked(model, in_the_cell, sign):
    """What is measured moves as a soft drive would move it, or the other way."""
    name = "drive_compliance@motor_1"
    units = as_units(model, measured(in_the_cell, model))
    about = WristProblem(model, (units,))
    soft = (find_law("drive_compliance"), "motor_1", {"compliance_mdeg_per_Nm": 3000.0})
    change = np.zeros((len(units), 6))
    change[units.measured] = about.about(about.begin()).changes([soft])[0]
    moved = replace(units, values=units.values + sign * change)
    problem = problem_of_a_wrist_that_misses_something(model, moved)
    fit = problem.begin()
    (trial,) = (each for each in problem.trials(fit) if each.name == name)
    (first,) = ranked(fit.evidence.without_discrepancy(), [trial])
    found = problem.added(fit, first)
    (place,) = problem.nearly(fit, first).places[name]
    assert problem.nearly(fit, first).point.columns[:, place].any() == (sign > 0.0)
    if sign > 0.0:
        assert first.gain > 10.0
        assert found.evidence.log > fit.evidence.log + 10.0
        return
    assert first.gain == first.z[0] == 0.0
    assert found is None
    # Who adds it all the same learns that there is none, to within what the data tell, and the
    # evidence does not count what a drive below nothing would explain.
    own = effect_at(*soft[:2], {"compliance_mdeg_per_Nm": 1000.0})
    asked = problem.extended(fit, own)
    (place,) = asked.places[name]
    assert asked.base.z[place] == 0.0
    assert asked.evidence.log == pytest.approx(fit.evidence.log, abs=1.0)
    assert asked.whole.columns[:, place].any()
    assert np.sqrt(asked.covariance[place, place]) * asked.base.problem.unknowns[place].step < 800.0


@pytest.mark.slow
def test_a_quick_fit_tells_what_slopes_cannot(model, in_the_cell):
    """Flanges close under a weight: about the wrist without it the slopes say far too little."""
    hidden = HiddenEffect("gravity", "platform", "mass", 0.17, 5)
    units = as_units(model, measured(in_the_cell, model, (hidden,)))
    problem = problem_of_a_wrist_that_misses_something(model, units)
    fit = problem.begin()
    (trial,) = (each for each in problem.trials(fit) if each.name == "gravity@platform")
    (first,) = ranked(fit.evidence, [trial])
    near, whole = problem.nearly(fit, first), problem.added(fit, first)
    gained, nearly = (each.evidence.log - fit.evidence.log for each in (whole, near))
    short = gained - first.gain
    assert short > 30.0
    assert abs(gained - nearly) < short / 3.0
    # That is what makes it quick: the base's columns are those without the weight.
    of_base = near.base.columns[:, :, near.base.of_base]
    np.testing.assert_array_equal(of_base, fit.base.columns)
