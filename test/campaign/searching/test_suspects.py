"""Suspects: what the search found and what was named, in one fit."""

from types import SimpleNamespace

import pytest

from wrist_stiffness.campaign.searching.diagnose import _with_all

AXIS, DELAY, PLAY = "axis_misalignment@joint_4", "time_delay@pose_sensor", "joint_clearance@joint_1"


def fit(*names, cost):
    effects = {name: SimpleNamespace(name=name) for name in names}
    problem = SimpleNamespace(sessions=())
    return SimpleNamespace(extras=names, beyond=lambda: effects, problem=problem, cost=cost)


def suspected(extras, named, final, left=50.0):
    """Return the fits by name, and which of them has the suspects; all at once leave `left`."""
    fits = {
        "base": fit(*extras, cost=left),
        "final": fit(*final, cost=100.0),
        "anew": fit(DELAY, AXIS, PLAY, cost=left),
    }

    def anew(sessions, extras, start):
        assert [each.name for each in extras] == [DELAY, AXIS, PLAY]
        assert start is fits["base"]
        return fits["anew"]

    effects = [SimpleNamespace(name=name) for name in named]
    found = _with_all(anew, fits["base"], effects, fits["final"])
    return next(name for name, each in fits.items() if each is found)


@pytest.mark.parametrize(
    ("extras", "named", "final", "which"),
    [
        ([DELAY], [DELAY], [DELAY], "final"),
        ([DELAY], [DELAY, PLAY], [DELAY, PLAY], "final"),
        ([DELAY, AXIS], [DELAY], [DELAY], "base"),
        ([DELAY, AXIS], [PLAY], [PLAY], "anew"),
    ],
)
def test_suspects_are_fitted_anew_only_where_no_fit_has_them_all(extras, named, final, which):
    assert suspected(extras, named, final) == which


@pytest.mark.parametrize("named", [DELAY, PLAY])
def test_more_suspects_that_leave_more_are_none(named):
    """Beside play, delay and friction a gear ended in the next minimum, at seven times as much."""
    assert suspected([DELAY, AXIS], [named], [named], left=700.0) == "final"
