"""The evidence of a linear model with Gaussian priors is a multivariate normal density."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate
from scipy.stats import halfnorm, multivariate_normal, multivariate_t, norm
from scipy.stats import t as student_t

from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.evidence import (
    MISFIT,
    MOST_MISFIT,
    Evidence,
    log_excess,
    log_size_prior,
    modes,
)
from wrist_stiffness.inference.point import Background, Group, Point
from wrist_stiffness.inference.possible import TAIL, Possible

ROWS = 14

ABOVE = Possible(np.zeros(2), np.full(2, np.inf))
WIDE = Possible(
    np.array([0.0, -np.inf]), np.full(2, np.inf), lambda z: np.abs(z[:, 0]) > np.abs(z[:, 1])
)
"""Two quarters of the plane."""


def linear(rng, effects=None, columns=2, z=None):
    """A point of a linear model with two groups beside it, at any unknowns."""
    left, j = rng.normal(size=ROWS), rng.normal(size=(ROWS, columns))
    at = np.zeros(columns) if z is None else np.array(z)
    point = Point(
        left + j @ at,
        j,
        at,
        rng.uniform(0.5, 2.0, columns),
        effects or {},
        0.3 * rng.normal(size=(ROWS, 1)),
        linear=True,
    )
    groups = (
        Group("drift", "s", rng.normal(size=(ROWS, 3)), 0.5),
        Group("the load", "s", rng.normal(size=(ROWS, 2))),
    )
    return point, Background(groups, 0.2)


def density(point, ground, amplitude, excess):
    """Logarithm of the density of the data themselves, by the definition."""
    covariance = excess * np.eye(ROWS) + point.inexact @ point.inexact.T
    covariance += point.columns @ np.diag(point.weight**-2.0) @ point.columns.T
    for size, group in zip(amplitude, ground.groups, strict=True):
        covariance += size**2 * group.columns @ group.columns.T
    data = point.left - point.columns @ point.z
    return multivariate_normal(np.zeros(ROWS), covariance).logpdf(data)


@settings(max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.floats(0.1, 5.0), min_size=4, max_size=4),
    st.floats(0.6, 4.0),
)
def test_differences_of_evidence_are_those_of_the_multivariate_normal(seed, sizes, excess):
    point, ground = linear(np.random.default_rng(seed), z=[0.7, -1.1])
    found, exact = [], []
    for amplitude in (np.array(sizes[:2]), np.array(sizes[2:])):
        own = Evidence(point, ground, amplitude, excess)
        priors = own.log - density(point, ground, amplitude, excess)
        found.append(priors)
        # The hyperpriors alone: what the same amplitudes get where there are no data to speak of.
        mute = replace(point, left=0.0 * point.left, z=0.0 * point.z)
        exact.append(
            Evidence(mute, ground, amplitude, excess).log - density(mute, ground, amplitude, excess)
        )
    assert found == pytest.approx(exact, abs=1e-6)
    # And those hyperpriors differ as the amplitudes say, nothing else.
    drift, load = np.array(sizes[:2]), np.array(sizes[2:])
    by_hand = [
        -0.5 * np.log(a[0] / 0.5) ** 2 + np.log(a[1] / (1.0 + a[1] ** 2)) for a in (drift, load)
    ]
    assert exact[1] - exact[0] == pytest.approx(by_hand[1] - by_hand[0], abs=1e-6)


def test_where_the_fit_ended_does_not_matter_to_a_linear_model(rng):
    near, ground = linear(rng)
    far = near.moved(np.array([3.0, -2.0]))
    logs = [evidence(point, ground).log for point in (near, far)]
    assert logs[0] == pytest.approx(logs[1], abs=1e-8)


def test_the_prior_of_a_size_is_a_multivariate_t():
    at = np.array([0.3, -1.2, 4.0])
    expected = multivariate_t(np.zeros(3), np.eye(3), TAIL).logpdf(at)
    assert log_size_prior(float(at @ at), 3) == pytest.approx(expected)


def test_where_an_effect_acts_is_priced_as_a_tolerance_however_large_it_is(rng):
    """A wrist that is 35 degrees askew is no wonder of size, whatever payload it carries."""
    point, ground = linear(rng, {"a": np.arange(2)}, z=[4.0, 35.0])
    place = replace(point, sizing={"a": np.arange(1)})
    tolerance = replace(point, effects={"a": np.arange(1)})
    one, other = (Evidence(p, ground, np.array([0.5, 1.0]), 1.0) for p in (place, tolerance))
    assert one.log == pytest.approx(other.log)
    assert one.cost(place) == pytest.approx(other.cost(tolerance))


def test_no_product_of_other_columns_is_kept(rng):
    point, ground = linear(rng)
    at = Evidence(point, ground, np.array([0.5, 1.0]), 1.0)
    assert at.log == Evidence(point.moved(np.zeros(2)), ground, at.amplitude, 1.0).log
    for change in ({"columns": 2.0 * point.columns}, {"inexact": 2.0 * point.inexact}):
        other = {n: getattr(point, n) for n in ("left", "columns", "z", "weight", "effects")}
        fresh = Point(**{**other, "inexact": point.inexact, "linear": True, **change})
        assert replace(at, point=replace(point, **change)).log == replace(at, point=fresh).log
    groups = tuple(replace(each, columns=2.0 * each.columns) for each in ground.groups)
    part, fresh = replace(ground, groups=groups), Background(groups, 0.2)
    assert ground.part([0]).gram.any()
    assert np.array_equal(part.part([0]).gram, fresh.part([0]).gram)


@pytest.mark.parametrize("size", [0.0, 3.0, 30.0])
def test_the_evidence_of_an_effect_is_near_the_integral_over_its_size(rng, size):
    column = rng.normal(size=(ROWS, 1))
    left = size * column[:, 0] + rng.normal(size=ROWS)
    mute = Background((Group("none", "s", np.zeros((ROWS, 1)), 1.0),), 0.2)
    empty = np.zeros((ROWS, 0))
    with_it = Point(left, -column, np.zeros(1), np.ones(1), {"a": np.arange(1)}, empty, linear=True)
    with_it = with_it.moved(np.array([float(left @ column[:, 0] / (column[:, 0] @ column[:, 0]))]))
    without = Point(left, empty, np.zeros(0), np.zeros(0), {}, empty)

    def integrand(z):
        change = np.sum((left - column[:, 0] * z) ** 2) - np.sum(left**2)
        return np.exp(-0.5 * change - best) * np.exp(log_size_prior(z * z, 1))

    z = float(left @ column[:, 0] / (column[:, 0] @ column[:, 0]))
    best = 0.5 * float(column[:, 0] @ column[:, 0]) * z * z
    exact = np.log(integrate.quad(integrand, z - 5.0, z + 5.0, points=[z], limit=200)[0]) + best
    one = np.array([1.0])
    gain = Evidence(with_it, mute, one, 1.0).log - Evidence(without, mute, one, 1.0).log
    assert gain == pytest.approx(exact, abs=0.1)
    first_order = Evidence(without, mute, one, 1.0).gains([-column])[0][0]
    assert first_order == pytest.approx(exact, abs=0.1)


@pytest.mark.parametrize("size", [1.0, 1e4, 1e8])
def test_unknowns_that_do_the_same_gain_what_one_does(rng, size):
    column = size * rng.normal(size=ROWS)
    columns = column[:, None] * [1.0, 0.5]
    left = 3.0 * column + rng.normal(size=ROWS)
    (gain,), (z,), _ = modes((columns.T @ columns)[None], (columns.T @ left)[None])
    assert z @ [1.0, 0.5] == pytest.approx(left @ column / (column @ column), rel=0.05)
    assert gain == pytest.approx(0.5 * (left @ column) ** 2 / (column @ column), rel=0.3)


def test_what_cannot_be_explains_nothing(rng):
    """Of two unknowns one would have to be negative: the other gains what it gains alone."""
    columns, empty = rng.normal(size=(ROWS, 2)), np.zeros((ROWS, 0))
    left = columns @ np.array([5.0, -5.0]) + rng.normal(size=ROWS)
    point = Point(left, empty, np.zeros(0), np.zeros(0), {}, empty)
    at = Evidence(point, Background((), 0.2), np.zeros(0), 1.0)
    most = np.full(2, np.inf)
    (free, _), (held, z) = at.gains(
        [-columns, -columns], [Possible(-most, most), Possible(np.array([-np.inf, 0.0]), most)]
    )
    ((alone, first),) = at.gains([-columns[:, :1]])
    assert free > held + 10.0
    assert held == pytest.approx(alone)
    assert z.tolist() == pytest.approx([*first, 0.0])


@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("possible", [ABOVE, WIDE], ids=["each above 0", "first beyond second"])
def test_the_evidence_is_the_integral_over_what_is_possible(rng, size, possible):
    """Over a prior that is nothing elsewhere, and as much larger there."""
    columns, empty = rng.normal(size=(ROWS, 2)), np.zeros((ROWS, 0))
    left = columns @ np.array([size, 0.3 * size]) + rng.normal(size=ROWS)
    at = Point(left, -columns, np.zeros(2), np.ones(2), {"a": np.arange(2)}, empty, linear=True)
    at = at.moved(np.linalg.lstsq(columns, left)[0])
    ground, one = Background((), 0.2), np.zeros(0)
    without = Evidence(Point(left, empty, np.zeros(0), np.zeros(0), {}, empty), ground, one, 1.0)
    grid = np.linspace(-12.0, 12.0, 301)
    z = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    within = ((z >= possible.lower) & (z <= possible.upper)).all(axis=1)
    if possible.together is not None:
        within &= possible.together(z)
    prior = multivariate_t(np.zeros(2), np.eye(2), TAIL).pdf(z) * within
    # A quarter of the plane each.
    prior *= 4.0 * (grid[1] - grid[0]) ** 2
    change = np.sum((left - z @ columns.T) ** 2, axis=1) - np.sum(left**2)
    exact = np.log(np.sum(np.exp(-0.5 * change) * prior))
    bounded = Evidence(replace(at, possible={"a": possible}), ground, one, 1.0)
    assert bounded.log - without.log == pytest.approx(exact, abs=0.25)
    assert without.gains([-columns], [possible])[0][0] == pytest.approx(exact, abs=0.25)


@pytest.mark.parametrize("least", [3.0, 10.0, 1e3, 1e12])
def test_bounds_far_from_what_is_usual_are_no_evidence_without_end(least):
    """A user's law that is nowhere usual gains by the tail of its prior, and no more than that."""
    gain = Possible(np.array([least]), np.array([np.inf])).gain(
        np.array([least + 50.0]), np.array([[1.0]])
    )
    assert 0.0 < gain < 10.0
    if least <= 10.0:
        assert gain == pytest.approx(-np.log(student_t(TAIL).sf(least)), abs=1e-6)


def test_what_a_law_may_be_wrong_by_is_no_sign_of_an_imitation(rng):
    point, ground = linear(rng, {"a": np.arange(1)}, columns=1, z=[9.0])
    varied = 9.0 * point.columns * rng.normal(size=(ROWS, 2))
    point = replace(point, left=point.left + 3.0 * varied[:, 0], varied={"a": varied})
    exact, nearly, hardly = (
        Evidence(replace(point, inexact=share * varied), ground, np.full(2, 0.5), 0.1).rest("a")
        for share in (0.0, 1.0, 100.0)
    )
    assert exact > 2.0 * nearly > 0.0
    assert hardly < 1e-2 * exact


def test_an_effect_that_the_set_up_nearly_takes_up_counts_by_what_is_seen_of_it(rng):
    """What it leaves in its shape is compared with what it does beyond the set-up."""
    base, own, shape = rng.normal(size=(3, ROWS))
    columns = np.stack([9.0 * (base + 0.01 * own), base], axis=1)
    for count in (1, 2):
        point = Point(
            0.1 * shape,
            columns[:, :count],
            np.array([1.0, -9.0])[:count],
            np.full(count, 1e-3),
            {"a": np.arange(1)},
            np.zeros((ROWS, 0)),
            {"a": shape[:, None]},
        )
        at = Evidence(point, Background((), 0.2), np.zeros(0), 1e-9)
        left = point.left + point.columns @ at.step
        if count == 2:
            beyond = np.eye(ROWS) - np.outer(base, base) / (base @ base)
            left, shape, columns = beyond @ left, beyond @ shape, beyond @ columns
        expected = (left @ shape) ** 2 / (shape @ shape) / (columns[:, 0] @ columns[:, 0])
        assert at.rest("a") == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("width", [0.2, 3.0])
def test_noise_far_below_the_known_one_has_a_prior(width):
    x = np.array([-20.0, -2.0, -0.5, 0.1, 1.0, 3.0])
    found = log_excess(np.exp(x), width)
    known = (1.0 - MISFIT) * norm(0.0, width).pdf(x)
    expected = known + MISFIT * halfnorm(0.0, MOST_MISFIT).pdf(x)
    assert found[1:] == pytest.approx(np.log(expected[1:]))
    assert found[0] == pytest.approx(np.log(1.0 - MISFIT) + norm(0.0, width).logpdf(x[0]))


def test_what_is_attainable_is_the_evidence_of_noise_alone(rng):
    point, ground = linear(rng, columns=2)
    drift = ground.part(ground.always)
    everything = np.hstack([point.columns, point.inexact, drift.columns])
    noise = rng.normal(size=ROWS)
    noise -= everything @ np.linalg.lstsq(everything, noise, rcond=None)[0]
    alone = replace(point, left=noise * np.sqrt(ROWS) / np.linalg.norm(noise))
    best = Evidence(alone, drift, np.array([0.5]), 1.0)
    assert best.attainable == pytest.approx(best.log, abs=1e-9)
    at = Evidence(replace(point, left=20.0 * point.left), ground, np.full(2, 3.0), 2.0)
    assert at.attainable == pytest.approx(best.log, abs=1e-9)


def test_what_only_a_prior_tells_is_as_uncertain_as_that_far_above_the_noise(rng):
    """Two columns do the same, a billion times the noise: only their sum is measured."""
    point, ground = linear(rng)
    weight = 1e-3
    alike = np.repeat(1e9 * point.columns[:, :1], 2, axis=1)
    point = replace(point, columns=alike, weight=np.full(2, weight))
    found = Evidence(point, ground, np.array([0.5, 0.5]), 1.0).covariance_of_fit
    expected = np.array([[0.5, -0.5], [-0.5, 0.5]]) / weight**2
    assert found == pytest.approx(expected, rel=1e-3)
