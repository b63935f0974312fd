import json

import numpy as np
import pytest

from wrist_stiffness.cli import simulate as command
from wrist_stiffness.cli.main import main
from wrist_stiffness.errors import InputError, RecordingError
from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.simulation.catalogue import CATALOGUE
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.workflows.simulate import hide, simulate_recording

SETTINGS = CellSettings(rate_hz=50.0)


def test_recording_holds_what_the_cell_did(wrist, tmp_path):
    told = []
    simulate_recording(
        tmp_path / "run", wrist(), SETTINGS, 12.0, 3, lambda done, total: told.append((done, total))
    )
    samples = read_samples(open_recording(tmp_path / "run"))
    cell = VirtualCell(wrist(), SETTINGS, np.random.default_rng(3))
    time_s = np.arange(600) / 50.0
    block = cell.run(time_s, cell.desired(time_s))
    assert np.array_equal(samples.joints.position, block.encoder)
    np.testing.assert_allclose(samples.loads.wrench, block.wrench, rtol=0, atol=1e-15)
    np.testing.assert_allclose(samples.poses.position, block.measured_shift, rtol=0, atol=1e-14)
    assert np.array_equal(samples.commands.position, cell.desired(time_s))
    assert np.array_equal(np.diff(samples.joints.time_ns), np.full(599, 20_000_000))
    assert set(samples.loads.frame_id) == {"wrist_base"}
    assert told == [(500, 600), (600, 600)]


def test_the_same_seed_gives_the_same_bytes(wrist, tmp_path):
    for name in ("a", "b"):
        simulate_recording(tmp_path / f"{name}.mcap", wrist(), SETTINGS, 2.0, 7)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_wrong_wishes_are_refused(wrist, tmp_path):
    with pytest.raises(InputError, match="-1"):
        simulate_recording(tmp_path / "run", wrist(), SETTINGS, -1.0, 0)
    with pytest.raises(InputError, match="-5"):
        simulate_recording(tmp_path / "run", wrist(), SETTINGS, 1.0, -5)
    (tmp_path / "run").mkdir()
    with pytest.raises(RecordingError, match="exists"):
        simulate_recording(tmp_path / "run", wrist(), SETTINGS, 1.0, 0)


def test_command_writes_a_recording_and_its_result(wrist, tmp_path, capsys):
    save_table(wrist(), tmp_path / "table.npz")
    arguments = ["simulate", "-o", str(tmp_path / "run"), "--table", str(tmp_path / "table.npz")]
    arguments += ["--seconds", "1", "--rate", "20", "--json", str(tmp_path / "run.json")]
    assert main(arguments, [command]) == 0
    assert "20 samples" in capsys.readouterr().out
    assert '"samples": 20' in (tmp_path / "run.json").read_text()
    assert main([*arguments, "--rate", "-3"], [command]) == 2
    assert "rate_hz = -3" in capsys.readouterr().err


def test_blind_recording_is_opened_by_its_seed_alone(wrist, tmp_path, capsys):
    save_table(wrist(), tmp_path / "table.npz")
    common = ["simulate", "--table", str(tmp_path / "table.npz"), "--seconds", "6", "--rate", "10"]
    riddle, again, clean = (tmp_path / f"{name}.mcap" for name in ("riddle", "again", "clean"))
    for path in (riddle, again):
        assert main([*common, "-o", str(path), "--blind", "3"], [command]) == 0
    assert main([*common, "-o", str(clean)], [command]) == 0
    assert riddle.read_bytes() == again.read_bytes() != clean.read_bytes()
    capsys.readouterr()
    assert main([*common, "--reveal", "3", "--json", str(tmp_path / "key.json")], [command]) == 0
    told = capsys.readouterr().out
    key = json.loads((tmp_path / "key.json").read_text())
    assert key["effect"] in CATALOGUE
    assert told.startswith(f"{key['effect']}@{key['component']} ({key['form']})")


def test_chosen_effect_is_hidden_and_a_wrong_name_refused(wrist):
    table = wrist()
    settings = hide("backlash@motor_2:train", 2.0, table, SETTINGS, 6.0)
    (hidden,) = settings.hidden
    assert (hidden.effect, hidden.component, hidden.form) == ("backlash", "motor_2", "train")
    for wrong in ("backlash", "slack@motor_2", "backlash@joint_2"):
        with pytest.raises(InputError, match=wrong.partition("@")[0]):
            hide(wrong, 2.0, table, SETTINGS, 6.0)
    with pytest.raises(InputError, match="size -1"):
        hide("backlash@motor_2", -1.0, table, SETTINGS, 6.0)
