"""The whole way: a session of the virtual cell, or a recording, to a named effect."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.campaign.searching.diagnose import diagnose_sessions
from wrist_stiffness.errors import InputError
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

SECONDS = 120.0


def measured(in_the_cell, model, hidden=(), base="wrong", seed=3):
    """One session of a wrist with a wrong base, ten measurements a second."""
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=SECONDS,
        program_seed=41,
        hidden=hidden,
        base=base,
        base_seed=seed,
    )
    return in_the_cell(model.table, settings, seed)


def answer(model, session, seed=0):
    return diagnose_sessions(model, [session], np.random.default_rng(seed))


@pytest.mark.slow
def test_a_wrong_base_alone_is_no_missing_effect(model, in_the_cell):
    found = answer(model, measured(in_the_cell, model))
    assert found.diagnosis.verdict == "none"
    assert found.effects == ()
    # The millimetre and the fifth of a degree of the registrations are told instead.
    taken = next(line for line in found.diagnosis.absorbed if "measurement_frame" in line)
    assert float(taken.split(": ")[1].split(" um")[0]) > 100.0


@pytest.mark.slow
@pytest.mark.parametrize("blank", ["nothing", "position"])
def test_backlash_behind_a_wrong_base_is_named_with_its_width(model, in_the_cell, blank):
    width = 1e-3
    session = measured(
        in_the_cell, model, (HiddenEffect("backlash", "motor_1", "single", width, 5),)
    )
    if blank == "position":
        session = replace(session, shift=np.full_like(session.shift, np.nan))
    found = answer(model, session)
    assert [finding.name for finding in found.diagnosis.findings] == ["backlash@motor_1"]
    value, error = found.diagnosis.findings[0].parameters["width_mdeg"]
    fitted = found.effects[0].estimates["width_mdeg"].value
    assert abs(value - 1e3 * np.degrees(width)) < 3.0 * error
    assert abs(fitted - 1e3 * np.degrees(width)) < 3.0 * error
    # A hidden encoder count is 4 mdeg, and two minutes have some ten dwells for each side.
    assert error < 5.0
    assert found.diagnosis.after["phi_mdeg"] < 0.5 * found.diagnosis.before["phi_mdeg"]


def test_no_session_is_refused(model):
    with pytest.raises(InputError, match="no session to diagnose"):
        diagnose_sessions(model, [], np.random.default_rng(0))


def test_a_session_without_a_measured_pose_is_named(model, in_the_cell):
    session = measured(in_the_cell, model, base="exact")
    nothing = np.full_like(session.shift, np.nan), np.full_like(session.rotation, np.nan)
    blank = replace(session, name="tuesday", shift=nothing[0], rotation=nothing[1])
    for sessions in ([session, blank], [blank, session]):
        with pytest.raises(InputError, match="tuesday: no measured pose"):
            diagnose_sessions(model, sessions, np.random.default_rng(0))
