"""Rivals of a plan agree with the data at hand, however far that is from what is usual."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.planning import pool
from wrist_stiffness.planning.information import (
    RESOLVED,
    Goal,
    MeasurementNoise,
    by_truth,
    carried_over,
    discrimination,
    information,
)
from wrist_stiffness.planning.loads_file import AppliedLoad, Weight
from wrist_stiffness.planning.plan import Conditions, plan
from wrist_stiffness.planning.question import SESSION, between
from wrist_stiffness.planning.refit import Measured, fitted, rivals_alike
from wrist_stiffness.planning.signatures import signatures
from wrist_stiffness.planning.timeline import Pace, Visit, run_through

PACE = Pace(np.radians(30.0), 2.0, False)
HEAVY = {"mass_g": 150.0, "x_mm": -12.0, "y_mm": 6.0, "z_mm": -25.0}
"""Five times what would not surprise, and a moment that is no linear function of its values."""


@pytest.fixture(scope="module")
def noise(model):
    white = np.repeat([1e-6, np.radians(1e-3)], 3)
    return MeasurementNoise(white, model.table.geometry.limits.encoder_step)


def experiment(model, first=0):
    """Return sixteen poses under one load, or the later ones of them."""
    load = AppliedLoad("1 N", np.array([0.0, 0.0, -1.0]), *np.zeros((2, 3)), False, False, 1.0)
    angles = np.radians([-20.0, -7.0, 7.0, 20.0])
    visits = [Visit(np.array([x, y]), np.ones(2), load, True) for x in angles for y in angles]
    return run_through(visits[first:], model.table.workspace, PACE)


@pytest.fixture(scope="module")
def earlier(model):
    return experiment(model)


def asked(first, values, rival):
    effects = [effect_named(first).with_values(values), effect_named(rival)]
    return between([effects], [], np.random.default_rng(0))


def left(model, experiment, effect):
    (found,) = signatures(model, experiment.block, [(effect,)])
    return found.truths[..., 0]


@pytest.mark.parametrize("sessions", [1, 2])
def test_values_far_from_usual_are_found_again(model, noise, sessions):
    true = effect_named("gravity@link_3").with_values(HEAVY)
    data = []
    for number in range(sessions):
        own = experiment(model, 6 * number)
        nuisances = signatures(model, own.block, [(effect_named(name),) for name in SESSION])
        # Every session has a registration of its own, which is refitted there alone.
        moved = nuisances[0].columns @ np.full(6, 0.3 * number)
        data.append(Measured(own, nuisances, left(model, own, true) + moved))
    begun = effect_named("gravity@link_3").with_values({"mass_g": 20.0})
    # So little noise that the prior, ten plausible sizes wide, does not count.
    quiet = MeasurementNoise(0.1 * noise.white, 0.1 * noise.encoder_step)
    found = fitted(model, data, begun, SESSION, quiet)
    for key, value in HEAVY.items():
        assert found.estimates[key].value == pytest.approx(value, rel=0.02), key


def distance(model, noise, earlier, question):
    """Return what tells the first rival's measurements from the second one's, values as given."""
    nuisances = signatures(model, earlier.block, [(e,) for e in question.nuisances])
    sides = [left(model, earlier, sets[0]) for sets in question.effects]
    (own,) = signatures(model, earlier.block, [(question.effects[0][0],)])
    apart = replace(own, truths=(sides[0] - sides[1])[..., None])
    known = information(earlier, nuisances, SESSION, [apart], model.table, noise)
    return discrimination(known.total, known.layout, [Goal(own.name, "")])[0]


@pytest.mark.parametrize(
    ("first", "values", "rival"),
    [
        (
            "drive_compliance@motor_1",
            {"compliance_mdeg_per_Nm": 2000.0},
            "joint_clearance@joint_1",
        ),
        (
            "encoder_eccentricity@motor_1",
            {"cos_1_mdeg": 60.0, "sin_2_mdeg": 40.0},
            "gravity@link_1",
        ),
    ],
)
def test_a_rival_leaves_what_the_first_one_left(model, noise, earlier, first, values, rival):
    question = asked(first, values, rival)
    agreed = rivals_alike(model, question, [earlier], noise)
    assert [sets[0].name for sets in agreed.effects] == [first, rival]
    assert agreed.effects[0] == question.effects[0]
    before, after = (distance(model, noise, earlier, q) for q in (question, agreed))
    assert before > 2.0 * RESOLVED
    assert after < 0.3 * before


@pytest.mark.slow
def test_a_plan_ends_where_half_of_what_may_be_is_settled(model, noise, earlier, monkeypatch):
    """The rarest values would take many times as long; the next plan knows whether they hold."""
    monkeypatch.setattr(pool, "POOL", 10)
    told = []

    def spy(*given):
        told.append(by_truth(*given))
        return told[-1]

    monkeypatch.setattr("wrist_stiffness.planning.aims.by_truth", spy)
    weight = Weight("brass", 0.1, np.array([0.02, 0.0, -0.018]), 10.0)
    conditions = Conditions((weight,), PACE, noise, None, 0)
    question = asked("gravity@platform", HEAVY, "gravity@link_3")
    found = plan(model, question, conditions, [earlier])
    assert found.visits
    assert all(np.mean(d >= RESOLVED) >= 0.5 for d in told[-1])
    assert any(np.mean(d >= RESOLVED) < 0.5 for d in told[-2])


@pytest.mark.slow
def test_what_was_asked_is_open_however_settled_it_is_reckoned(model, noise, earlier, monkeypatch):
    """Where no law is quite right, earlier data are reckoned to tell more than they did.

    Here four times as much, which would settle the question without another pose.
    """
    monkeypatch.setattr(pool, "POOL", 10)
    monkeypatch.setattr(
        "wrist_stiffness.planning.aims.carried_over",
        lambda *given: 4.0 * carried_over(*given),
    )
    weight = Weight("brass", 0.1, np.array([0.02, 0.0, -0.018]), 10.0)
    question = asked("gravity@platform", HEAVY, "gravity@link_3")
    found = plan(model, question, Conditions((weight,), PACE, noise, None, 0), [earlier])
    assert {answer.goal for answer in found.answers} == set(question.goals)
    assert len(found.visits) > 3
    # Along with the earlier data it would be more than both: the root of the sum of squares.
    assert max(answer.discrimination for answer in found.answers) < np.sqrt(2.0) * RESOLVED


def test_earlier_data_put_nothing_in_reach(model, noise, earlier, monkeypatch):
    """Else a plan would ask for the longest time what its loads never tell."""
    monkeypatch.setattr(pool, "POOL", 10)
    # As if the pool told nothing, however long, and the earlier data all.
    monkeypatch.setattr("wrist_stiffness.planning.aims.LONGER", 0.0)
    monkeypatch.setattr(
        "wrist_stiffness.planning.aims.carried_over",
        lambda *given: 4.0 * carried_over(*given),
    )
    question = asked("gravity@platform", HEAVY, "gravity@link_3")
    found = plan(model, question, Conditions((), PACE, noise, None, 0), [earlier])
    assert found.timeline is None
    assert [answer.discrimination for answer in found.answers] == [0.0, 0.0]
