"""Suspects: what the search found and what was named, in one fit."""

from types import SimpleNamespace

import pytest

from wrist_stiffness.campaign.searching.diagnose import _with_all

AXIS, DELAY, PLAY = "axis_misalignment@joint_4", "time_delay@pose_sensor", "joint_clearance@joint_1"


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
    def fit(*names):
        effects = {name: SimpleNamespace(name=name) for name in names}
        problem = SimpleNamespace(sessions=())
        return SimpleNamespace(extras=names, beyond=lambda: effects, problem=problem)

    def anew(sessions, extras, start):
        assert [each.name for each in extras] == [DELAY, AXIS, PLAY]
        assert start is base
        return "anew"

    base, last = fit(*extras), fit(*final)
    found = _with_all(anew, base, [SimpleNamespace(name=name) for name in named], last)
    assert {"base": base, "final": last}.get(which, "anew") == found
