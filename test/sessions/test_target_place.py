"""Where a target and the instrument stand is told by sound measurements alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.sessions.in_pieces import rigid_rotation
from wrist_stiffness.sessions.reading.registration import place_left, turn_left


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


@pytest.mark.parametrize(("moving", "jitter_mdeg"), [(1.0, 1.0), (0.1, 100.0)])
def test_wild_rotations_have_no_say_in_how_the_instrument_stands(table, moving, jitter_mdeg):
    """One in ten is off by 90 deg, as of a target whose markers were mixed up.

    Of a wrist that hardly moves it is motion all the same that tells the instrument, jitter or not.
    """
    rng = np.random.default_rng(3)
    theta = np.radians(rng.uniform(-20.0, 20.0, (600, 2)))
    rest = rng.uniform(size=600) > moving
    theta[rest] = 0.1
    askew = Rotation.from_euler("xyz", [3.0, -3.0, 9.0], degrees=True)
    target = Rotation.from_euler("xyz", [20.0, 5.0, -30.0], degrees=True)
    noise = np.radians(1e-3 * np.where(rest, 1.0, jitter_mdeg))[:, None] * rng.standard_normal(
        (600, 3)
    )
    rigid = rigid_rotation(table, theta)
    rotation = askew * Rotation.from_rotvec(noise) * Rotation.from_matrix(rigid) * target
    wild = np.arange(0, 600, 10)
    rotation[wild] = Rotation.from_euler("y", 90.0, degrees=True) * rotation[wild]
    left = turn_left(rotation.as_matrix(), rigid)
    sound = np.setdiff1d(np.arange(600), wild)
    np.testing.assert_allclose(left[sound], noise[sound], atol=np.radians(1e-3 * jitter_mdeg))
