"""Each rule by which a diagnosis decides, at the size from which it decides otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.diagnosis import Candidate, Nuisance, Observations, Parameter, diagnose
from wrist_stiffness.diagnosis.discrepancy import features
from wrist_stiffness.diagnosis.findings import with_values
from wrist_stiffness.diagnosis.hypotheses import Hypothesis, all_hypotheses, make_evidence
from wrist_stiffness.diagnosis.noise import estimate_noise
from wrist_stiffness.diagnosis.nuisance import nuisance_columns
from wrist_stiffness.diagnosis.projection import make_base
from wrist_stiffness.diagnosis.ranking import Ranked, chance_of_best, scored
from wrist_stiffness.diagnosis.result import Finding
from wrist_stiffness.diagnosis.rivals import DECISIVE, indistinguishable
from wrist_stiffness.diagnosis.sealed import HeldOut, refuted
from wrist_stiffness.diagnosis.selection import select
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.structure import effective_dimension


def line(name):
    """The same slope over one condition in every component."""

    def columns(table, _):
        return np.stack([table.covariate(name)] * table.n_components, axis=1)[:, :, None]

    return Candidate("line", name, (Parameter("slope"),), columns)


OFFSET = Nuisance("offset", lambda table: np.broadcast_to(np.eye(2), (*table.values.shape, 2)))


def candidate(name, strain=0.0):
    return Candidate(name, "here", (Parameter("size"),), lambda *_: np.empty(0), strain=strain)


@pytest.mark.parametrize(
    ("gain", "left", "tolerance"),
    [
        (1e4, 0.0, DECISIVE),
        # A tenth of the best one's size may be wrong: 0.01 of 1000, in backgrounds of 1 + 30 / 10.
        (1e3, 30.0, DECISIVE + 10.0 / 4.0),
        # But no more than twice what it leaves.
        (1e5, 30.0, DECISIVE + 60.0 / 4.0),
    ],
)
def test_a_rival_stays_while_it_leaves_no_more_than_an_inexact_law(gain, left, tolerance):
    def ranked(name, score):
        hypothesis = Hypothesis(candidate(name), (), np.empty((0, 1)))
        return Ranked(hypothesis, np.empty((0, 1)), gain, left, score, 0.0)

    best, near = ranked("best", 100.0), ranked("near", 100.01 - tolerance)
    far = ranked("far", 99.99 - tolerance)
    members = indistinguishable([best, near, far], 10.0, Settings())
    assert [each.name for each in members] == ["best@here", "near@here"]


@pytest.mark.parametrize(("change", "worse"), [(3.9, False), (4.1, True)])
def test_a_loss_is_held_against_an_effect_from_twice_what_chance_makes_of_a_right_one(
    change, worse
):
    """The gain of a right change f scatters by 2 |f|; here all of f is wrong, and -f^2 is lost."""
    white = np.array([5.0, 0.0])
    before, after = (HeldOut(np.empty((0, 2)), white + [0.0, own]) for own in (0.0, change))
    assert refuted(before, after) == worse


def test_what_a_fit_relieved_the_priors_of_is_no_chance(rng):
    """No rearranged residual did that, so it counts for the measured one alone."""
    base = make_base(rng.normal(size=(80, 4)), np.full(3, np.inf), 80)
    column = rng.normal(size=(80, 1))
    rearranged = rng.normal(size=(80, 99))

    def chance(strain):
        hypothesis = Hypothesis(replace(candidate("fit", strain), fitted=2), (), column)
        return chance_of_best(base, scored(base, [hypothesis], 5.0, np.inf), rearranged)

    assert chance(-40.0) == pytest.approx(0.01)
    assert chance(0.0) > 0.05
    assert chance(40.0) == 1.0


def test_a_corrected_value_is_as_uncertain_in_proportion_but_never_less():
    finding = Finding(
        (("effect", "part"),),
        {"grown": (2.0, 0.1), "shrunk": (-2.0, 0.1), "nothing": (0.0, 0.1), "shape": (7.0, 0.1)},
        *(1.0, 1.0, 0.01, 1.0),
        {},
        True,
        "",
        "",
    )
    corrected = with_values(finding, np.array([3.0, -1.0, 1.0])).parameters
    assert corrected == {
        "grown": (3.0, pytest.approx(0.15)),
        "shrunk": (-1.0, 0.1),
        "nothing": (1.0, 0.1),
        "shape": (7.0, 0.1),
    }


@pytest.mark.parametrize("conditions", [1, 4])
def test_features_reach_so_many_deviations_in_however_many_conditions(rng, conditions):
    """Apart in every condition by its length scale, two units go together by exp(-1/2)."""
    length = 0.7
    unit = np.zeros((2, conditions))
    unit[1] = length
    pair = features(unit, length, rng)
    assert pair @ pair.T == pytest.approx(np.exp(-0.5 * (1.0 - np.eye(2))))


def test_what_explains_nothing_without_a_broken_effect_goes_with_it():
    """The slope over t only takes out of s + t what is not s; in the other session s + t fails."""
    rng = np.random.default_rng(5)
    session = np.repeat([0, 1], [100, 60])
    s, t = rng.uniform(-1.0, 1.0, (2, 160))
    s -= s[:100].mean()
    t -= t[:100].mean()
    t -= s * (s[:100] @ t[:100]) / (s[:100] @ s[:100])
    mixed = np.where(session == 0, s + t, 3.0 * t)
    values = rng.normal(size=(160, 2)) + 6.0 * s[:, None]
    table = Observations(values, {"mixed": mixed, "t": t}, session=session)
    found = diagnose(table, (line("mixed"), line("t")), (OFFSET,), rng)
    assert found.findings == ()
    assert "line@mixed fitted here makes the sealed part worse" in found.unexplained.evidence
    assert "line@t" not in found.unexplained.evidence


def test_places_are_given_anew_when_an_effect_has_left():
    """Slopes over u and v hide; d and e are these all but exactly, and the others mix them."""
    rng = np.random.default_rng(348)
    u, v, w = rng.uniform(-1.0, 1.0, (3, 120))
    told = {
        "a": u + v + 0.3 * rng.normal(size=120),
        "b": u + 0.15 * rng.normal(size=120),
        "c": v + 0.1 * rng.normal(size=120),
        "d": u + 0.05 * w,
        "e": v + 0.05 * rng.normal(size=120),
        "f": u - v + 0.2 * rng.normal(size=120),
    }
    table = Observations(rng.normal(size=(120, 2)), told)
    slopes = rng.uniform(2.0, 12.0, 2)
    table = table.with_values(table.values + (slopes @ [u, v])[:, None])
    candidates, nuisance = tuple(map(line, told)), nuisance_columns(table, (OFFSET,))
    structure = np.concatenate([each.evaluate(table, ()) for each in candidates], axis=2)
    noise = estimate_noise(table, nuisance.columns, structure)
    evidence = make_evidence(table, noise, nuisance)
    hypotheses = all_hypotheses(evidence, candidates)
    dimension = effective_dimension(evidence.base, hypotheses)
    found = select(evidence, hypotheses, dimension, Settings(), rng)
    assert sorted(each.name for each in found) == ["line@d", "line@e"]
