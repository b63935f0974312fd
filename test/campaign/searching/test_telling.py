"""What an answer says once its findings were fitted with their own laws."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.campaign.searching.telling import (
    buys_anything,
    explained,
    rejudged,
    sized,
    withdrawn,
)
from wrist_stiffness.diagnosis.result import Diagnosis, Finding, Unexplained
from wrist_stiffness.diagnosis.sealed import HeldOut
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law


def backlash(width_mdeg):
    return Effect(find_law("backlash"), "motor_1", {"width_mdeg": Estimate(width_mdeg)})


def finding(name, fall):
    effect, component = name.split("@")
    return Finding(
        ((effect, component),), {}, 0.9, 50.0, 1e-3, 1.0, {"s_um": (fall, 0.1)}, "yes", "", ""
    )


def answer(*findings):
    nothing = Unexplained((), 0.02, "")
    floor, before, after = {"s_um": 1.0}, {"s_um": 10.0}, {"s_um": 3.0}
    scope = "this session only"
    return Diagnosis("effect", "dwell", floor, before, after, (), findings, nothing, (), 0, scope)


def test_an_answer_is_told_with_the_errors_of_the_refits():
    found = answer(finding("backlash@motor_1", 5.0), finding("creep@joint_1", 2.0))
    found = replace(found, before={"s_um": 10.0, "phi_mdeg": 20.0})
    left = [HeldOut(np.full((9, 6), size), np.full(54, size)) for size in (4e-6, 3e-6, 1e-6)]
    told = rejudged(found, left)
    assert set(told.before) == set(found.before)
    for quantity in QUANTITIES:
        each = quantity.per_si * np.sqrt(3.0)
        assert told.before[quantity.key] == pytest.approx(4e-6 * each)
        assert told.after[quantity.key] == pytest.approx(1e-6 * each)
        assert told.findings[0].buys[quantity.key][0] == pytest.approx(1e-6 * each)
        assert told.findings[1].buys[quantity.key][0] == pytest.approx(2e-6 * each)
    assert told.findings[1].heldout_rmse_ratio == pytest.approx(1.0 / 3.0)
    assert rejudged(found, ()) is found


def test_a_finding_says_what_its_own_law_explains():
    """Slopes said a quarter of a bushing fifty times as soft, whose law reaches the noise."""
    found = answer(finding("backlash@motor_1", 5.0), finding("creep@joint_1", 2.0))
    left = [HeldOut(np.full((9, 6), size), np.full(54, size)) for size in (4e-6, 1e-6, 2e-6)]
    creep = Effect(find_law("creep"), "joint_1")
    first, second = explained(rejudged(found, left), [backlash(1.0), creep]).findings
    assert "its own law explains 93.8 % of what is left without it" in first.evidence
    assert "its own law explains 0.0 % of what is left without it" in second.evidence
    assert creep.law.sentence.format(place="joint_1") in second.evidence


def test_an_answer_says_what_was_withdrawn():
    two = (finding("backlash@motor_1", 5.0), finding("creep@joint_1", 2.0))
    whole = answer(*two)
    told = withdrawn(whole, [two[0].name])
    assert told.findings == two[:1]
    assert told.verdict == "unknown"
    assert told.after == {"s_um": 5.0}
    assert told.unexplained.evidence == (
        "creep@joint_1 with its own law explains no more than chance, "
        "or makes the sealed part worse"
    )
    assert withdrawn(whole, [each.name for each in two]) is whole
    assert withdrawn(whole, [two[1].name]).findings == two[1:]


def test_an_effect_far_beyond_the_usual_is_told_as_such():
    (usual,) = sized(answer(finding("backlash@motor_1", 5.0)), [backlash(60.0)]).findings
    (huge,) = sized(answer(finding("backlash@motor_1", 5.0)), [backlash(2400.0)]).findings
    assert usual.evidence == ""
    assert huge.evidence == "; far beyond its usual size: width_mdeg = 2.4e+03"


def test_the_furthest_of_several_parameters_is_told():
    """An axis two millimetres off is no less strange where it is not tilted."""
    axis = Effect(find_law("axis_misalignment"), "joint_4").with_values({"shift_u_um": 2e3})
    (told,) = sized(answer(finding(axis.name, 5.0)), [axis]).findings
    assert told.evidence == "; far beyond its usual size: shift_u_um = 2e+03"


@pytest.mark.parametrize(
    ("shift", "turn", "buys"),
    [
        ((0.15, 0.40), (-1.15, 0.42), False),
        ((0.15, 0.40), (-0.80, 0.42), True),
        ((0.45, 0.40), (-1.15, 0.42), True),
        ((-0.9, 0.40), (1.15, 0.42), True),
        ((-0.9, 0.40), (0.40, 0.42), False),
        ((0.0, 0.0), (0.0, 0.0), True),
    ],
)
def test_a_finding_that_only_makes_the_part_put_aside_worse_buys_nothing(shift, turn, buys):
    found = replace(finding("gravity@link_3", 0.0), buys={"s_um": shift, "phi_mdeg": turn})
    assert buys_anything(found) == buys
