"""What diagnose says of suspects."""

from wrist_stiffness.campaign.searching.contributions import Contribution
from wrist_stiffness.workflows.diagnose import suspect_lines

PLAY = Contribution(
    "backlash", "motor_1", "finding", {"s_um": (0.0, 0.0), "phi_mdeg": (28.0, 1.5)}, 90.0
)
AXIS = Contribution(
    "axis_misalignment", "joint_2", "tolerance", {"s_um": (9.0, 3.0), "phi_mdeg": (2.0, 1.0)}, 50.0
)
DRIFT = Contribution(
    "drift", "pose_sensor", "suspect", {"s_um": (1.25, 0.4), "phi_mdeg": (0.5, 0.2)}, 8.0
)


def test_suspects_stand_beside_findings_and_are_called_not_proven():
    lines = suspect_lines([PLAY, AXIS, DRIFT])
    assert [line.split(":")[0].strip() for line in lines[2:]] == [PLAY.name, DRIFT.name]
    assert lines[2].endswith("(found)")
    assert "s 1.25 +- 0.4 um, phi 0.5 +- 0.2 mdeg (suspect, not proven)" in lines[3]


def test_without_suspects_nothing_is_added():
    assert suspect_lines([PLAY, AXIS]) == []
