"""A wrong load hides behind axes that are off their drawing, and in stiff or soft parts."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from measured_wrist import wrong_wrist

from wrist_stiffness.commands import diagnose
from wrist_stiffness.commands.diagnose import mistake_beside
from wrist_stiffness.comparing import compare as module
from wrist_stiffness.comparing.compare import wrong_load
from wrist_stiffness.comparing.wiring import LOAD_MISTAKES, MISTAKES, Suspicion
from wrist_stiffness.identification.base_fit import fit_base
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.identification.taken_up import TakenUp, taken_up
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

FLOOR = {"s_um": 1.0, "phi_mdeg": 5.0}


def explained(base, absorbed, findings=()):
    """Return an answer that leaves no more than noise."""
    result = SimpleNamespace(noise_of_judge=FLOOR, after=FLOOR, findings=findings)
    return SimpleNamespace(diagnosis=result, fitted=base, absorbed=absorbed)


def of_a_wrong_base(in_the_cell, table, hidden=()):
    settings = wrong_wrist(60.0, 41, 3, hidden=hidden)
    return in_the_cell(table, settings, 3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sign", "hidden", "words"),
    [
        (-1.0, (), "with the load's sign turned a fit leaves"),
        (1.0, (HiddenEffect("bushing_stiffness", "joint_1", "plain", 3.0, 5),), ""),
    ],
    ids=["wrong sign", "soft bushing"],
)
def test_parts_that_answer_loads_as_none_does_ask_for_a_wrong_load(
    model, in_the_cell, sign, hidden, words
):
    """A bushing four times as soft asks as well, and is no mistake."""
    session = of_a_wrong_base(in_the_cell, model.table, hidden)
    block = replace(session.block, load=sign * session.block.load)
    measured = replace(session, block=block)
    base = fit_base(model, (as_units(model, measured),))
    answer, asked = explained(base, taken_up(base, ["day"])), []
    told = mistake_beside(model, answer, [measured], asked.append)
    assert asked == ["asking for a wrong load"]
    assert words in told if words else told == ""


@pytest.mark.slow
def test_a_load_in_kN_is_told_of_a_tracker_on_a_wrist_within_its_tolerances(model, in_the_cell):
    settings = CellSettings(rate_hz=20.0, program_seconds=60.0, instrument="tracker", base="wrong")
    sound = in_the_cell(model.table, settings, 3)
    block = replace(sound.block, load=1e-3 * sound.block.load)
    measured = (replace(sound, block=block, covariance=None),)
    found = calibrate(model, measured)
    told = wrong_load(model, found.model, measured, found)
    assert "with the load times 1000 a fit leaves" in told


@pytest.mark.slow
def test_a_whole_fit_tells_what_it_would_else_take_up(model, in_the_cell, monkeypatch):
    """The load is in the other frame."""
    sound = of_a_wrong_base(in_the_cell, model.table)
    block = replace(sound.block, load_on_platform=not sound.block.load_on_platform)
    measured = (replace(sound, block=block),)
    found, fits = calibrate(model, measured), []

    def fitted(_, sessions, *told):
        fits.append((sessions, calibrate(model, sessions, *told)))
        return fits[-1][1]

    monkeypatch.setattr(module, "calibrate", fitted)
    told = wrong_load(model, found.model, measured, found)
    assert "with the load in the other frame a fit leaves" in told
    right, wrong_fit = (
        float(number) for number in re.search(r"leaves (\S+) um of s, not (\S+),", told).groups()
    )
    assert wrong_fit == pytest.approx(found.after["s_um"], rel=0.01)
    # Fitted once more, under the load that it was.
    [((again,), put_right)] = fits
    assert again.block.load_on_platform == sound.block.load_on_platform
    np.testing.assert_array_equal(again.block.load, sound.block.load)
    assert right == pytest.approx(put_right.after["s_um"], rel=0.01)


@pytest.mark.parametrize(
    ("name", "deviations", "members", "asked"),
    [
        ("link_stiffness@link_1", 3.1, (), 1),
        ("link_stiffness@link_1", 2.9, (), 0),
        ("axis_misalignment@joint_1", 9.0, (), 0),
        ("link_stiffness@link_1", 0.1, (("load_scale", "load_sensor", 1.0),), 1),
        ("link_stiffness@link_1", 0.1, (("backlash", "motor_1", 1.0),), 0),
    ],
)
def test_a_usual_answer_asks_for_no_wrong_load(
    model, monkeypatch, name, deviations, members, asked
):
    """It takes a second or more."""
    done = []
    monkeypatch.setattr(diagnose, "wrong_load", lambda *_: done.append(1) or "")
    base = SimpleNamespace(effects=lambda session: ())
    findings = (SimpleNamespace(members=members),)
    taken = (TakenUp(name, {}, "flexibility_percent", -90.0, deviations),)
    mistake_beside(model, explained(base, taken, findings), [])
    assert len(done) == asked


def test_a_second_fit_no_better_than_the_first_tells_no_mistake(monkeypatch):
    """And it was asked for loads alone."""
    asked = []
    evidence = SimpleNamespace(log=-300.0, point=SimpleNamespace(left=[0.0] * 100))
    found = SimpleNamespace(fit=SimpleNamespace(evidence=evidence))
    suspicion = Suspicion(MISTAKES[0], 0.99, 0.4, "the error falls")
    monkeypatch.setattr(module, "suspicion_in", lambda *a: asked.append(a[2]) or suspicion)
    monkeypatch.setattr(module, "answering_as", lambda *_: None)
    monkeypatch.setattr(module, "calibrate", lambda *a: found)
    assert wrong_load(None, None, ()) == ""
    assert asked == [LOAD_MISTAKES]
