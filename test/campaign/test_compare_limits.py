"""What a comparison does not say, and what does not lead it astray, on a table made by hand."""

import numpy as np
import pytest

from wrist_stiffness.campaign.comparing.conditions import conditions
from wrist_stiffness.campaign.comparing.headroom import held_out_process
from wrist_stiffness.campaign.comparing.sentences import tell
from wrist_stiffness.campaign.noise_floor import noise_floor
from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.inference import Observations

N = 400
SIGMA = np.repeat([1e-6, 1e-4], 3)


@pytest.fixture
def rng():
    return np.random.default_rng(17)


def table(rng, law=None):
    """Random dwells three seconds apart, warming: 1 um and 0.1 mrad of noise in each component."""
    # As often a tenth of a newton as ten times that.
    force = rng.normal(size=(N, 3)) * 10.0 ** rng.uniform(-1.0, 0.5, (N, 1))
    warm = 20.0 + 5.0 * (1.0 - np.exp(-np.arange(N) / 150.0))
    told = {
        **{f"theta_{motor}": rng.uniform(-0.8, 0.8, N) for motor in (1, 2)},
        **{f"approach_{motor}": rng.choice([-1.0, 1.0], N) for motor in (1, 2)},
        **{f"speed_{motor}": np.zeros(N) for motor in (1, 2)},
        **dict(zip(("fx", "fy", "fz"), force.T, strict=True)),
        **dict.fromkeys(("mx", "my", "mz", "moment"), np.zeros(N)),
        "force": np.linalg.norm(force, axis=1),
        "held_s": rng.uniform(0.5, 20.0, N),
        "loaded_at_rest": np.zeros(N),
        "time_s": 3.0 * np.arange(N),
        "T_link_1": warm,
    }
    values = SIGMA * rng.normal(size=(N, 6))
    if law is not None:
        values[:, 2] += law(told)
    return Observations(
        values, told, np.diag(SIGMA**2), told["time_s"], np.zeros(N, dtype=int),
        quantities=QUANTITIES,
    )  # fmt: skip


@pytest.mark.parametrize(("um_per_N", "told"), [(1.0, True), (4.0, False)])
def test_slow_changes_are_told_while_they_are_a_tenth_of_what_is_off(rng, um_per_N, told):
    """The same micrometre a kelvin beside little and beside much, where it may be wander."""

    def law(c):
        return 1e-6 * (c["T_link_1"] - 20.0) + 1e-6 * um_per_N * c["fz"]

    observations = table(rng, law)
    found = tell(observations, noise_floor(observations), rng).statements
    assert found[0].condition.name == "force along z"
    assert (len(found) > 1) == told


def test_what_a_temperature_does_everywhere_is_not_what_it_does_with_an_angle(rng):
    """Cosines of small angles are nearly one: uncentred, this would be the temperature again."""
    observations = table(rng)
    named = {each.name: each.columns for each in conditions(observations)[0]}
    warm = named["temperature of link 1"][:, 0]
    for motor in (1, 2):
        columns = named[f"temperature of link 1 with the angle of motor {motor}"]
        together = [np.corrcoef(warm, column)[0, 1] for column in columns.T]
        assert np.abs(together).max() < 0.2


def left_of(observations, units=slice(None)):
    """What a process leaves of the shift along z of some units, RMS over the noise."""
    left = held_out_process(observations, np.random.default_rng(0))[:, 2] / SIGMA[2]
    return np.sqrt(np.mean(left[units] ** 2))


def test_a_process_knows_what_follows_the_direction_of_a_load(rng):
    """Play goes to the side of a load, large or small."""
    observations = table(rng, lambda c: 5e-6 * c["fz"] / c["force"])
    assert left_of(observations) < 1.3


def test_a_lost_beam_does_not_keep_a_process_from_learning(rng):
    observations = table(rng, lambda c: 5e-6 * c["fz"] / c["force"])
    values = observations.values.copy()
    values[50, 2] = 0.01
    good = np.arange(N) != 50
    assert left_of(observations.with_values(values), good) < 1.3
