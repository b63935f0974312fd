"""One limit says what is far beyond the usual, whether a fault is named or added."""

from types import SimpleNamespace

import pytest

from wrist_stiffness.campaign.fitting.result import FittedParameter
from wrist_stiffness.campaign.searching.telling import sized, valued
from wrist_stiffness.diagnosis.result import Diagnosis, Finding, Unexplained
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law

USUAL, KEY = 500.0, "compliance_mdeg_per_Nm"


def diagnosed(value):
    """Return a diagnosis that names a compliance of that value [mdeg/(N m)]."""
    finding = Finding(
        (("drive_compliance", "motor_1"),),
        {KEY: (value, 10.0)},
        0.9,
        50.0,
        1e-3,
        1.0,
        {"s_um": (2.0, 0.1)},
        "yes",
        "",
        "",
    )
    error = {"s_um": 1.0}
    rest = Unexplained((), 0.02, "")
    return Diagnosis("effect", "dwell", error, error, error, (), (finding,), rest, (), 0, "one")


def named(value):
    """Return what a diagnosis says of a compliance of that value [mdeg/(N m)]."""
    effect = Effect(find_law("drive_compliance"), "motor_1").with_values({KEY: value})
    return sized(diagnosed(value), [effect]).findings[0].evidence


def added(value):
    """Return whether `extend` warns of it."""
    name = "drive_compliance@motor_1"
    return FittedParameter(name, KEY, None, value, 10.0, 0.0, USUAL, USUAL, False, ()).far


@pytest.mark.parametrize("sizes", [2.9, 3.1, 3.9, 29.0, 31.0])
def test_what_is_named_is_far_beyond_the_usual_where_what_is_added_is(sizes):
    told = "far beyond its usual size: compliance_mdeg_per_Nm" in named(sizes * USUAL)
    assert told == added(sizes * USUAL) == (sizes > 3.0)


def test_the_sentence_has_the_value_of_the_list_below_it():
    """Slopes and laws agree within their uncertainty, and a reader sees one number."""
    effect = Effect(find_law("drive_compliance"), "motor_1").with_values({KEY: 40.2 * USUAL})
    (finding,) = sized(diagnosed(40.0 * USUAL), [effect]).findings
    assert finding.evidence.endswith(f"{KEY} = {40.0 * USUAL:.3g}")


@pytest.mark.parametrize(("whole", "told"), [(520.0, 500.0), (540.0, 540.0), (2000.0, 2000.0)])
def test_where_slopes_do_not_hold_the_law_says_the_value(whole, told):
    """A bushing 35 times as soft read 7 from its slopes, beside a sentence that knew better."""
    fitted = SimpleNamespace(values_on_top=lambda name: {KEY: (whole, 5.0)})
    (finding,) = valued(diagnosed(500.0), fitted).findings
    assert finding.parameters == {KEY: (told, 10.0 if told == 500.0 else 5.0)}


@pytest.mark.parametrize("stands_for_a_fit", [True, False])
def test_a_finding_that_stands_for_its_fit_tells_what_that_found(stands_for_a_fit):
    """Slopes said 66.4 +- 8.7 mdeg of a backlash that its own law knows to 0.4 mdeg."""
    fitted = SimpleNamespace(values_on_top=lambda name: {KEY: (505.0, 0.4)})
    whole = {"drive_compliance@motor_1"} if stands_for_a_fit else ()
    (finding,) = valued(diagnosed(500.0), fitted, whole).findings
    assert finding.parameters == {KEY: (505.0, 0.4) if stands_for_a_fit else (500.0, 10.0)}
