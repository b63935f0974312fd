"""Commissioning: what was set up anew, what is this wrist's own, and the lineage."""

import csv
import json
import re

import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.numerals import plus_minus
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import CellSettings

LOAD = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")


def recorded(folder, session, seconds, **settings):
    """Write a session of the virtual wrist on a day of its own."""
    path = folder / f"day_{session}.mcap"
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    settings = CellSettings(
        rate_hz=10.0,
        program_seconds=seconds,
        program_seed=40 + session,
        base_seed=9,
        session=session,
        **settings,
    )
    simulate_recording(path, table, settings, seconds, session)
    return path


@pytest.mark.slow
def test_a_wrong_wrist_is_calibrated_to_the_noise_of_a_day_not_seen(tmp_path, capsys):
    """Stiffness +-30 %, axes +-30 um and 0.05 deg, registrations of 1 mm and 0.2 deg each day."""
    days = [recorded(tmp_path, day, 60.0, base="wrong") for day in (0, 1)]
    output, report = tmp_path / "mine.yaml", tmp_path / "mine.json"
    # Named in the wrong order: the stamps tell which was last.
    fit = ["--fit", str(days[1]), str(days[0])]
    assert main(["calibrate", *fit, "-o", str(output), "--json", str(report)]) == 0
    told = json.loads(report.read_text())
    assert told["judged_by"] == "another session"
    assert told["set_up_mistake"] == ""
    assert told["before"]["rmse_s_um"] > 500.0
    for key in ("s_um", "phi_mdeg"):
        assert told["after"][f"rmse_{key}"] < 1.2 * told["noise"][key]
    assert [session["name"] for session in told["sessions"]] == ["day_0.mcap", "day_1.mcap"]
    text = capsys.readouterr().out
    assert "set up in day_0.mcap:" in text
    assert "not identifiable from these recordings:" in text

    model = load_model(output)
    (step,) = model.lineage
    assert step.recordings == {path.name: file_sha256(path) for path in days}
    assert step.parent_sha256 == file_sha256(shipped_file("config/palmieri2015_model.yaml"))
    newest = {
        each["parameter"]: each["value"]
        for each in told["parameters"]
        if each["effect"] == "measurement_frame" and each["session"] == "day_1.mcap"
    }
    effects = {effect.name: effect for effect in model.effects}
    written = effects["measurement_frame@pose_sensor"].estimates
    assert {key: estimate.value for key, estimate in written.items()} == pytest.approx(newest)
    # All were fitted together, so a node evaluates the model once for a sample.
    assert model.variations == ()
    assert 0.0 < model.joint.measured[:3].max() < 1e-6


@pytest.mark.slow
def test_what_is_left_asks_for_a_wrong_sign(tmp_path, capsys):
    """No effect is missing, and none would help.

    A load of the wrong sign hides behind axes that are off their drawing, and once these are
    fitted behind parts that the same fit made as stiff as they can be.
    """
    day = recorded(tmp_path, 0, 90.0, base="wrong")
    table, wrong = tmp_path / "day.csv", tmp_path / "wrong.csv"
    assert main(["export", str(day), "-o", str(table)]) == 0
    with table.open() as rows, wrong.open("w") as out:
        reader = csv.DictReader(rows)
        writer = csv.DictWriter(out, reader.fieldnames)
        writer.writeheader()
        for row in reader:
            writer.writerow(row | {key: -float(row[key]) for key in LOAD})
    assert main(["import", str(wrong), "-o", str(tmp_path / "wrong")]) == 0
    output, told = tmp_path / "mine.yaml", tmp_path / "mine.json"
    fit = ["--fit", str(tmp_path / "wrong"), "-o", str(output), "--json", str(told)]
    assert main(["calibrate", *fit]) == 0
    mistake = json.loads(told.read_text())["set_up_mistake"]
    assert "with the load's sign turned a fit leaves" in mistake
    text = capsys.readouterr().out
    assert mistake in text
    assert text.index("an effect is missing") < text.index(mistake)


def test_the_output_folder_is_looked_for_before_the_work(tmp_path, capsys):
    missing = tmp_path / "nowhere" / "m.yaml"
    assert main(["calibrate", "--fit", str(tmp_path / "x.mcap"), "-o", str(missing)]) == 2
    assert "does not exist" in capsys.readouterr().err


@pytest.mark.parametrize("places", [("/proc/m.yaml", "x.json"), ("m.yaml", "/proc/x.json")])
def test_a_folder_that_takes_no_file_is_told_before_the_work(tmp_path, monkeypatch, capsys, places):
    monkeypatch.chdir(tmp_path)
    output, result = places
    assert main(["calibrate", "--fit", "none.mcap", "-o", output, "--json", result]) == 2
    assert ": cannot be written: No such file" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("output", "why"), [("", "it is a folder"), ("monday.mcap", "a model is no recording")]
)
def test_what_is_no_place_for_a_model_is_told_before_the_work(tmp_path, capsys, output, why):
    fit = ["--fit", str(tmp_path / "monday.mcap")]
    assert main(["calibrate", *fit, "-o", str(tmp_path / output), "--overwrite"]) == 2
    assert why in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "seconds"),
    [
        (["calibrate"], "2"),
        (["extend", "--effect", "backlash@motor_1"], "5"),
    ],
)
def test_a_recording_of_seconds_is_too_short_to_fit_to(tmp_path, capsys, command, seconds):
    short = str(tmp_path / "short.mcap")
    assert main(["simulate", "-o", short, "--seconds", seconds]) == 0
    assert main([*command, "--fit", short, "-o", str(tmp_path / "m.yaml")]) == 2
    error = capsys.readouterr().err
    assert re.search(
        r"short.mcap: \d+ dwells and moments are too few to fit to, it needs 12", error
    )


def test_a_recording_that_is_not_there_is_one_line(tmp_path, capsys):
    arguments = ["--fit", str(tmp_path / "x.mcap"), "-o", str(tmp_path / "m.yaml")]
    assert main(["calibrate", *arguments]) == 2
    assert "does not exist" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (12.345, 0.42, "12.35 +- 0.42"),
        (-1013.7, 20.4, "-1014 +- 20"),
        (5.0, 0.0, "5.000 +- 0.000"),
        (-0.4, 58.0, "0 +- 58"),
        (0.00123, 0.000021, "0.001230 +- 0.000021"),
    ],
)
def test_two_digits_of_the_uncertainty_are_shown(value, sigma, text):
    assert plus_minus(value, sigma) == text


@pytest.mark.parametrize(
    "command", [["calibrate"], ["extend", "--effect", "backlash@motor_1"]], ids=lambda c: c[0]
)
def test_a_model_that_is_there_is_not_replaced_unasked(command, tmp_path, capsys):
    kept = tmp_path / "kept.yaml"
    kept.write_text("mine")
    arguments = ["--fit", str(tmp_path / "x.mcap"), "-o", str(kept)]
    assert main([*command, *arguments]) == 2
    assert "exists already" in capsys.readouterr().err
    # With leave to replace, the next complaint is of the recording.
    assert main([*command, *arguments, "--overwrite"]) == 2
    assert "x.mcap" in capsys.readouterr().err
    assert kept.read_text() == "mine"
