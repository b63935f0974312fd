"""Each built-in example shows what its card says."""

import numpy as np
import pytest

from wrist_stiffness.commands.extend import FormulaEffect, direction_of
from wrist_stiffness.web.bench import Bench
from wrist_stiffness.web.examples import EXAMPLES

pytestmark = pytest.mark.slow

NAMING = 0.9


def opened(name, folder):
    """Return a bench with an example, and what the page shows once it was asked."""
    told = []
    bench = Bench(folder, told.append, lambda done, total: None)
    bench.open_example(name)
    calibrated = bench.calibrate()
    told.clear()
    found = bench.rank()
    assert len(told) > 1
    return bench, calibrated, found


def held_out(changes):
    return changes["rows"][-1].held_out


def added(bench, candidate):
    bench.look_at(candidate)
    return bench.add()["rows"][-1]


def test_there_is_one_of_each_kind():
    assert [each.name for each in EXAMPLES] == ["known_fault", "unknown_fault", "cannot_tell"]


def test_a_known_fault_is_named_and_adding_it_leads_to_the_noise(tmp_path):
    bench, calibrated, found = opened("known_fault", tmp_path)
    (finding,) = found["diagnosis"].findings
    assert finding.names == ("backlash@motor_2",)
    before, after = held_out(calibrated), added(bench, finding.name).held_out
    floor = found["diagnosis"].noise
    assert after["phi_mdeg"] < 1.2 * floor["phi_mdeg"] < 0.2 * before["phi_mdeg"]


def test_a_fault_on_no_list_is_told_as_such_and_the_error_falls_by_the_proposed_law(tmp_path):
    bench, calibrated, found = opened("unknown_fault", tmp_path)
    assert found["diagnosis"].verdict == "unknown"
    assert found["diagnosis"].findings == ()
    _, law = found["offers"][0]
    assert "theta_1" in law["formula"]
    assert "theta_2" in law["formula"]
    place = "proposed", law["component"], direction_of(law["direction"].split())
    candidate = FormulaEffect(*place, law["formula"], {})
    seen, left = bench.look_at(candidate)["seen"], calibrated["view"][1].left
    assert seen.check == ""
    was, then = (
        left.rms(np.nan_to_num(values) ** 2)["s_um"]
        for values in (left.values, left.values - seen.change)
    )
    assert then < 0.6 * was
    after = added(bench, candidate)
    assert after.warnings == ()
    assert after.held_out["s_um"] < 0.6 * held_out(calibrated)["s_um"]


def test_data_that_cannot_tell_show_two_causes_as_alike(tmp_path):
    _, _, found = opened("cannot_tell", tmp_path)
    diagnosis = found["diagnosis"]
    assert diagnosis.verdict == "effect"
    (finding,) = diagnosis.findings
    assert "link_stiffness@link_2" in finding.names
    first, second = sorted((share for _, _, share in finding.members), reverse=True)[:2]
    assert first < 2.0 * second
    assert all(each.probability < NAMING for each in diagnosis.standings)
    assert not found["offers"]
