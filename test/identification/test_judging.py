"""A fit is judged by units that it has not seen: what they say cannot move it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from measured_wrist import POSE_SCATTER as SIGMA
from measured_wrist import random_poses

from wrist_stiffness.identification.base_fit import fit_cleaned
from wrist_stiffness.identification.free_effects import FreeEffect
from wrist_stiffness.identification.held_out import ANOTHER_SESSION, THIS_SESSION, Judge
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import QUANTITIES, as_units

POSES = 60


def session_of(model, seed):
    """Return poses measured one by one on a wrist that is the model."""
    rng = np.random.default_rng(seed)
    block = random_poses(rng, POSES, 0.5)
    noise = rng.normal(size=(POSES, 6)) * SIGMA
    rotation, shift = exp_twist(model.batch(block).measured)
    nominal = model.table.mechanism.forward(block.theta).platform
    return MeasuredSession(
        f"day_{seed}", block, shift + noise[:, :3], rotation @ nominal, np.diag(SIGMA**2)
    )


def moved(session, rows):
    """Return the session with some shifts that grow with the load: another, softer wrist."""
    shift = session.shift.copy()
    shift[rows] += 2e-5 * session.block.load[rows, :3]
    return replace(session, shift=shift)


def found(model, sessions):
    free = [
        FreeEffect(Effect(find_law("link_stiffness"), "link_1"), {"flexibility_percent": 30.0}),
        FreeEffect(
            Effect(find_law("measurement_frame"), "pose_sensor"),
            {key.key: 1e3 for key in find_law("measurement_frame").parameters("pose_sensor")},
            per_session=True,
        ),
    ]
    units = tuple(as_units(model, each) for each in sessions)
    whole, _ = fit_cleaned(FitProblem(model, units, tuple(free)))
    judge = Judge(whole)
    fitted, _ = fit_cleaned(replace(whole.problem, sessions=judge.seen))
    return SimpleNamespace(by=judge.by, aside=judge.aside, fit=fitted, left=judge.left(fitted))


def stiffness(result):
    unknowns = result.fit.problem.unknowns
    at = [n for n, each in enumerate(unknowns) if each.key == "flexibility_percent"]
    return result.fit.z[at].tolist()


def error(result):
    return result.left.rmse(QUANTITIES[0])


@pytest.mark.parametrize("days", [1, 2])
def test_what_is_put_aside_cannot_move_the_fit(model, days):
    honest = [session_of(model, seed) for seed in range(days)]
    before = found(model, honest)
    aside = slice(0, None) if days > 1 else before.aside
    after = found(model, [*honest[:-1], moved(honest[-1], aside)])
    assert before.by == (ANOTHER_SESSION if days > 1 else THIS_SESSION)
    assert stiffness(after) == stiffness(before)
    # ... while it is judged by them.
    assert error(after) > 3.0 * error(before)


def test_the_wrist_of_the_first_day_foretells_the_second(model):
    """Its registration is fitted anew; a link twice as soft is not, and leaves noise alone."""
    soft = Effect(find_law("link_stiffness"), "link_1").with_values({"flexibility_percent": 100.0})
    days = [session_of(model.with_effects(soft), seed) for seed in (0, 1)]
    after = found(model, days)
    assert error(after) == pytest.approx(np.sqrt(3.0), rel=0.15)


def test_what_is_not_put_aside_moves_it(model):
    honest = session_of(model, 0)
    before = found(model, [honest])
    after = found(model, [moved(honest, ~before.aside)])
    assert stiffness(after) != stiffness(before)
