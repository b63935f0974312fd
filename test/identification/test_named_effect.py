"""An effect that somebody named is found at its size, wherever its law begins."""

from dataclasses import replace

import numpy as np
import pytest
from measured_wrist import measured_in, random_poses

from wrist_stiffness.identification.free_effects import free_all
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model.columns import tangents
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.report.fit_lines import tolerances
from wrist_stiffness.sessions.unit_session import as_units


def base_of(model, hidden):
    """Fit registrations alone to poses measured on a wrist that has one effect more."""
    rng = np.random.default_rng(5)
    session = measured_in(model.with_effects(hidden), random_poses(rng, 60, 0.5), rng)
    frame = free_all(Effect(find_law("measurement_frame"), "pose_sensor"), per_session=True)
    return WristProblem(model, (as_units(model, session),), ((frame,), ()))


def found_beside(problem, effect):
    """Return the parameters of a named effect beside that base, by key."""
    grown = problem.extended(problem.begin(), effect)
    return {p.key: p for p in grown.settled().parameters if p.effect == effect.name}


WARM = Effect(find_law("thermal_expansion"), "link_1")


def agrees(found, size):
    """Whether a size is found, and its uncertainty is true and small."""
    return abs(found.value - size) < 3.0 * found.sigma and found.sigma < 0.1 * abs(size)


@pytest.mark.parametrize(
    ("law", "place", "key", "size"),
    [
        ("link_stiffness", "link_1", "flexibility_percent", 100.0),
        ("link_stiffness", "link_1", "flexibility_percent", -50.0),
        ("backlash", "motor_2", "width_mdeg", 60.0),
    ],
)
def test_a_law_ends_at_its_true_value(model, law, place, key, size):
    hidden = Effect(find_law(law), place).with_values({key: size})
    found = found_beside(base_of(model, hidden), Effect(find_law(law), place))
    assert agrees(found[key], size)


class Worn(type(find_law("backlash"))):
    """Play that is never nothing."""

    id = "worn"

    def parameters(self, place):
        return (replace(super().parameters(place)[0], lower=30.0, mean=40.0),)

    def linearised(self, place, signals):
        return tangents(self.parameters(place))


def test_a_law_whose_bounds_leave_out_zero_is_found_within_them(model):
    hidden = Effect(find_law("backlash"), "motor_2").with_values({"width_mdeg": 60.0})
    worn = Effect(Worn(), "motor_2", {"width_mdeg": Estimate(40.0)})
    found = found_beside(base_of(model, hidden), worn)
    assert agrees(found["width_mdeg"], 60.0)


def test_a_shape_is_found_from_its_grid(model):
    hidden = Effect(find_law("transmission_error"), "motor_1").with_values(
        {"order": 13.8, "cos_mdeg": 25.0}
    )
    found = found_beside(base_of(model, hidden), Effect(hidden.law, "motor_1"))
    assert agrees(found["order"], 13.8)
    assert agrees(found["cos_mdeg"], 25.0)
    for law in hidden.law.parameters("motor_1"):
        own = found[law.key]
        assert own.prior == pytest.approx(law.mean)
        assert own.moved == pytest.approx((own.value - law.mean) / law.scale)


def test_a_prior_is_that_of_the_law_wherever_its_fit_began(model):
    """Where nothing warms a size stays at its mean, that of steel, and its text says from there."""
    found = found_beside(base_of(model, WARM), WARM)
    size = found["expansion_ppm_per_K"]
    assert size.prior == 11.5
    assert size.value == pytest.approx(11.5, abs=0.1)
    assert tolerances(size) == "0.0 x the typical magnitude from 11.5"


@pytest.mark.parametrize("typed", [1.0, -10.0])
def test_a_formula_is_found_from_what_was_typed(model, typed):
    """It has no prior that would say how large it is, nor of which sign."""

    def sag(size):
        law = FormulaLaw(
            "sag", "platform", np.eye(6)[2], "sag_um * sin(2 * theta_1)", [], ["sag_um"]
        )
        return Effect(law, "platform", {"sag_um": Estimate(size)})

    found = found_beside(base_of(model, sag(3.2)), sag(typed))
    assert agrees(found["sag_um"], 3.2)
