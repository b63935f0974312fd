import numpy as np
import pytest

from wrist_stiffness.campaign.comparing.conditions import Condition
from wrist_stiffness.campaign.comparing.sentences import Change, Statement
from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.inference import Observations
from wrist_stiffness.workflows.report import comparison_report
from wrist_stiffness.workflows.report.parts import against


def test_a_picture_shows_the_change_of_which_one_is_surest():
    side = np.array([-0.5, 0.5, -0.5, 0.5])
    turn = np.radians(30e-3)
    values = np.zeros((4, 6))
    values[:, 0], values[:, 4] = 0.6e-6 * side, 2.0 * turn * side
    observations = Observations(
        values, {}, np.eye(6) * 1e-12, np.arange(4.0), np.zeros(4, dtype=int), quantities=QUANTITIES
    )
    shift = Change("s", "um", 0.6, 0.2, np.array([1.0, 0.0, 0.0]))
    rotation = Change("phi", "mdeg", 60.0, 3.0, np.array([0.0, 1.0, 0.0]))
    condition = Condition("approach direction", "approach", "When it rises", side[:, None])
    statement = Statement(condition, (shift, rotation), 0.001, 0.9, ())
    shown = against(statement, [("model", observations)])
    assert shown.label.startswith("phi about +y")
    assert dict(shown.residuals)["model"] == pytest.approx([-30.0, 30.0, -30.0, 30.0])


@pytest.mark.parametrize(
    ("share", "text"), [(None, "-"), (0.884, "88 %"), (1.0, "all"), (2.39, "all"), (-0.2, "-20 %")]
)
def test_a_share_is_never_more_than_all(share, text):
    assert comparison_report._share(share) == text
