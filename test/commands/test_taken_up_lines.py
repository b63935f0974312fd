"""What a terminal tells of the refit: what left its tolerance a line each, the rest in one."""

from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.report.diagnosis_lines import absorbed_lines

MOVED = {"s": 1.0, "phi": 2.0}


def test_only_what_left_its_tolerance_has_a_line_of_its_own():
    lines = absorbed_lines(
        [
            TakenUp("load_bias@load_sensor in a day", MOVED),
            TakenUp("link_stiffness@link_1", MOVED, "flexibility_percent", 55.0, 3.2),
            TakenUp("bushing_stiffness@joint_1", MOVED, "flexibility_percent", 9.0, 0.5),
            TakenUp("load_scale@load_sensor", MOVED, "scale_percent", 0.1, 0.1),
        ]
    )
    assert len(lines) == 3
    assert "load_bias@load_sensor in a day: 1.00 um of s, 2.00 mdeg of phi" in lines[0]
    assert "flexibility_percent = 55, 3.2 standard deviations" in lines[1]
    assert lines[2].endswith("bushing_stiffness@joint_1, load_scale@load_sensor")
