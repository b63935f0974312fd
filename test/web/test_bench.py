"""What the process behind a tab writes."""

import shutil
from pathlib import Path

import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.web import bench as bench_module
from wrist_stiffness.web.bench import Bench

pytestmark = pytest.mark.slow

TUTORIAL = Path(__file__).parents[1] / "data" / "tutorial"
CALIBRATED, EXTENDED = 1, 2


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A bench that was asked what monday misses, and to which that was added."""
    folder = tmp_path_factory.mktemp("bench")
    shutil.copy(TUTORIAL / "monday.mcap", folder)
    bench = Bench(folder, lambda words: None, lambda done, total: None)
    bench.open_named(["monday.mcap"], "")
    bench.calibrate()
    bench.rank()
    bench.look_at("backlash@motor_2")
    bench.add()
    return folder, bench


def exported(bench, number):
    """Return effects of the model that a version's export wrote, its commands, and all names."""
    folder, own = bench
    names = [name for name, _ in own.export(number)["written"]]
    model = load_model(folder / names[0])
    lines = "".join((folder / name).read_text() for name in names[1:2]).splitlines()
    told = [line.split()[1] for line in lines]
    return [each.name for each in model.effects], told, [name.partition(".")[2] for name in names]


def test_commands_lead_to_the_version_that_was_exported(bench):
    effects, commands, names = exported(bench, EXTENDED)
    assert "backlash@motor_2" in effects
    assert commands == ["calibrate", "diagnose", "extend"]
    assert names == ["yaml", "txt", "html"]
    effects, commands, names = exported(bench, CALIBRATED)
    assert "backlash@motor_2" not in effects
    assert commands == ["calibrate", "diagnose"]
    assert names == ["yaml", "txt", "html"]


def test_what_was_opened_takes_no_commands(bench):
    effects, _, names = exported(bench, 0)
    assert "backlash@motor_2" not in effects
    assert names == ["yaml"]


def test_an_export_that_fails_leaves_no_file(bench, monkeypatch):
    folder, own = bench
    before = sorted(folder.iterdir())

    def full(path, page):
        raise InputError(f"{path}: cannot be written: No space left on device")

    monkeypatch.setattr(bench_module, "write_page", full)
    with pytest.raises(InputError, match="No space left"):
        own.export(EXTENDED)
    assert sorted(folder.iterdir()) == before


def test_a_recording_that_is_gone_since_is_exported_as_it_was_read(bench):
    folder, own = bench
    monday = folder / "monday.mcap"
    sha, content = file_sha256(monday), monday.read_bytes()
    monday.unlink()
    try:
        written = own.export(EXTENDED)["written"]
    finally:
        monday.write_bytes(content)
    (report,) = (name for name, _ in written if name.endswith(".html"))
    assert sha[:16] in (folder / report).read_text()
