"""Laws that nobody wrote are found in what a model leaves: form, component, direction and size."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.identification.extension import extend
from wrist_stiffness.identification.proposing import propose
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.cell import CellSettings

SECONDS = 120.0


@pytest.fixture(scope="module")
def day(model, in_the_cell):
    """A sound wrist beside a clamp that opens and closes on its own."""
    settings = CellSettings(
        rate_hz=10.0, program_seconds=SECONDS, program_seed=41, base="wrong", base_seed=3
    )
    session = in_the_cell(model.table, settings, 5)
    turns = np.random.default_rng(2).uniform(0.0, 6.0, int(SECONDS / 8.0) + 1)
    bar = turns[(session.block.time // 8.0).astype(int)]
    return replace(session, block=replace(session.block, covariates={"clamp_bar": bar}))


def planted(model, session, place, direction, text, **sizes):
    """The session with a law of the user's more in the wrist."""
    law = FormulaLaw("planted", place, np.array(direction), text, ("clamp_bar",), tuple(sizes))
    effect = effect_at(law, place, sizes)
    bare, grown = model.with_effects().batch_with(session.block, [(), (effect,)])
    change = grown.measured - bare.measured
    turned = Rotation.from_rotvec(change[:, 3:]).as_matrix() @ session.rotation
    return replace(session, shift=session.shift + change[:, :3], rotation=turned)


def proposed(model, session):
    problem = WristProblem(model, (as_units(model, session),))
    return propose(problem, problem.begin())


def test_noise_and_tolerances_are_no_law(model, day):
    found = proposed(model, day)
    assert found.terms == ()
    assert found.probability < 0.5
    assert found.lines() == []


def test_a_late_clamp_under_the_frame_is_found_and_can_be_added(model, day):
    session = planted(
        model, day, "frame", [0, 0, 1.0, 0, 0, 0], "lift_um * lag(clamp_bar, 4)", lift_um=0.8
    )
    found = proposed(model, session)
    assert found.probability > 0.99
    (law,) = found.terms
    assert (law.form.kind, law.form.of) == ("a late follower", ("clamp_bar",))
    assert law.component == "frame"
    assert law.direction[2] > 0.95
    assert law.value == pytest.approx(0.8, abs=4.0 * law.sigma)
    assert law.sigma < 0.1
    assert law.shape[0] == pytest.approx(4.0, rel=0.3)
    assert law.explains > 0.9
    assert "at frame or the stand of the instrument for every bar of clamp_bar" in law.sentence
    effect = law.effect("lifted")
    assert isinstance(effect, Effect)
    added = extend(model, effect, [session])
    assert added.own[0].value == pytest.approx(law.value, abs=3.0 * law.sigma)
    assert added.after.rmse(added.quantities[0]) < 0.8 * added.before.rmse(added.quantities[0])
    told = law.command("wrist.yaml", ["monday"], "lifted")
    assert "--direction" in told
    assert "--component frame" in told


def test_a_wave_of_the_difference_of_the_angles_in_a_link_is_found_there(model, day):
    text = "turn_mdeg * sin(18 * (theta_1 - theta_2) + 0.5)"
    session = planted(model, day, "link_3", [0, 0, 0, 0, 1.0, 0], text, turn_mdeg=40.0)
    found = proposed(model, session)
    law = found.terms[0]
    assert law.form.name == "a wave of theta_1 - theta_2"
    assert law.component == "link_3"
    assert abs(law.direction[4]) > 0.95
    assert law.shape[0] == pytest.approx(18.0, rel=0.05)
    assert law.value == pytest.approx(40.0, abs=4.0 * law.sigma)
    assert found.places["link_3"] > 0.9
