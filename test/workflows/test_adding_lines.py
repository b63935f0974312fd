"""What diagnose says of the parts of a wrist that none can be proven of."""

from wrist_stiffness.campaign.searching.contributions import (
    MOST_POSSIBLE,
    Contribution,
    worth_hearing,
)
from wrist_stiffness.workflows.diagnose import adding_lines

PLAY = Contribution(
    "backlash", "motor_1", "finding", {"s_um": (0.0, 0.0), "phi_mdeg": (28.0, 1.5)}, 90.0
)
AXIS = Contribution(
    "axis_misalignment", "joint_2", "tolerance", {"s_um": (9.0, 3.0), "phi_mdeg": (2.0, 1.0)}, 50.0
)
DRIFT = Contribution(
    "drift", "pose_sensor", "suspect", {"s_um": (1.25, 0.4), "phi_mdeg": (0.5, 0.2)}, 8.0
)
CREEP = [
    Contribution("creep", f"joint_{n}", "possible", {"s_um": (1.0, 2.0)}, 7.0 - n)
    for n in range(1, 7)
]
LEFT = {"s_um": 1.1, "phi_mdeg": 4.2}


def test_suspects_stand_beside_findings_and_are_called_not_proven():
    lines = adding_lines(worth_hearing([PLAY, AXIS, DRIFT], False, LEFT))
    assert [line.split(":")[0].strip() for line in lines[2:]] == [PLAY.name, DRIFT.name]
    assert lines[2].endswith("(found)")
    assert "s 1.25 +- 0.40 um, phi 0.50 +- 0.20 mdeg (suspect, not proven)" in lines[3]


def test_without_suspects_nothing_is_added():
    assert adding_lines(worth_hearing([PLAY, AXIS], True, LEFT)) == []


def test_guesses_are_told_where_something_is_left_that_nothing_explains():
    parts = [PLAY, AXIS, DRIFT, *CREEP]
    assert worth_hearing(parts, True, LEFT) == [PLAY, DRIFT, *CREEP[:MOST_POSSIBLE]]
    assert worth_hearing(parts, False, LEFT) == [PLAY, DRIFT]
    assert worth_hearing([PLAY, *CREEP], False, LEFT) == []
    assert adding_lines([CREEP[0]])[-1].endswith("(possible, a guess from usual sizes)")


def test_a_guess_larger_than_all_that_is_left_is_not_told():
    """Delays of the sensor and of a motor may cancel each other, and neither tells anything."""
    delay = Contribution(
        "time_delay", "pose_sensor", "possible", {"s_um": (0.1, 0.2), "phi_mdeg": (13.9, 20.0)}, 9.0
    )
    assert worth_hearing([delay, DRIFT, CREEP[0]], True, LEFT) == [DRIFT, CREEP[0]]
    assert worth_hearing([delay, DRIFT], True, {**LEFT, "phi_mdeg": 14.0}) == [delay, DRIFT]
