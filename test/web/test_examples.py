"""Each built-in example shows what its card says, and the process behind a tab writes it."""

import numpy as np
import pytest

from wrist_stiffness.commands.extend import FormulaEffect, direction_of
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.web import bench as bench_module
from wrist_stiffness.web.bench import Bench
from wrist_stiffness.web.examples import EXAMPLES

pytestmark = pytest.mark.slow

NAMING = 0.9
CALIBRATED, EXTENDED = 1, 2


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
    return bench.add()


@pytest.fixture(scope="module")
def known_fault(tmp_path_factory):
    """Folder and bench of the first example, calibrated, asked, and its fault added."""
    folder = tmp_path_factory.mktemp("known_fault")
    bench, *answers = opened("known_fault", folder)
    return folder, bench, (*answers, added(bench, "backlash@motor_2"))


def test_there_is_one_of_each_kind():
    assert [each.name for each in EXAMPLES] == ["known_fault", "unknown_fault", "cannot_tell"]


def test_a_known_fault_is_named_and_adding_it_leads_to_the_noise(known_fault):
    _, _, (calibrated, found, grown) = known_fault
    (finding,) = found["diagnosis"].findings
    assert finding.names == ("backlash@motor_2",)
    before, after = held_out(calibrated), held_out(grown)
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
    after = added(bench, candidate)["rows"][-1]
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


def exported(known_fault, number):
    """Return effects of the model that a version's export wrote, its commands, and all names."""
    folder, own, _ = known_fault
    names = [name for name, _ in own.export(number)["written"]]
    model = load_model(folder / names[0])
    lines = "".join((folder / name).read_text() for name in names[1:2]).splitlines()
    told = [line.split()[1] for line in lines]
    return [each.name for each in model.effects], told, [name.partition(".")[2] for name in names]


def test_commands_lead_to_the_version_that_was_exported(known_fault):
    effects, commands, names = exported(known_fault, EXTENDED)
    assert "backlash@motor_2" in effects
    assert commands == ["calibrate", "diagnose", "extend"]
    assert names == ["yaml", "txt", "html"]
    effects, commands, names = exported(known_fault, CALIBRATED)
    assert "backlash@motor_2" not in effects
    assert commands == ["calibrate", "diagnose"]
    assert names == ["yaml", "txt", "html"]


def test_what_was_opened_takes_no_commands(known_fault):
    effects, _, names = exported(known_fault, 0)
    assert "backlash@motor_2" not in effects
    assert names == ["yaml"]


def test_an_export_that_fails_leaves_no_file(known_fault, monkeypatch):
    folder, own, _ = known_fault
    before = sorted(folder.iterdir())

    def full(path, page):
        raise InputError(f"{path}: cannot be written: No space left on device")

    monkeypatch.setattr(bench_module, "write_page", full)
    with pytest.raises(InputError, match="No space left"):
        own.export(EXTENDED)
    assert sorted(folder.iterdir()) == before


def test_a_recording_that_is_gone_since_is_exported_as_it_was_read(known_fault):
    folder, own, _ = known_fault
    first = folder / ".examples/known_fault/day_1.mcap"
    sha, content = file_sha256(first), first.read_bytes()
    first.unlink()
    try:
        written = own.export(EXTENDED)["written"]
    finally:
        first.write_bytes(content)
    (report,) = (name for name, _ in written if name.endswith(".html"))
    assert sha[:16] in (folder / report).read_text()
