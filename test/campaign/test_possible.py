"""The likeliest shares of effects that none can be proven of: usual sizes and data together."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.candidates import wrist_candidates
from wrist_stiffness.campaign.searching.contributions import Decomposed
from wrist_stiffness.campaign.searching.place import point_of
from wrist_stiffness.campaign.searching.possible import possible
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.simulation.cell import CellSettings


@pytest.fixture(scope="module")
def fitted(model, in_the_cell):
    """Forty seconds of a sound wrist, with nothing but the set-up and tolerances fitted."""
    settings = CellSettings(rate_hz=10.0, program_seconds=40.0, program_seed=41, base="exact")
    return fit_base(model, (as_units(model, in_the_cell(model.table, settings, 3)),))


@pytest.fixture(scope="module")
def catalogue(fitted):
    return wrist_candidates(point_of(fitted), ())


def only(catalogue, *names):
    return [each for each in catalogue if each.name in names]


def room(fitted, candidate, *others):
    """How unsure data leave an effect [um], over how unsure it was before."""
    parts = {each.name: each for each in possible(fitted, [candidate, *others])}
    usual = Decomposed(fitted).beyond(candidate.at(candidate.shapes[0]) * candidate.usual)
    before = 1e6 * np.sqrt(np.mean(np.sum(usual[:, :3] ** 2, axis=(1, 2))))
    return parts[candidate.name].sizes["s_um"][1] / before


def test_data_leave_little_room_for_what_would_have_shown(fitted, catalogue):
    (play,) = only(catalogue, "backlash@motor_1")
    assert possible(fitted, [play])[0].kind == "possible"
    assert room(fitted, play) < 0.1


def test_what_the_tolerances_imitate_keeps_more_of_its_usual_size(fitted, catalogue):
    """A soft frame moves the platform under load as links do, within what links differ by."""
    play, frame = only(catalogue, "backlash@motor_1", "frame_compliance@frame")
    assert room(fitted, frame) > 3.0 * room(fitted, play)


def test_rivals_that_no_data_tell_apart_share_what_is_left(fitted, catalogue):
    (one,) = only(catalogue, "backlash@motor_1")
    twin = replace(one, place="motor_9")
    (alone,) = possible(fitted, [one])
    beside = possible(fitted, [one, twin])
    assert [each.signal for each in beside] == pytest.approx([0.5 * alone.signal] * 2, rel=0.05)
    assert room(fitted, one, twin) > 3.0 * room(fitted, one)


def test_it_is_the_posterior_of_a_linear_model_with_the_base_marginalised(fitted, catalogue):
    """The covariance of the data, base and effects in it, says the same without projections."""
    names = ("backlash@motor_1", "gravity@platform", "drift@pose_sensor")
    effects = [each for each in only(catalogue, *names) if len(each.shapes) == 1]
    assert len(effects) >= 2
    white = fitted.whiten
    variance = max(1.0, fitted.variance)
    seen = fitted.problem.table.measured.ravel()
    weights = fitted.problem.weights
    base = white(fitted.columns)[seen] / np.maximum(weights, 1e-4)
    own = [white(each.at(()) * each.usual)[seen] for each in effects]
    total = variance * np.eye(seen.sum()) + base @ base.T + sum(a @ a.T for a in own)
    # As if the wrist stood at its prior means, to first order.
    rest = (white(fitted.residual) - white(fitted.columns) @ fitted.z)[seen]
    found = {each.name: each for each in possible(fitted, effects)}
    whole = Decomposed(fitted)
    for each, columns in zip(effects, own, strict=True):
        mean = columns.T @ np.linalg.solve(total, rest)
        left = np.eye(columns.shape[1]) - columns.T @ np.linalg.solve(total, columns)
        beyond = whole.beyond(each.at(()) * each.usual)
        error = 1e6 * np.sqrt(
            np.mean(np.einsum("uik,kl,uil->u", *(beyond[:, :3], left, beyond[:, :3])))
        )
        assert found[each.name].signal == pytest.approx(
            np.linalg.norm(white(beyond) @ mean), rel=1e-3
        )
        assert found[each.name].sizes["s_um"][1] == pytest.approx(error, rel=1e-3)


def test_where_laws_leave_more_than_noise_the_data_say_less(fitted, catalogue):
    (play,) = only(catalogue, "backlash@motor_1")
    rough = replace(fitted, residual=10.0 * fitted.residual)
    (sure,), (doubtful,) = possible(fitted, [play]), possible(rough, [play])
    assert doubtful.sizes["phi_mdeg"][1] > 5.0 * sure.sizes["phi_mdeg"][1]


def test_where_a_wrist_has_every_effect_already_nothing_else_is_possible(fitted):
    assert possible(fitted, []) == ()
