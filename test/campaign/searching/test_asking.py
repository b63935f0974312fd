"""What the statistics are asked at a place of the search."""

from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching.asking import table_of
from wrist_stiffness.campaign.searching.place import Place


@pytest.mark.parametrize("known", [False, True])
def test_statistics_see_tolerances_about_their_means(known):
    """Of an axis that moved after it was built all is still to be found, where it is not known."""
    registration, built, moved, play = np.array([5.0, 2.0, 3.0, 7.0])
    columns = np.arange(1.0, 49.0).reshape(2, 6, 4)
    left = np.full((2, 6), 0.5)
    asked = []

    def table(with_extras):
        asked.append(with_extras)
        within = SimpleNamespace(values=left, with_values=lambda values: values)
        return SimpleNamespace(observations=within)

    base = SimpleNamespace(
        tolerances=np.array([False, True, False, False]),
        on_base=np.array([False, False, True, False]),
        columns=columns,
        z=np.array([registration, built, moved, play]),
        left=table,
    )
    own = built * columns[:, :, 1] + (0.0 if known else moved * columns[:, :, 2])
    np.testing.assert_allclose(table_of(Place(base, (), known=known)), left - own)
    assert asked == [known]
