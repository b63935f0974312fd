import numpy as np
import pytest

from wrist_stiffness.diagnosis.structure import lack_of_fit


def test_structure_above_a_known_floor_is_counted_as_excess():
    found = lack_of_fit(energy=900.0, freedom=500, noise_dof=np.inf)
    assert found.energy == pytest.approx(400.0)


def test_an_uncertain_floor_asks_for_more():
    assert lack_of_fit(900.0, 500, 15.0).energy == 0


def test_noise_leaves_no_excess(rng):
    energies = rng.chisquare(300, 200)
    assert sum(lack_of_fit(energy, 300, np.inf).energy > 0 for energy in energies) <= 2
