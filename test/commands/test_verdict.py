"""What a diagnosis says in words."""

from dataclasses import replace

import pytest

from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.inference import Diagnosis, Finding
from wrist_stiffness.inference.answer import Standing
from wrist_stiffness.inference.search import MANY_FITS, TIME_OVER
from wrist_stiffness.numerals import percent
from wrist_stiffness.report.absorbed import absorbed_lines
from wrist_stiffness.report.diagnosis_report import (
    chance_of,
    class_of,
    correction_of,
    verdict_lines,
)

GROWTH = Finding(
    (("thermal_expansion", "platform", 1.0),), 0.97, {}, 25.0, 0.9, {}, "no", "it grows", ""
)
SIZES = {"s_um": 1.0, "phi_mdeg": 3.0}


def answer(verdict, findings=(), depends_on=None, probability=0.97):
    return Diagnosis(
        verdict,
        probability,
        SIZES,
        {"s_um": 4.0, "phi_mdeg": 8.0} if depends_on else {"s_um": 0.0, "phi_mdeg": 0.0},
        SIZES,
        SIZES,
        tuple(findings),
        (),
        depends_on or {},
        0.3 if depends_on else 0.0,
        (),
        (),
    )


@pytest.mark.parametrize(
    ("share", "words"),
    [(0.004, "under 1 %"), (0.07, "7 %"), (0.97, "97 %"), (0.995, "99.5 %"), (1.0, "over 99.9 %")],
)
def test_no_probability_is_rounded_to_certainty(share, words):
    assert percent(share) == words


def test_nothing_missing_says_how_sure_that_is():
    (line,) = verdict_lines(answer("none"))
    assert line == "Nothing is missing: what is left is noise (97 % sure)."


def test_nothing_missing_is_not_said_where_it_is_not_likely():
    (line,) = verdict_lines(answer("undecided", probability=0.14))
    assert line == "Not decided: what is left may be noise (14 %) or an effect listed below."
    ended = replace(answer("undecided", probability=0.14), ended=TIME_OVER)
    assert "time was over" in verdict_lines(ended)[1]


def test_what_is_named_comes_with_its_probability_and_with_what_is_left():
    lines = verdict_lines(answer("effect", [GROWTH], {"the load": 0.8, "the speed": 0.2}))
    assert lines[0] == "Missing in the model: thermal_expansion@platform, 97 % sure."
    assert lines[1] == (
        "Left above the noise: s 4 um, phi 8 mdeg. It depends on the load (80 %), the speed (20 %)."
    )


@pytest.mark.parametrize(
    ("depends_on", "words"),
    [
        ({"the pose": 1.0}, "The error is real, but no effect in the catalogue explains it."),
        ({}, "An effect is missing, but these recordings do not say which."),
    ],
)
def test_unknown_is_an_error_without_a_name_or_a_name_without_an_answer(depends_on, words):
    assert verdict_lines(answer("unknown", (), depends_on))[0] == words


@pytest.mark.parametrize(
    ("ended", "words", "advice"),
    [
        (TIME_OVER, "The time was over", " Allow more --seconds."),
        (MANY_FITS, "The limit of fits was reached", ""),
    ],
)
def test_a_search_that_was_stopped_does_not_say_that_nothing_explains_it(ended, words, advice):
    left = [Standing("creep@joint_1", 0.0, gain, False, "") for gain in (0.5,)]
    left += [Standing("backlash@motor_1", 0.0, 40.0, False, "")]
    stopped = replace(answer("unknown", (), {"the pose": 1.0}), standings=tuple(left), ended=ended)
    first, rest = verdict_lines(stopped)
    assert first == (
        f"{words} before every candidate was fitted; most promising: backlash@motor_1.{advice}"
    )
    assert "depends on the pose" in rest


def test_what_was_not_fitted_in_time_is_not_compared():
    late = Standing("backlash@motor_1", None, 40.0, False, "not compared: the time was over")
    assert chance_of(late) == "-"


def test_another_session_that_is_not_explained_is_no_nothing_missing():
    sizes = {"after": {"s_um": 11.0}, "unforeseen": {"s_um": 22.0}}
    held_out = replace(answer("unknown"), scope="another session", **sizes)
    (line,) = verdict_lines(replace(held_out, contradicted={"s_um": 12.0}))
    assert line.startswith("In another session s is off by 11 um (22.0 times noise and drift)")
    assert line.endswith("it may not be the same wrist, or not in the same state.")
    first, second = verdict_lines(replace(held_out, verdict="none"))
    assert first.startswith("Nothing is missing")
    assert second.endswith("Calibrate with all of them.")


def test_the_members_of_a_class_have_their_shares():
    members = (("creep", "joint_1", 0.6), ("creep", "joint_2", 0.4))
    assert class_of(replace(GROWTH, members=members)) == (
        "creep@joint_1 (60 %; or creep@joint_2 40 %)"
    )


def test_why_nothing_can_be_corrected_is_told_apart():
    assert "only the manipulator" in correction_of(GROWTH)
    drift = replace(GROWTH, members=(("drift", "pose_sensor", 1.0),))
    assert "in the instrument" in correction_of(drift)
    assert "its signal" in correction_of(replace(GROWTH, compensable="needs_signal"))
    assert correction_of(replace(GROWTH, compensable="yes")) == "the nodes can correct it"


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
