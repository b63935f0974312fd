"""What is chosen for a plan, whatever its visits are."""

import numpy as np
import pytest

from wrist_stiffness.planning.aims import NEAREST, nearest
from wrist_stiffness.planning.choice import choose
from wrist_stiffness.planning.information import Goal

GRAMS = np.array([1.0, 4.0, 2.0])[:, None, None]


@pytest.mark.parametrize(("needed", "chosen"), [(0.0, [1]), (9.0, [1]), (13.0, [1, 1])])
def test_as_few_as_are_enough_are_chosen_and_one_at_least(needed, chosen):
    """What every plan has, here a Gram matrix of 5, is no answer to what is asked."""
    found = choose(
        GRAMS,
        np.ones(3),
        np.full((1, 1), 5.0),
        10.0,
        lambda gram: gram[..., 0, 0],
        lambda gram: gram[0, 0] >= needed,
        np.random.default_rng(0),
        per_second=False,
    )
    assert found == chosen


@pytest.mark.parametrize(("per_second", "chosen"), [(True, 5 * [0]), (False, [1])])
def test_where_time_counts_short_settings_go_before_one_that_tells_more(per_second, chosen):
    found = choose(
        GRAMS,
        np.array([1.0, 5.0, 3.0]),
        np.zeros((1, 1)),
        5.0,
        lambda gram: gram[..., 0, 0],
        lambda gram: False,
        np.random.default_rng(0),
        per_second=per_second,
    )
    assert found == chosen


def test_a_first_choice_leaves_its_place_where_others_make_it_needless():
    """The second and the third tell all that can be told; the first tells most alone."""
    found = choose(
        np.array([np.diag([1.6, 1.6]), np.diag([3.0, 0.0]), np.diag([0.0, 3.0])]),
        np.array([1.5, 1.0, 1.0]),
        np.zeros((2, 2)),
        2.5,
        lambda gram: np.minimum(np.diagonal(gram, axis1=-2, axis2=-1), 3.0).sum(axis=-1),
        lambda gram: False,
        np.random.default_rng(0),
        per_second=False,
    )
    assert sorted(found) == [1, 2]


def test_a_commissioning_asks_for_the_nearest_rivals_of_each_effect_alone():
    rivals = [Goal("a", name) for name in "bcde"]
    kept = nearest([Goal("a", ""), *rivals], np.array([9.0, 4.0, 1.0, 3.0, 2.0]))
    assert set(kept) == {Goal("a", ""), Goal("a", "c"), Goal("a", "e")}
    assert len(kept) == 1 + NEAREST
