"""What the programs of the virtual cell do."""

import numpy as np
import pytest

from wrist_stiffness.simulation.experiment import heavy


def test_heavy_rests_under_three_newtons_at_o(wrist):
    program = heavy(wrist().workspace, np.random.default_rng(1), 60.0)
    time_s = np.arange(4.0, program.duration_s - 4.0, 0.05)
    at_rest = np.all(program.speed(time_s) == 0.0, axis=1)
    force, moment = np.split(program.load(time_s), 2, axis=1)
    assert at_rest.sum() > 100
    assert np.linalg.norm(force[at_rest], axis=1) == pytest.approx(3.0)
    assert not moment.any()
    assert len(np.unique(force[at_rest].round(9), axis=0)) > 5
