"""A load of the wrong sign hides behind axes that are off their drawing, and in stiff parts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.taken_up import TakenUp, taken_up
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings
from wrist_stiffness.workflows import diagnose
from wrist_stiffness.workflows.diagnose import mistake_beside

FLOOR = {"s_um": 1.0, "phi_mdeg": 5.0}


def explained(base, absorbed, findings=()):
    """Return an answer that leaves no more than noise."""
    result = SimpleNamespace(noise_floor=FLOOR, after=FLOOR, findings=findings)
    return SimpleNamespace(diagnosis=result, base=base, absorbed=absorbed)


@pytest.mark.parametrize(
    ("sign", "hidden", "words"),
    [
        (-1.0, (), "with the load's sign turned the error falls"),
        (1.0, (HiddenEffect("bushing_stiffness", "joint_1", "plain", 3.0, 5),), ""),
    ],
    ids=["wrong sign", "soft bushing"],
)
def test_parts_that_answer_loads_as_none_does_ask_for_a_wrong_load(
    model, in_the_cell, sign, hidden, words
):
    """A bushing four times as soft asks as well, and is no mistake."""
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=60.0,
        program_seed=41,
        base="wrong",
        base_seed=3,
        hidden=hidden,
    )
    session = in_the_cell(model.table, settings, 3)
    block = replace(session.block, load=sign * session.block.load)
    measured = replace(session, block=block)
    base = fit_base(model, (as_units(model, measured),))
    answer, asked = explained(base, taken_up(base, ["day"])), []
    told = mistake_beside(model, answer, [measured], np.random.default_rng(0), asked.append)
    assert asked == ["asking for a wrong load"]
    assert words in told if words else told == ""


@pytest.mark.parametrize(
    ("name", "deviations", "members", "asked"),
    [
        ("link_stiffness@link_1", 3.1, (), 1),
        ("link_stiffness@link_1", 2.9, (), 0),
        ("axis_misalignment@joint_1", 9.0, (), 0),
        ("link_stiffness@link_1", 0.1, (("load_scale", "load_sensor"),), 1),
        ("link_stiffness@link_1", 0.1, (("backlash", "motor_1"),), 0),
    ],
)
def test_a_usual_answer_asks_for_no_wrong_load(
    model, monkeypatch, name, deviations, members, asked
):
    """It takes a second or more."""
    done = []
    monkeypatch.setattr(diagnose, "mistake_in", lambda *_: done.append(1) or "")
    base = SimpleNamespace(effects=lambda session: ())
    findings = (SimpleNamespace(members=members),)
    taken = (TakenUp(name, {}, "flexibility_percent", -90.0, deviations),)
    mistake_beside(model, explained(base, taken, findings), [], np.random.default_rng(0))
    assert len(done) == asked
