"""A pin rests in one place, wherever its search begins."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from wrist_stiffness.model.pin_play import MAX_STEPS, SMALL_FORCE, WALL, Play

RADIAL = 1e-5
ROUNDING = 1e-12 * RADIAL
SECTORS = 8


def hindered(seed):
    """Return a pin that flanges hold off the wall."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(SECTORS, SECTORS)) + 3.0 * np.eye(SECTORS)
    return Play(
        RADIAL,
        rng.normal(size=(1, 4)),
        RADIAL * rng.uniform(-0.3, 0.5, (1, SECTORS)),
        0.3 * rng.normal(size=(1, SECTORS, 4)),
        1e-7 * (root @ root.T)[None],
    )


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("far", [0.0, 1e-3, 0.3, 2.0], ids=lambda far: f"{far:g} of the play off")
def test_where_the_search_begins_does_not_show(seed, far):
    play = hindered(seed)
    wanted = play.resting()
    assert not np.allclose(wanted, play._unhindered(), rtol=0.0, atol=1e-3 * RADIAL)
    off = np.random.default_rng(seed + 100).normal(size=4)
    found = play.resting(wanted + far * RADIAL * off / np.linalg.norm(off))
    assert np.abs(found - wanted).max() < ROUNDING


def test_a_search_that_begins_near_the_end_is_short(monkeypatch):
    play = hindered(0)
    steps = []
    counted = Play._hessian
    monkeypatch.setattr(
        Play, "_hessian", lambda self, *given: steps.append(1) or counted(self, *given)
    )
    rests = play.resting()
    cold = len(steps)
    play.resting(rests * (1.0 + 1e-4))
    assert len(steps) - cold < 0.5 * cold


def test_a_rest_told_by_many_samples_is_sought_once(monkeypatch):
    rows = np.array([0, 0, 0, 1, 1, 0])
    parts = [vars(hindered(seed)) for seed in range(2)]
    names = ("force", "gap", "opening", "approach")
    several = (np.concatenate([part[name] for part in parts])[rows] for name in names)
    sought, own = [], Play._hindered
    monkeypatch.setattr(
        Play, "_hindered", lambda self, begin: sought.append(len(begin)) or own(self, begin)
    )
    found = Play(RADIAL, *several).resting()
    assert sought == [3]
    alone = np.concatenate([hindered(seed).resting() for seed in range(2)])
    assert np.abs(found - alone[rows]).max() < ROUNDING


@pytest.mark.parametrize("changed", ["force", "gap", "opening", "approach"])
def test_samples_are_one_rest_only_if_they_are_alike_in_everything(changed):
    play, other = hindered(0), hindered(1)
    also = replace(play, **{changed: getattr(other, changed)})
    names = ("force", "gap", "opening", "approach")
    both = (np.concatenate([getattr(play, name), getattr(also, name)]) for name in names)
    first, second = Play(RADIAL, *both).resting()
    assert np.abs(first - play.resting()[0]).max() < ROUNDING
    assert np.abs(second - also.resting()[0]).max() < ROUNDING
    assert np.abs(second - first).max() > 1e-3 * RADIAL


@pytest.mark.parametrize("radial", [1e-7, RADIAL, 1e-4, 1e-3])
@pytest.mark.parametrize("seed", range(8))
def test_a_rest_is_found_in_any_play_from_anywhere(monkeypatch, seed, radial):
    """Forces balance, in fewer steps than a third of those that are allowed."""
    play = replace(hindered(seed), radial=radial, gap=hindered(seed).gap * radial / RADIAL)
    rng, own, steps = np.random.default_rng(seed), Play._hessian, []
    monkeypatch.setattr(Play, "_hessian", lambda self, *a: steps.append(1) or own(self, *a))
    for begin in (None, rng.normal(0.0, 2.0 * radial, (1, 4))):
        steps.clear()
        _, gradient, _ = play._state(play.resting(begin), None)
        assert np.abs(gradient).max() < 1e-7
        assert len(steps) < MAX_STEPS / 3


@pytest.fixture
def states(monkeypatch):
    """Return a list that grows with each state that a search asks for."""
    asked = []
    own = Play._state
    monkeypatch.setattr(Play, "_state", lambda self, *a: asked.append(1) or own(self, *a))
    return asked


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("turn", "size", "most"), [(0.1, 1.0, 6), (0.5, 1.0, 14), (0.0, 0.9, 14)])
def test_a_search_follows_the_walls(states, seed, turn, size, most):
    """Straight steps would run into them: that took up to 96 states."""
    play = hindered(seed)
    cosine, sine = np.cos(turn), np.sin(turn)
    begin = play.resting().reshape(2, 2) @ [[cosine, sine], [-sine, cosine]]
    states.clear()
    play.resting(size * begin.reshape(1, 4))
    assert len(states) <= most


def test_rounding_of_an_energy_whose_terms_cancel_does_not_hold_a_search_up(states):
    """It was halved until nothing was left of the step: 1,207 states."""

    def pulled(scale):
        play = hindered(29)
        return replace(play, force=scale * play.force)

    def energy(scale):
        play = pulled(scale)
        return play._state(play.resting(), None)[0][0]

    play = pulled(brentq(energy, 0.6, 0.7, xtol=1e-16))
    rest, off = play.resting(), np.random.default_rng(1).normal(size=4)
    for share in np.geomspace(1e-10, 1e-6, 65):
        states.clear()
        play.resting(rest + share * RADIAL * off)
        assert len(states) <= 4


def test_a_flange_alone_presses_a_pin_into_its_wall(states):
    """No force of its own says how deep."""
    overlap, opening = np.full((1, 1), -5.0 * RADIAL), np.array([[[1.0, 0.0, 0.2, 0.0]]])
    play = Play(RADIAL, np.zeros((1, 4)), overlap, opening, np.full((1, 1, 1), 1e-7))
    upper, _, lower, _ = play.resting()[0] / RADIAL
    assert len(states) < 8
    # What is left of the overlap presses with 1 N per 0.1 um, and the wall gives.
    force = (5.0 - upper - 0.2 * lower) * RADIAL / 1e-7
    assert [upper - 1.0, lower - 1.0] == pytest.approx(
        [force / WALL / RADIAL, 0.2 * force / WALL / RADIAL], rel=1e-3
    )


@pytest.mark.parametrize("small", [SMALL_FORCE, 0.3, 1.0])
def test_an_end_that_carries_little_goes_a_part_of_the_way_to_its_wall(small):
    force = small * np.array([[0.25, 0.0, 0.0, -0.5]])
    free = replace(hindered(0), force=force, opening=np.zeros((1, SECTORS, 4)), small_force=small)
    assert free.resting() == pytest.approx(RADIAL * force / small, rel=1e-9)
