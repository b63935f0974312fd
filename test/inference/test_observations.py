import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference import Candidate, Observations, Parameter, Quantity


def test_take_keeps_every_column_with_its_unit(rng):
    n = 6
    covariance = np.stack([np.eye(2) * (k + 1) for k in range(n)])
    table = Observations(
        np.arange(12.0).reshape(n, 2),
        {"x": np.arange(6.0)},
        covariance,
        np.arange(6.0) * 10,
        np.repeat([0, 1], 3),
        np.array([0, 1, 0, 1, 2, 2]),
        np.full(n, 7.0),
    )
    some = table.take(np.array([4, 1]))
    assert some.values.tolist() == [[8, 9], [2, 3]]
    assert some.covariate("x").tolist() == [4, 1]
    assert some.covariance[0, 0, 0] == 5
    assert some.session.tolist() == [1, 0]
    assert some.replicate.tolist() == [2, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": np.zeros(4)}, "values must be"),
        ({"values": np.full((4, 1), np.inf)}, "infinite"),
        ({"covariates": {"x": np.zeros(3)}}, "covariate 'x' has shape"),
        ({"covariates": {"x": np.array([0, 1, np.nan, 2])}}, "not a number in row 2"),
        ({"covariance": np.eye(2)}, "covariance has shape"),
        ({"values": [[0.0], [1.0]]}, "values must be a NumPy array of numbers"),
        ({"covariates": {"x": [0, 1, 2, 3]}}, "covariate 'x' must be a NumPy array of numbers"),
        ({"session": np.array(list("aabb"))}, "session must be a NumPy array of numbers"),
        (
            {"quantities": (Quantity("tip", "um", (0, 5)),)},
            "quantity 'tip' names component 5, there are 0 to 0",
        ),
        ({"covariance": np.full((1, 1), np.nan)}, "covariance is not a number"),
        (
            {"covariance": np.array([1.0, 1, np.inf, 1])[:, None, None]},
            "covariance is not a number in row 2",
        ),
        (
            {"values": np.zeros((4, 2)), "covariance": np.array([[1.0, 0.5], [0.0, 1.0]])},
            "covariance is not symmetric",
        ),
        ({"time_s": np.array([0.0, 2, 1, 3])}, "runs backwards"),
    ],
)
def test_columns_that_do_not_belong_together_are_refused(change, message):
    columns = {"values": np.zeros((4, 1)), "covariates": {}} | change
    with pytest.raises(InputError, match=message):
        Observations(**columns)


def test_time_may_start_again_in_the_next_session():
    table = Observations(
        np.zeros((4, 1)), {}, time_s=np.array([0.0, 5, 0, 5]), session=np.array([0, 0, 1, 1])
    )
    assert table.n_units == 4


def test_unknown_covariate_is_named_with_the_known_ones(table):
    with pytest.raises(InputError, match=r"no covariate 'force' in the table, only x, z"):
        table.covariate("force")


def test_units_know_their_row_through_several_choices(table):
    some = table.take(np.arange(10, 40)).take(np.array([5, 2]))
    assert some.rows.tolist() == [15, 12]
    assert some.with_values(some.values).rows.tolist() == [15, 12]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"plausible": 0.0}, "size_um: plausible is 0, must be finite and above 0"),
        ({"scale": np.nan}, "size_um: scale is nan, must be finite and above 0"),
        ({"lower": 2.0, "upper": 1.0}, "size_um: lower is 2, upper is 1: lower must be smaller"),
    ],
)
def test_a_parameter_that_no_prior_can_hold_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        Parameter("size_um", **change)


def test_a_law_without_a_parameter_is_refused():
    with pytest.raises(InputError, match="bend@arm has no parameter, it needs one for each column"):
        Candidate("bend", "arm", (), lambda units, shape: np.zeros((units.n_units, 1, 0)))
