"""Chances by rearrangement are what they say; what a session sets up anew judges nothing."""

import numpy as np
import pytest

from wrist_stiffness.diagnosis.candidates import Candidate, Parameter
from wrist_stiffness.diagnosis.fitted import FittedModel
from wrist_stiffness.diagnosis.hypotheses import Hypothesis
from wrist_stiffness.diagnosis.nuisance import Nuisance
from wrist_stiffness.diagnosis.observations import Observations
from wrist_stiffness.diagnosis.permutation import rearrangements
from wrist_stiffness.diagnosis.projection import make_base
from wrist_stiffness.diagnosis.ranking import chance_of_best, scored
from wrist_stiffness.diagnosis.sealed import held_out
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
    base = make_base(columns, prior_std, values, UNITS)
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
    rearranged = rearrangements(base, np.zeros(UNITS, dtype=np.int64), 99, rng)
    return chance_of_best(base, ranked, rearranged)


def test_p_values_of_the_best_are_even_where_nothing_hides():
    found = np.array([best_by_chance(seed) for seed in range(200)])
    # Three standard deviations of 200 draws; a test that says 1 too often finds nothing either.
    assert np.mean(found) == pytest.approx(0.5, abs=3.0 * 0.29 / np.sqrt(200))
    assert np.mean(found <= 0.1) == pytest.approx(0.1, abs=3.0 * 0.3 / np.sqrt(200))


def test_a_tolerance_far_beyond_its_prior_is_no_chance():
    """All that speaks for it stands in its prior: the data are explained."""
    assert max(best_by_chance(seed, strain=7.0) for seed in range(10)) == pytest.approx(0.01)


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
