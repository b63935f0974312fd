"""An instrument whose digits are coarser than its noise scatters by what these hide."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.inference.shared import own_covariance
from wrist_stiffness.sessions.observing import tabulate
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.unit_session import all_units, as_units

THURSDAY = Path(__file__).parent.parent / "data" / "tutorial" / "thursday.mcap"

DIGIT = 3e-5
"""Of the instrument [m]; far more than the noise, 0.7 um, which else would even it out a little."""


@pytest.fixture(scope="module")
def session(model):
    return read_session(THURSDAY, model.table)


def test_what_digits_hide_is_the_scatter_of_a_mean(model, session):
    """No mean over a dwell makes it smaller: a platform at rest shows the same digit again."""
    fine = as_units(model, session)
    coarse = as_units(model, replace(session, shift=np.round(session.shift / DIGIT) * DIGIT))
    assert coarse.white[:3].tolist() == [0.0, 0.0, 0.0]
    assert coarse.wander[:3] == pytest.approx(DIGIT / np.sqrt(12.0), rel=1e-6)
    hidden = (coarse.values - fine.values)[:, :3][coarse.cut.dwell]
    assert np.sqrt(np.mean(hidden**2)) == pytest.approx(DIGIT / np.sqrt(12.0), rel=0.2)


def test_coordinates_share_their_digits(model, session):
    """Of 50 um so few are crossed at rest that one coordinate never changes."""
    coarse = as_units(model, replace(session, shift=np.round(session.shift / 5e-5) * 5e-5))
    assert coarse.wander[:3] == pytest.approx(5e-5 / np.sqrt(12.0), rel=1e-6)


def test_a_digit_up_or_down_is_no_lost_beam(model, session):
    coarse = as_units(model, replace(session, shift=np.round(session.shift / DIGIT) * DIGIT))
    assert coarse.lost == as_units(model, session).lost


def test_units_of_an_instrument_without_scatter_can_be_weighed(model, session):
    """A fit divides by the scatter: each unit needs one, in every direction."""
    still = as_units(model, session).cut
    shift = session.shift.copy()
    for unit in np.flatnonzero(still.dwell):
        shift[still.label == unit] = shift[still.label == unit][0]
    observed = tabulate(model, all_units(model, [replace(session, shift=shift)]))
    np.linalg.cholesky(observed.observations.covariance)


def test_no_measurement_is_better_than_the_table_it_is_compared_with(model, session):
    """Poses that differ in the rounding of numbers alone have no noise of that size."""
    still, jitter = as_units(model, session).cut, np.random.default_rng(0)
    shift = session.shift.copy()
    for unit in np.flatnonzero(still.dwell):
        shift[still.label == unit] = shift[still.label == unit][0]
    shift += 1e-17 * jitter.standard_normal(shift.shape)
    units = as_units(model, replace(session, shift=shift))
    assert units.white[:3].tolist() == [0.0, 0.0, 0.0]
    observations = tabulate(model, (units,)).observations
    own = np.diagonal(own_covariance(observations, observations.covariance), axis1=1, axis2=2)
    # 0.3 % of a deflection of a few micrometres.
    assert 1e-9 < np.sqrt(own[:, :3]).min() < 1e-7


@pytest.fixture(scope="module")
def repeated(session):
    """A platform that carries loads at one pose; the instrument always shows the same turn."""
    still, noise = session.take(slice(0, 6000, 10)), np.random.default_rng(0)
    theta = np.broadcast_to(still.block.theta[0], still.block.theta.shape)
    return replace(
        still,
        block=replace(still.block, theta=theta, theta_dot=np.zeros(theta.shape)),
        shift=still.shift[0] + noise.normal(0.0, 0.7e-6, still.shift.shape),
        rotation=np.broadcast_to(still.rotation[0], still.rotation.shape),
        covariance=None,
    )


def test_poses_that_repeat_exactly_can_be_judged(model, repeated):
    still = np.broadcast_to(repeated.shift[0], repeated.shift.shape)
    repeated = replace(repeated, shift=still)
    (found,) = compare_models([("drawn", model)], [repeated]).models
    hidden = as_units(model, repeated).digits ** 2
    assert (found.explained.table.variance >= 0.999 * hidden).all()
    assert all(np.isfinite(each) and each > 0.0 for each in found.explained.error.values())


@pytest.mark.slow
def test_poses_that_repeat_exactly_can_be_fitted_to(model, repeated):
    found = calibrate(model, [repeated])
    assert all(np.isfinite(each.sigma) and each.sigma > 0.0 for each in found.parameters)
