import json
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from waiting import wait_until

from wrist_stiffness import topics
from wrist_stiffness.cli.main import main
from wrist_stiffness.cli.simulate import in_usual_units
from wrist_stiffness.cli.simulate import simulate as command
from wrist_stiffness.commands import simulate as workflow
from wrist_stiffness.commands.simulate import hide, secret, simulate_recording
from wrist_stiffness.errors import InputError, RecordingError
from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.simulation.catalogue import CATALOGUE
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell

SETTINGS = CellSettings(rate_hz=50.0)


def test_recording_holds_what_the_cell_did(wrist, tmp_path):
    told = []
    simulate_recording(
        tmp_path / "run", wrist(), SETTINGS, 12.0, 3, lambda done, total: told.append((done, total))
    )
    recording = open_recording(tmp_path / "run")
    samples = read_samples(recording)
    commands = read_samples(recording, remaps={"/joint_states": "/motor_commands"}).joints
    cell = VirtualCell(wrist(), SETTINGS, np.random.default_rng(3))
    time_s = np.arange(600) / 50.0
    block = cell.run(time_s, cell.desired(time_s))
    assert np.array_equal(samples.joints.position, block.encoder)
    np.testing.assert_allclose(samples.loads.wrench, block.wrench, rtol=0, atol=1e-15)
    np.testing.assert_allclose(samples.poses.position, block.measured_shift, rtol=0, atol=1e-14)
    assert np.array_equal(commands.position, cell.desired(time_s))
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
    arguments += ["--seconds", "1", "--json", str(tmp_path / "run.json")]
    assert main([*arguments, "--rate", "20"], [command]) == 0
    assert "20 samples" in capsys.readouterr().out
    assert '"samples": 20' in (tmp_path / "run.json").read_text()
    assert main([*arguments, "--overwrite", "--rate", "-3"], [command]) == 2
    assert "rate of -3 Hz" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        (["--seconds", "1e9"], "1e+09 s is not more than 0 and at most 86400 s"),
        (["--seconds", "nan"], "nan s is not"),
        (["--rate", "6000"], "6000 Hz is not more than 0 and at most 5000 Hz"),
        (["--rate", "1", "--seconds", "0.5"], "less than one sample"),
        (["--seed", "-1", "--day", "2"], "seed -1 is negative"),
        (["--sees", "colours"], "'colours', which is not one of pose, points, pointing"),
        (["--lost-beams", "0.9"], "0.9 is not in 0 to 0.5"),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) else "",
)
def test_wishes_out_of_bounds_are_refused_with_the_limit(wish, message, tmp_path, capsys):
    assert main(["simulate", "-o", str(tmp_path / "run"), *wish], [command]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["run", "run.mcap"])
def test_terminated_command_leaves_nothing_behind(name, wrist, tmp_path):
    save_table(wrist(), tmp_path / "table.npz")
    folder = tmp_path / "out"
    folder.mkdir()
    arguments = ["simulate", "-o", str(folder / name), "--table", str(tmp_path / "table.npz")]
    arguments += ["--seconds", "3600", "--rate", "500"]
    process = subprocess.Popen([sys.executable, "-m", "wrist_stiffness", *arguments])
    try:
        wait_until(lambda: list(folder.iterdir()), process)
        process.terminate()
        assert process.wait(timeout=60.0) == 128 + signal.SIGTERM
    finally:
        process.kill()
    assert not list(folder.iterdir())


def test_rosbags_reads_what_was_simulated(wrist, tmp_path):
    highlevel = pytest.importorskip("rosbags.highlevel")
    typesys = pytest.importorskip("rosbags.typesys")
    settings = CellSettings(rate_hz=20.0)
    simulate_recording(tmp_path / "run", wrist(), settings, 3.0, 1)
    samples = read_samples(open_recording(tmp_path / "run"))
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    with highlevel.AnyReader([tmp_path / "run"], default_typestore=store) as reader:
        poses = [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
            if connection.topic == "/platform_pose_measured"
        ]
    assert len(poses) == 60
    assert [p.pose.position.x for p in poses] == samples.poses.position[:, 0].tolist()


def test_half_a_pose_says_by_its_variance_what_was_not_measured(wrist, tmp_path):
    table = wrist()
    for sees, known in (("points", slice(0, 3)), ("pointing", slice(3, 6))):
        path = tmp_path / f"{sees}.mcap"
        settings = CellSettings(rate_hz=20.0, sees=sees)
        simulate_recording(path, table, settings, 2.0, 1)
        messages = [m for _, _, m in open_recording(path).messages([topics.PLATFORM_POSE])]
        assert len(messages) == 40
        for message in messages:
            variance = np.diag(np.reshape(message.pose.covariance, (6, 6)))
            assert np.array_equal(variance == 0.0, np.isin(np.arange(6), np.r_[known]))


def test_lost_beams_leave_gaps_and_a_cmm_measures_once_in_each_rest(wrist, tmp_path):
    table = wrist()
    lost = CellSettings(rate_hz=50.0, lost_beams=0.2)
    simulate_recording(tmp_path / "lost.mcap", table, lost, 40.0, 1)
    poses = read_samples(open_recording(tmp_path / "lost.mcap")).poses
    # One tenth of 2000; six standard deviations of a binomial count are 80.
    assert 120 < 2000 - len(poses.time_ns) < 280
    cmm = CellSettings(rate_hz=50.0, instrument="cmm", program_seconds=40.0)
    simulate_recording(tmp_path / "cmm.mcap", table, cmm, 40.0, 1)
    samples = read_samples(open_recording(tmp_path / "cmm.mcap"))
    seconds = (samples.poses.time_ns - samples.joints.time_ns[0]) * 1e-9
    assert 5 < len(seconds) < 20
    cell = VirtualCell(table, cmm, np.random.default_rng(0))
    for before in (0.02, 1.0):
        assert np.array_equal(cell.desired(seconds), cell.desired(seconds - before))


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


@pytest.mark.parametrize(
    ("magnitude", "si", "told"),
    [
        (0.005756, "rad", "329.8 mdeg"),
        (8e-6, "m", "8 um"),
        (0.014022, "m", "14.02 mm"),
        (2e-6, "m/N", "2 um/N"),
        (0.2, "-", "0.2"),
        (1e-5, "1/K", "1e-05 1/K"),
    ],
)
def test_a_secret_is_told_in_the_units_of_a_diagnosis(magnitude, si, told):
    assert in_usual_units(magnitude, si) == told


def test_another_day_is_of_the_same_wrist_and_effect(wrist, tmp_path, monkeypatch, capsys):
    save_table(wrist(), tmp_path / "table.npz")
    common = ["simulate", "--table", str(tmp_path / "table.npz"), "--seconds", "6", "--rate", "10"]
    hidden, told = [], workflow.VirtualCell

    def seen(table, settings, rng):
        hidden.append((settings.hidden, settings.base_seed, settings.session))
        return told(table, settings, rng)

    monkeypatch.setattr(workflow, "VirtualCell", seen)
    secret = ["--effect", "backlash@motor_2", "--base", "wrong"]
    days = [tmp_path / f"day_{day}.mcap" for day in (1, 2)]
    for day, path in enumerate(days, start=1):
        argv = [*common, "-o", str(path), *secret, "--day", str(day)]
        assert main(argv, [command]) == 0
    (first, base, _), (second, same, _) = hidden
    assert (first, base) == (second, same)
    assert [session for _, _, session in hidden] == [0, 1]
    samples = [read_samples(open_recording(path)).joints for path in days]
    assert samples[1].time_ns[0] - samples[0].time_ns[0] == 86_400 * 10**9
    assert not np.allclose(samples[0].position, samples[1].position)
    for day in ("0", "10001"):
        for asked in (["-o", str(tmp_path / "x")], ["--reveal", "1"]):
            assert main([*common, *asked, "--day", day], [command]) == 2
            assert f"day {day} is not 1 to 10000" in capsys.readouterr().err


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


def test_an_instrument_without_noise_has_no_size_of_an_effect(wrist):
    ideal = replace(SETTINGS, instrument="ideal")
    with pytest.raises(InputError, match="'ideal' has none"):
        hide("backlash@motor_2", 2.0, wrist(), ideal, 6.0)
    with pytest.raises(InputError, match="'ideal' has none"):
        secret(7, wrist(), ideal, 6.0)
