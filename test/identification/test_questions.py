"""What never changed in a recording is not asked of its error."""

import numpy as np

from wrist_stiffness.identification.questions import questions
from wrist_stiffness.inference.observations import Observations


def test_poses_measured_one_by_one_say_nothing_of_the_time_at_rest(dwells):
    def asked(table: Observations) -> set[str]:
        return {
            each.name
            for each in questions(table.covariates)
            if each.features(table.covariates) is not None
        }

    table = dwells(np.random.default_rng(1), n=60)
    assert "the time at rest" in asked(table)
    table.covariates["held_s"][:] = 0.0
    assert "the time at rest" not in asked(table)
    assert "the load" in asked(table)
