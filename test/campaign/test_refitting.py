"""What was named is fitted with its own law, and withdrawn where it fails on unseen units."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching import refit as refitting
from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.fitter import Fitter
from wrist_stiffness.campaign.searching.refit import (
    blanked,
    foretold,
    refit,
    unseen,
)
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.parameters import Estimate
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


@pytest.mark.slow
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


def test_what_was_not_judged_may_be_told_by_the_same_stages(model, lost_motion):
    base = fit_base(model, (as_units(model, lost_motion),))
    named = [backlash(1e3 * np.degrees(WIDTH_RAD))]
    judged = refit(Fitter(model), base, named, SHARE, base.cost, saw_all=True)
    told = foretold(Fitter(model), judged.base, judged.base.effects(0)[-1:], SHARE)
    assert len(told) == len(judged.stages) == 2
    for one, other in zip(told, judged.stages, strict=True):
        assert one.energy == pytest.approx(other.energy, rel=1e-3)
        np.testing.assert_allclose(one.residual, other.residual, atol=2e-8)


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
