"""What is chosen for a plan, whatever its visits are."""

import numpy as np
import pytest

from wrist_stiffness.campaign.planning.choice import choose

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
