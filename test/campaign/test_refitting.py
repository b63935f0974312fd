"""What was named is fitted with its own law, and withdrawn where it fails on unseen units."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.campaign.searching import refit as refitting
from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.refit import (
    blanked,
    explained,
    foretold,
    refit,
    rejudged,
    sized,
    unseen,
    withdrawn,
)
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.diagnosis.result import Diagnosis, Finding, Unexplained
from wrist_stiffness.diagnosis.sealed import HeldOut
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.parameters import Estimate, Parameter
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

SHARE = 0.25
WIDTH_RAD = 2e-3


def measured(in_the_cell, model, *hidden, session=0):
    """Forty seconds of a wrist as it was built, registered anew in each session."""
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=40.0,
        program_seed=41 + session,
        hidden=hidden,
        base="wrong",
        base_seed=3,
        session=session,
    )
    return replace(in_the_cell(model.table, settings, session), name=f"session {session}")


@pytest.fixture(scope="module")
def lost_motion(model, in_the_cell):
    return measured(in_the_cell, model, HiddenEffect("backlash", "motor_1", "single", WIDTH_RAD, 5))


def backlash(width_mdeg):
    return Effect(find_law("backlash"), "motor_1", {"width_mdeg": Estimate(width_mdeg)})


def width(fitted):
    (found,) = (each for each in fitted.effects(0) if each.name == "backlash@motor_1")
    return found.estimates["width_mdeg"].value


def test_a_named_effect_gets_the_value_of_its_own_law(model, lost_motion):
    base = fit_base(model, (as_units(model, lost_motion),))
    # A tangent may be half as long again as the law.
    fitted = refit(
        Fitter(model), base, [backlash(1.5e3 * np.degrees(WIDTH_RAD))], SHARE, np.inf
    ).base
    assert fitted.extras == ("backlash@motor_1",)
    assert width(fitted) == pytest.approx(1e3 * np.degrees(WIDTH_RAD), rel=0.1)
    assert fitted.cost < 0.5 * base.cost


def test_an_effect_that_fails_on_unseen_units_is_withdrawn(model, in_the_cell, lost_motion):
    # The backlash was mended before the last ten seconds: what was learnt makes these worse.
    mended, late = measured(in_the_cell, model), np.arange(400) >= 300
    both = replace(
        lost_motion,
        shift=np.where(late[:, None], mended.shift, lost_motion.shift),
        rotation=np.where(late[:, None, None], mended.rotation, lost_motion.rotation),
    )
    base = fit_base(model, (as_units(model, both),))
    fitted = refit(Fitter(model), base, [backlash(1e3 * np.degrees(WIDTH_RAD))], SHARE, np.inf).base
    assert fitted.extras == ()


@pytest.mark.parametrize("saw_all", [False, True])
def test_what_fits_to_all_units_chose_is_judged_however_little_it_leaves(
    model, lost_motion, monkeypatch, saw_all
):
    """The part put aside was in those fits: that nothing is left is no proof."""
    base = fit_base(model, (as_units(model, lost_motion),))
    named = [backlash(1e3 * np.degrees(WIDTH_RAD))]
    fitted = refit(Fitter(model), base, named, SHARE, np.inf).base
    assert fitted.cost < refitting.INEXACT * 6 * base.problem.table.n_units
    asked = []
    judge = refitting.unseen

    def counted(*arguments):
        asked.append(judge(*arguments))
        return asked[-1]

    monkeypatch.setattr(refitting, "unseen", counted)
    again = refit(Fitter(model), base, named, SHARE, np.inf, saw_all)
    assert again.base.extras == ("backlash@motor_1",)
    assert again.stages == tuple(asked)
    assert len(asked) == (2 if saw_all else 0)
    energies = [each.energy for each in asked]
    assert sorted(energies, reverse=True) == energies


def test_errors_that_are_told_are_of_fits_that_had_not_seen_the_part(model, lost_motion):
    """Two micrometres more, there alone, are as much more of error: no fit took them up."""
    late, more = np.arange(400) >= 300, 2e-6 * np.array([0.0, 1.0, 0.0])
    moved = replace(lost_motion, shift=lost_motion.shift + late[:, None] * more)
    named, told = [backlash(1e3 * np.degrees(WIDTH_RAD))], []
    for session in (lost_motion, moved):
        base = fit_base(model, (as_units(model, session),))
        told.append(refit(Fitter(model), base, named, SHARE, np.inf, saw_all=True).stages)
    for before, after in zip(*told, strict=True):
        change = np.median(after.residual - before.residual, axis=0)
        np.testing.assert_allclose(change[:3], more, atol=2e-7)


def test_an_answer_is_told_with_the_errors_of_the_refits():
    found = answer(finding("backlash@motor_1", 5.0), finding("creep@joint_1", 2.0))
    found = replace(found, before={"s_um": 10.0, "phi_mdeg": 20.0})
    left = [HeldOut(np.full((9, 6), size), np.full(54, size)) for size in (4e-6, 3e-6, 1e-6)]
    told = rejudged(found, left)
    assert set(told.before) == set(found.before)
    for quantity in QUANTITIES:
        each = quantity.per_si * np.sqrt(3.0)
        assert told.before[quantity.key] == pytest.approx(4e-6 * each)
        assert told.after[quantity.key] == pytest.approx(1e-6 * each)
        assert told.findings[0].buys[quantity.key][0] == pytest.approx(1e-6 * each)
        assert told.findings[1].buys[quantity.key][0] == pytest.approx(2e-6 * each)
    assert told.findings[1].heldout_rmse_ratio == pytest.approx(1.0 / 3.0)
    assert rejudged(found, ()) is found


def test_what_was_not_judged_may_be_told_by_the_same_stages(model, lost_motion):
    base = fit_base(model, (as_units(model, lost_motion),))
    named = [backlash(1e3 * np.degrees(WIDTH_RAD))]
    judged = refit(Fitter(model), base, named, SHARE, base.cost, saw_all=True)
    told = foretold(Fitter(model), judged.base, judged.base.effects(0)[-1:], SHARE)
    assert len(told) == len(judged.stages) == 2
    for one, other in zip(told, judged.stages, strict=True):
        assert one.energy == pytest.approx(other.energy, rel=1e-3)
        np.testing.assert_allclose(one.residual, other.residual, atol=2e-8)


def test_a_finding_says_what_its_own_law_explains():
    """Slopes said a quarter of a bushing fifty times as soft, whose law reaches the noise."""
    found = answer(finding("backlash@motor_1", 5.0), finding("creep@joint_1", 2.0))
    left = [HeldOut(np.full((9, 6), size), np.full(54, size)) for size in (4e-6, 1e-6, 2e-6)]
    creep = Effect(find_law("creep"), "joint_1")
    first, second = explained(rejudged(found, left), [backlash(1.0), creep]).findings
    assert "its own law explains 93.8 % of what is left without it" in first.evidence
    assert "its own law explains 0.0 % of what is left without it" in second.evidence
    assert creep.law.sentence.format(place="joint_1") in second.evidence


@pytest.mark.slow
def test_a_base_beside_play_is_fitted_as_it_is(model, in_the_cell):
    """Without the play, links and flanges bear what a free pin does not pass on."""
    loose = measured(
        in_the_cell, model, HiddenEffect("joint_clearance", "joint_3", "algebraic", 12e-6, 5)
    )
    base = fit_base(model, (as_units(model, loose),))
    play = Effect(find_law("joint_clearance"), "joint_3", {"clearance_um": Estimate(12.0)})
    quick = fit_base(model, base.problem.sessions, [play])
    found = refit(Fitter(model), base, [play], SHARE, np.inf).base
    assert found.extras == ("joint_clearance@joint_3",)
    assert found.cost < 0.8 * quick.cost


@pytest.mark.slow
def test_a_session_put_aside_is_registered_anew_and_nothing_else(model, in_the_cell, lost_motion):
    days = (lost_motion, measured(in_the_cell, model, session=1))
    sessions = tuple(as_units(model, day) for day in days)
    fitted = fit_base(model, sessions, [backlash(1e3 * np.degrees(WIDTH_RAD))])
    aside = fitted.problem.table.sessions == 1
    seen = blanked(sessions, aside)
    assert seen[0].measured.sum() == sessions[0].measured.sum()
    assert not seen[1].measured.any()
    along = fit_base(model, seen, [backlash(1e3 * np.degrees(WIDTH_RAD))], fitted)
    alone = fit_base(model, seen)
    count = fitted.problem.table.measured[aside].sum()
    # The second day had no backlash; without refitted registrations a millimetre would be left.
    left = unseen(alone, sessions, aside, fitted).energy
    assert unseen(along, sessions, aside, fitted).energy > 2.0 * left
    # Seven times the noise: the first day's backlash bent the base.
    assert left < 10.0 * count


@dataclass(frozen=True)
class Days:
    """A problem of one number of the wrist and one of each day, which all of its poses show."""

    sessions: tuple
    true: tuple = (0.3, 5.0, -2.0)
    unknowns = tuple(SimpleNamespace(free=0, key="turn_mdeg", session=n) for n in (None, 0, 1))
    free = (SimpleNamespace(effect=SimpleNamespace(name="frame@sensor")),)
    day, lever = np.repeat([0, 1], 3), np.tile([0.5, 1.0, 1.5], 2)

    def residual(self, z):
        """Each pose is curved otherwise in what is set up anew: first order holds nearby alone."""
        own, true = np.array(z), np.array(self.true)
        turned = np.exp(self.lever * own[1 + self.day]) - np.exp(self.lever * true[1 + self.day])
        return np.tile((turned + own[0] - true[0])[:, None], 6)

    def columns(self, z, places):
        own = np.zeros((len(self.day), 6, len(z)))
        own[:, :, 0] = 1.0
        for n in (0, 1):
            rows, lever = self.day == n, self.lever[self.day == n]
            own[rows, :, 1 + n] = (lever * np.exp(lever * z[1 + n]))[:, None]
        return own[:, :, list(places)]

    def whiten(self, values):
        return values.reshape(6 * len(self.day), *values.shape[2:])


def test_what_is_set_up_anew_on_an_unseen_day_begins_where_all_units_led():
    """From its drawing a registration would end elsewhere, and foretell nothing."""
    sessions = tuple(SimpleNamespace(measured=np.ones(3, dtype=bool)) for _ in range(2))
    blank = (sessions[0], SimpleNamespace(measured=np.zeros(3, dtype=bool)))
    far = np.array([0.3, 5.0, 7.0])
    fitted = SimpleNamespace(problem=Days(blank), z=far)
    whole = SimpleNamespace(problem=Days(sessions), z=np.array([0.1, 4.0, -2.01]))
    aside = Days.day == 1
    left = unseen(fitted, sessions, aside, whole)
    assert left.residual.shape == (3, 6)
    assert np.abs(left.residual).max() < 1e-4
    assert left.energy == pytest.approx(np.sum(left.residual**2))
    # Everything else keeps its value, and so does the fit itself.
    assert fitted.z is far
    assert far.tolist() == [0.3, 5.0, 7.0]
    # A day of which the fit saw something keeps its registration.
    seen = SimpleNamespace(problem=Days(sessions), z=far)
    assert unseen(seen, sessions, aside, whole).residual.min() > 10.0


@pytest.fixture
def laws(monkeypatch):
    """A fitter that leaves much more than noise, and of unseen units less with each effect.

    Other energies of these are listed by names, and costs, `anew` of fits from the drawing.
    """
    laws = SimpleNamespace(cost={}, anew={}, energy={}, variance=4.0 * refitting.INEXACT)

    def fit(sessions, extras=(), start=None, beside=False):
        names = tuple(each.name for each in extras)
        costs = laws.anew if start is None else laws.cost
        return SimpleNamespace(
            extras=names,
            cost=costs.get(names, 0.0),
            variance=laws.variance,
            beyond=lambda: {each.name: each for each in extras},
            problem=SimpleNamespace(sessions=sessions, table=None),
        )

    def judge(fitted, sessions, aside, whole):
        energy = laws.energy.get(fitted.extras, 100.0 / (1 + len(fitted.extras)))
        return HeldOut(np.zeros((1, 6)), np.array([np.sqrt(energy)]))

    monkeypatch.setattr(refitting, "sealed_units", lambda table, share: None)
    monkeypatch.setattr(refitting, "blanked", lambda sessions, aside: sessions)
    monkeypatch.setattr(refitting, "unseen", judge)
    laws.fit = fit
    return laws


def entered(*names):
    laws = {name: SimpleNamespace(id=name.split("@")[0]) for name in names}
    return [SimpleNamespace(name=name, law=law, parameters=()) for name, law in laws.items()]


TWO = "backlash@motor_1", "creep@joint_1"


def test_what_entered_last_is_withdrawn_first(laws):
    """The first explained most, and the last was named beside it."""
    laws.energy = {TWO: 200.0}
    kept = refit(laws.fit, laws.fit(()), entered(*TWO), SHARE, np.inf).base
    assert kept.extras == TWO[:1]


def test_what_leaves_more_than_the_base_alone_is_judged_by_unseen_units(laws):
    """Slopes named it; its own law ends elsewhere, though that is hardly more than noise."""
    laws.variance = 1.0
    laws.cost = laws.anew = {(): 100.0, TWO: 120.0}
    laws.energy = {TWO: 200.0, TWO[:1]: 200.0}
    assert refit(laws.fit, laws.fit(()), entered(*TWO), SHARE, 100.0).base.extras == ()
    assert refit(laws.fit, laws.fit(()), entered(*TWO), SHARE, 130.0).base.extras == TWO


def test_nothing_is_withdrawn_that_foretells_unseen_units(laws):
    kept = refit(laws.fit, laws.fit(()), entered(*TWO), SHARE, np.inf).base
    assert kept.extras == TWO


def test_each_stage_has_one_effect_more(laws):
    """From these the technician is told what each of them buys."""
    three = (*TWO, "drift@pose_sensor")
    told = refit(laws.fit, laws.fit(()), entered(*three), SHARE, np.inf, saw_all=True)
    assert told.base.extras == three
    assert [each.energy for each in told.stages] == pytest.approx([100.0, 50.0, 100.0 / 3, 25.0])


def test_stages_end_with_what_was_kept(laws):
    laws.energy = {TWO: 200.0}
    told = refit(laws.fit, laws.fit(()), entered(*TWO), SHARE, np.inf, saw_all=True)
    assert [each.energy for each in told.stages] == pytest.approx([100.0, 50.0])
    laws.energy[TWO[:1]] = 200.0
    told = refit(laws.fit, laws.fit(()), entered(*TWO), SHARE, np.inf, saw_all=True)
    assert (told.base.extras, told.stages) == ((), ())


@pytest.mark.parametrize(("cost", "anew"), [(300.0, 500.0), (500.0, 300.0)])
def test_a_base_that_nothing_was_named_of_is_fitted_from_both_its_starts(laws, cost, anew):
    """What is not named may have drawn it along, or out of a wrong flange's hold."""
    laws.cost, laws.anew = {(): cost}, {(): anew}
    found = laws.fit((), entered(*TWO))
    again = refit(laws.fit, found, [], SHARE, np.inf).base
    assert again.extras == ()
    assert again.cost == 300.0


class TestWhatComesToNothing:
    """Play of nothing was named: along with it the base had found out of a wrong flange's hold."""

    FIRST, SECOND = TWO

    def kept(self, laws, sizes, costs):
        """Return what is kept of two effects, of sizes in usual ones; their shape is no size."""
        size, shape = Parameter("size", -9.0, 9.0, 2.0), Parameter("shape", 0.0, 9.0, 2.0, mean=5.0)
        named = entered(*TWO)
        for each in named:
            each.parameters = (size, shape)
            each.estimates = {"size": Estimate(2.0 * sizes[each.name]), "shape": Estimate(9.0)}
        laws.cost = laws.anew = costs
        return refit(laws.fit, laws.fit(()), named, SHARE, np.inf).base

    @pytest.mark.parametrize("nil", TWO)
    def test_it_goes_whenever_it_entered(self, laws, nil):
        (other,) = set(TWO) - {nil}
        costs = {(): 900.0, TWO: 200.0, (other,): 203.0, (nil,): 900.0}
        assert self.kept(laws, {nil: 0.04, other: 3.0}, costs).extras == (other,)

    def test_all_of_it_goes(self, laws):
        costs = dict.fromkeys([(), TWO, TWO[:1], TWO[1:]], 200.0)
        assert self.kept(laws, dict.fromkeys(TWO, 0.0), costs).extras == ()

    def test_a_small_one_that_is_missed_stays(self, laws):
        costs = {(): 900.0, TWO: 200.0, TWO[:1]: 205.0, TWO[1:]: 205.0}
        assert self.kept(laws, dict.fromkeys(TWO, 0.04), costs).extras == TWO

    def test_one_that_has_a_size_is_not_asked(self, laws):
        """With play in the base a fit takes long, and units put aside judge it."""
        costs = {(): 900.0, TWO: 200.0, TWO[:1]: 200.0, TWO[1:]: 200.0}
        assert self.kept(laws, dict.fromkeys(TWO, 0.06), costs).extras == TWO


def test_the_base_alone_foretells_from_where_it_stood_along_with_effects(laws, monkeypatch):
    """From the drawing it may be caught, and anything beside it would seem to foretell more."""
    laws.cost, laws.anew = {(): 100.0}, {(): 300.0}
    fit, alone = laws.fit, []

    def judged(fitted, *others):
        alone.extend([fitted.cost] if not fitted.extras else [])
        return HeldOut(np.zeros((1, 6)), np.ones(1))

    monkeypatch.setattr(refitting, "unseen", judged)
    refit(fit, fit(()), entered(*TWO), SHARE, np.inf)
    assert alone == [100.0]


def finding(name, fall):
    effect, component = name.split("@")
    return Finding(
        ((effect, component),), {}, 0.9, 50.0, 1e-3, 1.0, {"s_um": (fall, 0.1)}, "yes", "", ""
    )


def answer(*findings):
    nothing = Unexplained((), 0.02, "")
    floor, before, after = {"s_um": 1.0}, {"s_um": 10.0}, {"s_um": 3.0}
    scope = "this session only"
    return Diagnosis("effect", "dwell", floor, before, after, (), findings, nothing, (), 0, scope)


def test_an_answer_says_what_was_withdrawn():
    two = (finding("backlash@motor_1", 5.0), finding("creep@joint_1", 2.0))
    whole = answer(*two)
    told = withdrawn(whole, [two[0].name])
    assert told.findings == two[:1]
    assert told.verdict == "unknown"
    assert told.after == {"s_um": 5.0}
    assert told.unexplained.evidence == (
        "creep@joint_1 with its own law is nothing, or makes the sealed part worse"
    )
    assert withdrawn(whole, [each.name for each in two]) is whole
    assert withdrawn(whole, [two[1].name]).findings == two[1:]


def test_an_effect_far_beyond_the_usual_is_told_as_such():
    (usual,) = sized(answer(finding("backlash@motor_1", 5.0)), [backlash(60.0)]).findings
    (huge,) = sized(answer(finding("backlash@motor_1", 5.0)), [backlash(2400.0)]).findings
    assert usual.evidence == ""
    assert huge.evidence == "; far beyond its usual size: width_mdeg = 2.4e+03"


def test_the_furthest_of_several_parameters_is_told():
    """An axis two millimetres off is no less strange where it is not tilted."""
    axis = Effect(find_law("axis_misalignment"), "joint_4").with_values({"shift_u_um": 2e3})
    (told,) = sized(answer(finding(axis.name, 5.0)), [axis]).findings
    assert told.evidence == "; far beyond its usual size: shift_u_um = 2e+03"
