"""What a diagnosis says in words of its rest and of what can be corrected."""

from dataclasses import replace

import pytest

from wrist_stiffness.campaign.comparing.conditions import FORCES, MOMENTS, OWN
from wrist_stiffness.diagnosis import Diagnosis, Finding
from wrist_stiffness.diagnosis.result import Unexplained
from wrist_stiffness.workflows.verdict import (
    CONDITIONS,
    conditions_in_words,
    correction_of,
    unexplained_share,
    verdict_lines,
)

GROWTH = Finding(
    (("thermal_expansion", "platform"),), {}, 0.5, 50.0, 0.01, 1.0, {}, "no", "it grows", ""
)


def answer(verdict, share, after=1.2):
    rest = Unexplained((), share, "the conditions foretell a part of what is left")
    floor, before, after = {"s_um": 1.0}, {"s_um": 50.0}, {"s_um": after}
    return Diagnosis(
        verdict, "dwell", floor, before, after, (), (GROWTH,), rest, (), 0, "this session"
    )


@pytest.mark.parametrize(
    ("verdict", "share", "words"),
    [
        ("effect", 0.0021, "0.2 % of the structure above the noise, too little to look for"),
        ("unknown", 0.374, "37 % of the structure above the noise"),
        ("unknown", 0.0, "what was named at first and did not hold"),
        ("effect", 0.0, "nothing of the structure"),
    ],
)
def test_a_small_rest_does_not_read_as_none(verdict, share, words):
    assert unexplained_share(answer(verdict, share)).startswith(words)
    assert ("too little" in unexplained_share(answer(verdict, share))) == (
        verdict == "effect" and share > 0.0
    )


def test_a_small_share_of_a_large_error_is_not_called_little():
    text = unexplained_share(answer("effect", 0.04, after=12.0))
    assert text.startswith("4 % of the structure above the noise, and still 12 times the noise")
    assert "too little" not in text


def test_why_nothing_can_be_corrected_is_told_apart():
    assert "only the manipulator" in correction_of(GROWTH)
    drift = replace(GROWTH, members=(("drift", "pose_sensor"),))
    assert "in the instrument" in correction_of(drift)
    assert "its signal" in correction_of(replace(GROWTH, compensable="needs_signal"))
    assert correction_of(replace(GROWTH, compensable="yes")) == "the nodes can correct it"


def test_conditions_are_told_in_words_and_what_the_user_named_by_its_name():
    told = conditions_in_words(("approach_2", "held_s", "clamp_bar", "T_link_1"))
    assert told == "approach direction of motor 2, hold time, clamp_bar, T_link_1"
    assert set(CONDITIONS) == {*OWN, *FORCES, *MOMENTS}


def test_what_was_named_at_first_is_no_rest_of_nothing():
    withdrawn = replace(answer("unknown", 0.0), findings=())
    assert unexplained_share(withdrawn) == "what was named at first and did not hold"
    assert verdict_lines(withdrawn)[0].startswith("Something may be missing, too little to be told")
    beside = verdict_lines(answer("unknown", 0.0))
    assert beside[0] == "Missing in the model: thermal_expansion@platform."
    assert beside[1].startswith("Something else may be missing, too little to be told")
    left = replace(withdrawn, unexplained=Unexplained((), 0.3, "more is left than the noise"))
    assert verdict_lines(left) == ["Something is missing that no known effect explains."]


@pytest.mark.parametrize(
    ("after", "words"),
    [
        (1.4, "Nothing is missing: what is left is noise."),
        (1.8, "what is left is 1.8 times the noise and depends on nothing that was recorded"),
    ],
)
def test_nothing_missing_says_when_more_than_the_noise_is_left(after, words):
    (told,) = verdict_lines(replace(answer("none", 0.0, after), findings=()))
    assert words in told
