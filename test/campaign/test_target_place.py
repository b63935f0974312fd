"""Where a target sits is told by sound positions alone."""

import numpy as np
import pytest

from wrist_stiffness.campaign.reading.registration import place_left
from wrist_stiffness.campaign.rigid_rotation import rigid_rotation


def test_wild_positions_have_no_say_in_where_the_target_is(table):
    """One in ten is off by centimetres, all to one side, as a prism that was mixed up is."""
    rng = np.random.default_rng(3)
    rigid = rigid_rotation(table, np.radians(rng.uniform(-20.0, 20.0, (600, 2))))
    target, stand = 1e-3 * np.array([6.0, -4.8, 6.4]), np.array([0.1, -0.2, 0.3])
    noise = 1e-6 * rng.standard_normal((600, 3))
    shift = rigid @ target + stand + noise
    wild = np.arange(0, 600, 10)
    shift[wild] += rigid[wild] @ [0.03, 0.0, 0.02]
    shift[5::10] = np.nan
    left, lever = place_left(shift, rigid)
    sound = np.setdiff1d(np.arange(600), [*wild, *range(5, 600, 10)])
    assert lever == pytest.approx(np.linalg.norm(target), rel=1e-3)
    np.testing.assert_allclose(left[sound], noise[sound], atol=1e-6)
    assert np.isnan(left[5::10]).all()
