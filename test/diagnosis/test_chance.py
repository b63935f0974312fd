"""Chances by rearrangement are what they say; what a session sets up anew judges nothing."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.diagnosis.candidates import Candidate, Parameter
from wrist_stiffness.diagnosis.discrepancy import find_discrepancy
from wrist_stiffness.diagnosis.fitted import FittedModel
from wrist_stiffness.diagnosis.hypotheses import Hypothesis, all_hypotheses, make_evidence
from wrist_stiffness.diagnosis.nuisance import Nuisance, nuisance_columns
from wrist_stiffness.diagnosis.observations import Observations
from wrist_stiffness.diagnosis.permutation import rearranged_residuals
from wrist_stiffness.diagnosis.projection import make_base
from wrist_stiffness.diagnosis.ranking import chance_of_best, scored
from wrist_stiffness.diagnosis.resampling import time_blocks
from wrist_stiffness.diagnosis.sealed import held_out
from wrist_stiffness.diagnosis.selection import select
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.whitening import NoiseModel

UNITS = 120
SIZES = (1, 1, 1, 4, 8, 20)
"""Columns of the candidates: springs of many constants stand beside plain scales."""


PRIORS = 8
"""Of the base's parameters; each of these is a candidate as well, as tolerances are."""


def with_priors(columns):
    return np.vstack([columns, np.zeros((PRIORS, columns.shape[1]))])


def best_by_chance(seed, strain=None):
    """Return the p value of the best of a catalogue.

    Nothing hides beside the base, whose parameters lie where their priors say, but for the first
    one if a strain is given.
    """
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(UNITS, PRIORS + 3))
    tolerances = rng.normal(size=PRIORS)
    if strain is not None:
        tolerances[0] = strain
    values = rng.normal(size=UNITS) + columns[:, :PRIORS] @ tolerances
    prior_std = np.append(np.ones(PRIORS), np.full(3, np.inf))
    base = make_base(np.column_stack([columns, values]), prior_std, UNITS)
    hypotheses = [
        Hypothesis(
            Candidate(
                f"effect_{place}",
                "here",
                tuple(Parameter(f"p_{k}", scale=0.3) for k in range(size)),
                lambda units, shape: np.empty(0),
            ),
            (),
            with_priors(rng.normal(size=(UNITS, size))),
        )
        for place, size in enumerate(SIZES)
    ]
    hypotheses += [
        Hypothesis(
            Candidate(
                "tolerance",
                f"part_{number}",
                (Parameter("p", scale=1.0),),
                lambda units, shape: np.empty(0),
            ),
            (),
            with_priors(columns[:, [number]]),
        )
        for number in range(PRIORS)
    ]
    ranked = scored(base, hypotheses, 10.0, np.inf)
    rearranged = rearranged_residuals(base, np.zeros(UNITS, dtype=np.int64), 99, rng)
    return chance_of_best(base, ranked, rearranged)


def test_p_values_of_the_best_are_even_where_nothing_hides():
    found = np.array([best_by_chance(seed) for seed in range(200)])
    # Three standard deviations of 200 draws; a test that says 1 too often finds nothing either.
    assert np.mean(found) == pytest.approx(0.5, abs=3.0 * 0.29 / np.sqrt(200))
    assert np.mean(found <= 0.1) == pytest.approx(0.1, abs=3.0 * 0.3 / np.sqrt(200))


def test_a_tolerance_far_beyond_its_prior_is_no_chance():
    """All that speaks for it stands in its prior: the data are explained."""
    assert max(best_by_chance(seed, strain=7.0) for seed in range(10)) == pytest.approx(0.01)


def noise_with_blanks(rng, share, elsewhere=0.0):
    """Noise of known size in two components, of which a share of the units has the first alone.

    The others stand `elsewhere` by so many standard deviations of each condition.
    """
    values = rng.normal(size=(100, 2))
    single = rng.random(100) < share
    values[single, 1] = np.nan
    conditions = {name: rng.normal(size=100) + elsewhere * ~single for name in "abcdef"}
    table = Observations(values, conditions)
    noise = NoiseModel(np.eye(2), 0.0, 1.0, np.inf, "given")
    offset = Nuisance("offset", lambda units: np.broadcast_to(np.eye(2), (units.n_units, 2, 2)))
    return make_evidence(table, noise, nuisance_columns(table, (offset,)))


def acts_on_the_second(name):
    def columns(units, _):
        return np.stack([np.zeros(units.n_units), units.covariate(name)], axis=1)[:, :, None]

    return Candidate("effect", name, (Parameter("slope", scale=0.3),), columns)


def test_what_is_rarely_measured_is_named_no_oftener_by_chance():
    named, often = 0, replace(Settings(), alpha=0.02)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        evidence = noise_with_blanks(rng, 0.8)
        catalogue = all_hypotheses(evidence, tuple(map(acts_on_the_second, "abcdef")))
        named += bool(select(evidence, catalogue, 6.0, often, rng))
    # 1.2 of 60 are expected, and more than five one time in a thousand.
    assert named <= 5


def test_chances_of_structure_are_even_where_units_differ_in_what_was_measured():
    found = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        evidence = noise_with_blanks(rng, 0.8, elsewhere=8.0)
        blocks = time_blocks(evidence.observations.sessions, 10)
        found.append(find_discrepancy(evidence, evidence.base, blocks, 49, 0.001, rng).p_value)
    # Three standard deviations of 100 draws.
    assert np.mean(found) == pytest.approx(0.51, abs=3.0 * 0.29 / np.sqrt(100))


def test_what_a_session_sets_up_anew_is_no_evidence_on_its_sealed_part():
    rng = np.random.default_rng(3)
    time = np.linspace(0.8, 1.0, 40)
    wander = Nuisance(
        "wander", lambda units: np.stack([units.times, units.times**2], 1)[:, None], None, True
    )
    noise = NoiseModel(np.eye(1), 0.0, 1.0, np.inf, "given")
    model = FittedModel((wander,), {("wander", 0, 0): 0.0, ("wander", 0, 1): 0.0}, (), noise)
    values = rng.normal(size=(40, 1))
    seen = Observations(values, {}, np.eye(1), time)
    moved = Observations(values + (7.0 * time - 4.0 * time**2)[:, None], {}, np.eye(1), time)
    assert held_out(model, moved).white == pytest.approx(held_out(model, seen).white, abs=1e-9)
    assert np.abs(held_out(model, moved).residual - held_out(model, seen).residual).max() > 2.0
