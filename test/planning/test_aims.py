"""What makes one experiment worth more than another."""

import numpy as np
import pytest

from wrist_stiffness.planning.aims import Aims, Truths
from wrist_stiffness.planning.information import Goal, Information, Layout

SEEN = Goal("a", "")
NOTHING = np.zeros((2, 2))
BEFORE, MORE = np.diag([50.0, 30.0]), np.diag([2.0, 4.0])


def own(start):
    """Aims of one question, whether an effect is there, beside one nuisance."""
    at = {"a": np.array([0])}
    layout = Layout(np.ones(1), {"n": np.array([0])}, at, at)
    pool = Information(100.0 * np.eye(2)[None], layout)
    return Aims(Truths(np.eye(2), layout), pool, start, (SEEN,), everything=False)


def test_only_what_comes_on_top_of_earlier_measurements_is_of_worth():
    """A question that they would settle as it is reckoned was asked because they do not."""
    with_earlier, without = own(BEFORE), own(NOTHING)
    assert with_earlier.worth(BEFORE) == 0.0
    assert with_earlier.worth(BEFORE + MORE) == pytest.approx(without.worth(MORE), rel=1e-12)
    assert not with_earlier.settled(BEFORE)
    assert without.settled(BEFORE)
