"""What no tangent shows: axes that moved after the flanges were shimmed, beside whole fits."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.campaign.fitting.free_effects import FreeEffect, free_all
from wrist_stiffness.campaign.fitting.problem import FitProblem
from wrist_stiffness.campaign.searching.asking import LEAST_WANDER, wander_of
from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.candidates import SHARE, wrist_candidates
from wrist_stiffness.campaign.searching.diagnose import (
    _confirmed,
    diagnose_sessions,
)
from wrist_stiffness.campaign.searching.place import point_of
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.diagnosis import Diagnosis
from wrist_stiffness.diagnosis.result import Finding, Unexplained
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

AXIS = "axis_misalignment@joint_4"
HIDDEN = HiddenEffect("axis_misalignment", "joint_4", "plain", 6e-5, 7)


@pytest.fixture(scope="module")
def session(model, in_the_cell):
    """Two minutes of a wrist off its drawing whose axis went off by 60 um after it was shimmed."""
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=120.0,
        program_seed=41,
        hidden=(HIDDEN,),
        base="wrong",
        base_seed=1001,
    )
    return in_the_cell(model.table, settings, 4)


@pytest.fixture(scope="module")
def alone(model, session):
    return fit_base(model, (as_units(model, session),))


def axis(**values):
    law = find_law("axis_misalignment")
    return Effect(law, "joint_4").with_values(values)


@pytest.mark.slow
def test_an_axis_that_moved_after_shimming_is_found_with_the_whole_base(model, session):
    found = diagnose_sessions(model, [session], np.random.default_rng(1))
    (finding,) = found.diagnosis.findings
    assert AXIS in finding.names
    parameters = finding.parameters
    assert SHARE not in parameters
    assert all(sigma > 0.0 for _, sigma in parameters.values())


@pytest.mark.slow
def test_shims_do_not_follow_what_came_on_top(model, session, alone):
    """Where they did, the tolerances of the base had to bear it, told the name or not."""
    found = fit_base(model, alone.problem.sessions, [axis(shift_u_um=5.0)], alone)
    assert found.cost < 0.8 * alone.cost
    assert found.strain < 0.5 * alone.strain


@pytest.mark.slow
def test_a_base_is_strained_where_it_stood_in_for_an_effect(model, alone):
    assert alone.strained
    told = fit_base(model, alone.problem.sessions, [axis(shift_u_um=5.0)], alone)
    assert not told.strained


def test_what_is_set_up_anew_is_no_strain(alone):
    """Each further session would add to it, and a sound wrist be searched for a fault."""
    anew = np.array([unknown.session is not None for unknown in alone.problem.unknowns])
    assert replace(alone, z=alone.z + 10.0 * anew).strain == alone.strain
    assert replace(alone, z=alone.z + 10.0 * ~anew).strain > alone.strain + 100.0


def test_gaps_follow_the_axis_as_built_and_not_what_came_on_top(model, alone):
    units = alone.problem.sessions
    free = (
        free_all(axis()),
        free_all(Effect(find_law("flange_contact"), "joint_4")),
        FreeEffect(axis(), {"shift_v_um": 30.0}),
    )
    problem = FitProblem(model, units, free)
    keys = [(unknown.free, unknown.key) for unknown in problem.unknowns]

    def at(place, key, steps):
        z = np.zeros(len(keys))
        z[keys.index((place, key))] = steps
        return {each.name: each for each in problem.effects(z, 0)}

    built, later = at(0, "shift_v_um", 1.0), at(2, "shift_v_um", 1.0)
    gap = [each["flange_contact@joint_4"].estimates["gap_um"].value for each in (built, later)]
    assert abs(gap[0]) > 1.0
    assert gap[1] == 0.0
    assert built[AXIS].estimates["shift_v_um"].value == pytest.approx(30.0)
    assert later[AXIS].estimates["shift_v_um"].value == pytest.approx(30.0)


@pytest.mark.slow
def test_a_candidate_stands_for_a_whole_fit(alone):
    """One column, the price of all its parameters, and what the fit strained."""
    candidates = {c.name: c for c in wrist_candidates(point_of(alone), ())}
    own = candidates[AXIS].candidate()
    change = np.random.default_rng(2).normal(size=alone.residual.shape)
    whole = candidates[AXIS].changed_by(change, 3.0).candidate()
    assert [p.name for p in whole.parameters] == [SHARE]
    assert whole.freedom == own.freedom
    assert whole.strain == 3.0
    assert np.array_equal(whole.evaluate(alone.problem.table, ())[:, :, 0], change)


def test_a_wander_is_never_less_than_half_the_scatter_of_a_sample(alone):
    """Rests of two minutes showed 0.05 mdeg where it was 0.3, and the rest was named a drift."""
    (session,) = alone.problem.sessions
    columns = wander_of(alone).columns(alone.problem.table)
    size = np.sqrt(np.mean(columns[:, :, :6] ** 2, axis=0)).max(axis=1)
    assert np.all(size > 0.6 * LEAST_WANDER * session.white)


@pytest.mark.slow
def test_play_beside_something_large_is_found_with_the_whole_base(model, in_the_cell):
    """Its slopes about a base that bore it say too little; what is left in the end is settled."""
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=60.0,
        program_seed=1007,
        hidden=(
            HiddenEffect("time_delay", "pose_sensor", "plain", 2e-3, 1),
            HiddenEffect("joint_clearance", "joint_1", "algebraic", 5e-7, 2),
        ),
        base="wrong",
        base_seed=1007,
    )
    session = in_the_cell(model.table, settings, 4)
    found = diagnose_sessions(model, [session], np.random.default_rng(1))
    names = [each.name for each in found.diagnosis.findings]
    assert names == ["time_delay@pose_sensor", "joint_clearance@joint_1"]
    assert found.diagnosis.verdict == "effect"
    play = found.effects[1].estimates["clearance_um"].value
    assert play == pytest.approx(0.5, rel=0.3)


def finding(name):
    return Finding((tuple(name.split("@")),), {}, 0.1, 50.0, 0.001, 1.0, {}, "yes", "", "")


def answer(verdict, *names):
    left = Unexplained((), 0.0, "of " + verdict)
    found = tuple(finding(name) for name in names)
    return Diagnosis(verdict, "dwell", {}, {}, {}, (), found, left, (), 0, "")


@pytest.mark.parametrize(
    ("found", "beside", "verdict", "names"),
    [
        (("effect", "a@x", "b@x"), ("none",), "effect", ["a@x"]),
        (("effect", "b@x", "a@x"), ("effect", "c@x"), "effect", ["a@x", "c@x"]),
        (("effect", "a@x", "b@x"), ("unknown",), "unknown", ["a@x"]),
        (("unknown", "a@x"), ("none",), "unknown", ["a@x"]),
    ],
)
def test_beside_a_whole_fit_stays_what_is_found_about_it(found, beside, verdict, names):
    """Of an only finding the verdict stays: what its law leaves is judged by what it explains."""
    result = _confirmed(answer(*found), "a@x", answer(*beside))
    assert result.verdict == verdict
    assert [each.name for each in result.findings] == names
