"""Sums of squares of resampled blocks, against fits to the rows themselves."""

import numpy as np
import pytest

from wrist_stiffness.diagnosis import Candidate, Observations, Parameter
from wrist_stiffness.diagnosis.discrepancy import predicted_energy
from wrist_stiffness.diagnosis.hypotheses import all_hypotheses, make_evidence
from wrist_stiffness.diagnosis.nuisance import Nuisance, nuisance_columns
from wrist_stiffness.diagnosis.resampling import BlockGrams
from wrist_stiffness.diagnosis.whitening import NoiseModel

UNITS, COMPONENTS = 40, 2


def explained(columns, values):
    """Return the sum of squares that a fit takes out."""
    fit = columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    return values @ values - (values - fit) @ (values - fit)


@pytest.fixture
def setting(rng):
    table = Observations(rng.normal(size=(UNITS, COMPONENTS)), {}, None, np.arange(UNITS * 1.0))
    noise = NoiseModel(np.eye(COMPONENTS), 0.3, 4.0, np.inf, "given")
    level = Nuisance("level", lambda units: np.ones((UNITS, COMPONENTS, 1)), (0.1,))
    evidence = make_evidence(table, noise, nuisance_columns(table, (level,)))

    def candidate(name, size):
        columns = rng.normal(size=(UNITS, COMPONENTS, size))
        numbers = tuple(Parameter(f"p{i}") for i in range(size))
        return Candidate(name, "place", numbers, lambda units, shape: columns[units.rows])

    return evidence, (candidate("one", 1), candidate("other", 3))


def test_blocks_count_as_often_as_they_are_drawn(setting):
    evidence, candidates = setting
    first, *rest = all_hypotheses(evidence, (*candidates, candidates[1]))
    base = evidence.base.extended(first.columns)
    blocks = np.arange(UNITS) // 10
    drawn = np.array([2.0, 0.0, 1.0, 1.0])
    grams = BlockGrams(base, rest, blocks)
    # A prior counts once, whatever is drawn.
    rows = np.sqrt(np.append(drawn[np.repeat(blocks, COMPONENTS)], 1.0))
    # The resample knows what the base left of all units, and refits the base to it.
    values, own = rows * base.residual, rows[:, None] * base.basis
    wanted = [
        explained(np.hstack([own, rows[:, None] * each.columns]), values) - explained(own, values)
        for each in rest
    ]
    np.testing.assert_allclose(grams.gains(drawn), wanted, rtol=1e-6)


def test_hypotheses_whitened_together_are_those_whitened_alone(setting):
    evidence, candidates = setting
    for each in all_hypotheses(evidence, candidates):
        alone = evidence.hypothesis(each.candidate, each.shape)
        np.testing.assert_allclose(each.columns, alone.columns, atol=1e-13)


def test_features_predict_blocks_they_have_not_seen(rng):
    features, residuals = rng.normal(size=(30, 4)), rng.normal(size=(30, 2, 3))
    blocks, signal = np.arange(30) // 6, 0.7
    wanted = np.zeros(3)
    for block in range(5):
        own, others = blocks == block, blocks != block
        for component in range(2):
            # A ridge is a prior row.
            rows = np.vstack([features[others], np.eye(4) / np.sqrt(signal)])
            target = np.vstack([residuals[others, component], np.zeros((4, 3))])
            weights = np.linalg.lstsq(rows, target, rcond=None)[0]
            seen = residuals[own, component]
            wanted += np.sum(seen**2 - (seen - features[own] @ weights) ** 2, axis=0)
    np.testing.assert_allclose(predicted_energy(features, residuals, blocks, signal), wanted)
