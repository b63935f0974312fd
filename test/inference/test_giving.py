"""Laws that give: columns made of an effect's own change."""

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from wrist_stiffness.inference.giving import ONE_WAY, SPREAD, WAYS, given, told

SCALE = np.array([2e-6, 2e-6, 2e-6, 1e-5, 1e-5, 1e-5])


def effect(rng, n=60):
    """An effect along one screw, of both signs, and how much of it each unit has."""
    amount = rng.normal(size=n)
    return amount, amount[:, None] * SCALE * rng.normal(size=6)


@settings(max_examples=30, deadline=None)
@drawn(st.integers(0, 1000), st.floats(1e-9, 1e9))
def test_ways_are_what_an_uneven_or_bent_law_adds_to_first_order(seed, size):
    amount, change = effect(np.random.default_rng(seed))
    uneven, bent = np.moveaxis(given(size * change, SCALE), -1, 0) / size
    # Which of the sides counts as the larger one has no meaning.
    sides = np.sign(amount)[:, None] * change * SPREAD
    assert np.allclose(uneven, sides) or np.allclose(uneven, -sides)
    usual = np.sqrt(np.mean(amount**2))
    power = 1e-6
    grown = change * ((np.abs(amount) / usual) ** power)[:, None]
    assert np.allclose((grown - change) / power * SPREAD, bent, rtol=1e-4, atol=1e-4 * SCALE.max())


def test_an_effect_that_is_nowhere_gives_nothing():
    assert np.array_equal(given(np.zeros((5, 6)), SCALE), np.zeros((5, 6, len(WAYS))))


@pytest.mark.parametrize(
    ("way", "value", "words"),
    [
        ("asymmetry", 0.2, "One way it is 1.50 +- 0.03 times as large as the other."),
        ("asymmetry", -0.2, "One way it is 1.50 +- 0.03 times"),
        ("asymmetry", 3.0, f"One way it is {(1 + ONE_WAY) / (1 - ONE_WAY):.2f}"),
        ("growth", 0.5, "grows faster than its law, as what softens: with the power 1.50 +- 0.01"),
        ("growth", -0.1, "grows slower, as what saturates: with the power 0.90 +- 0.01"),
    ],
)
def test_a_law_that_gives_is_told_in_words(way, value, words):
    assert words in told(way, value, 0.01)
