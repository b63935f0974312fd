"""A pin rests in one place, wherever its search begins."""

import numpy as np
import pytest

from wrist_stiffness.model.pin_play import Play

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
