"""Laws that add a share of the said load: one sample is predicted without a session."""

import numpy as np

from wrist_stiffness.model.block import Load
from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.effects.load_sensor import LoadScale
from wrist_stiffness.model.parameters import Estimate


def test_a_scaled_load_is_another_load_by_the_spline_as_well(model, make):
    spline, block = model.with_evaluation("spline"), make.block(1)
    scaled = make.effect("load_scale@load_sensor", scale_percent=(25.0, 1.0))
    found = spline.with_effects(scaled).predict(block.theta[0], Load(block.load[0]))
    expected = spline.predict(block.theta[0], Load(0.8 * block.load[0]))
    np.testing.assert_allclose(found.twist, expected.twist, rtol=1e-9)


class PastDeadBand(LoadScale):
    """A user's sensor, which says nothing of the first newton; the rest of it is as shipped."""

    id = "past_dead_band"

    def advance(self, at, place, values, state):
        return Contribution(wrench=at.load / np.linalg.norm(at.load[:, :3], axis=1)[:, None]), None


def test_of_a_users_law_only_its_own_answer_counts(model, make):
    own = Effect(PastDeadBand(), "load_sensor", {"scale_percent": Estimate(25.0)})
    theta, load = np.radians([10.0, -15.0]), np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    found = model.with_effects(own).predict(theta, Load(load))
    expected = model.predict(theta, Load(1.5 * load))
    np.testing.assert_allclose(found.twist, expected.twist, rtol=1e-9)
