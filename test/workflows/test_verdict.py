"""What a diagnosis says in words of its rest and of what can be corrected."""

from dataclasses import replace

import pytest

from wrist_stiffness.diagnosis import Diagnosis, Finding
from wrist_stiffness.diagnosis.result import Unexplained
from wrist_stiffness.workflows.verdict import correction_of, unexplained_share

GROWTH = Finding(
    (("thermal_expansion", "platform"),), {}, 0.5, 50.0, 0.01, 1.0, {}, "no", "it grows", ""
)


def answer(verdict, share):
    rest = Unexplained((), share, "the conditions foretell a part of what is left")
    return Diagnosis(verdict, "dwell", {}, {}, {}, (), (GROWTH,), rest, (), 0, "this session")


@pytest.mark.parametrize(
    ("verdict", "share", "words"),
    [
        ("effect", 0.0021, "0.2 % of the structure above the noise, too little to look for"),
        ("unknown", 0.374, "37 % of the structure above the noise"),
        ("unknown", 0.0, "nothing of the structure"),
    ],
)
def test_a_small_rest_does_not_read_as_none(verdict, share, words):
    assert unexplained_share(answer(verdict, share)).startswith(words)
    assert ("too little" in unexplained_share(answer(verdict, share))) == (verdict == "effect")


def test_why_nothing_can_be_corrected_is_told_apart():
    assert "only the manipulator" in correction_of(GROWTH)
    drift = replace(GROWTH, members=(("drift", "pose_sensor"),))
    assert "in the instrument" in correction_of(drift)
    assert "its signal" in correction_of(replace(GROWTH, compensable="needs_signal"))
    assert correction_of(replace(GROWTH, compensable="yes")) == "the nodes can correct it"
