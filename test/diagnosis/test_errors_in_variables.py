import numpy as np
import pytest

from wrist_stiffness.diagnosis import (
    Candidate,
    Nuisance,
    Observations,
    Parameter,
    Settings,
    diagnose,
)
from wrist_stiffness.errors import InputError

LOAD_STD, STIFFNESS = 4.0, 0.5


def springs(rng, told):
    n = 400
    load = rng.normal(0, 10, n)
    seen = load + rng.normal(0, LOAD_STD, n)
    values = STIFFNESS * load[:, None] + rng.normal(0, 1.0, (n, 1))
    uncertain = {"load": LOAD_STD} if told else {}
    return Observations(values, {"load": seen}, covariate_std=uncertain)


def spring():
    return Candidate(
        "compliance",
        "spring",
        (Parameter("m_per_N"),),
        lambda t, _: t.covariate("load")[:, None, None],
    )


def zero():
    return Nuisance("zero", lambda t: np.ones((t.n_units, 1, 1)))


@pytest.mark.parametrize("told", [False, True])
def test_a_noisy_load_biases_a_compliance_only_while_its_noise_is_unknown(rng, told):
    settings = Settings(permutations=999)
    results = [
        diagnose(springs(rng, told), (spring(),), (zero(),), rng, settings) for _ in range(6)
    ]
    values = np.array([r.findings[0].parameters["m_per_N"] for r in results])
    value, error = values[:, 0].mean(), values[:, 1].mean()
    attenuated = STIFFNESS * 100 / (100 + LOAD_STD**2)
    if told:
        assert abs(value - STIFFNESS) < error
    else:
        assert value == pytest.approx(attenuated, abs=error)
        assert STIFFNESS - value > 3 * error


def test_an_uncertain_condition_must_exist(rng):
    with pytest.raises(InputError, match="covariate_std of 'force'"):
        Observations(np.zeros((3, 1)), {"load": np.zeros(3)}, covariate_std={"force": 1.0})
