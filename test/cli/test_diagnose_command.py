"""`wrist-stiffness diagnose` on a recording that hides backlash of motor 2."""

import json
from pathlib import Path

import pytest

from wrist_stiffness.cli.main import main

RECORDING = Path(__file__).parents[1] / "data" / "wrist_b.mcap"


@pytest.mark.slow
def test_the_verdict_comes_first_and_the_file_says_the_same(capsys, tmp_path):
    result, page = tmp_path / "why.json", tmp_path / "why.html"
    command = [
        "diagnose",
        str(RECORDING),
        "--json",
        str(result),
        "--ranking",
        "--report",
        str(page),
    ]
    assert main(command) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Missing in the model: backlash@motor_2, ")
    assert any("measurement_frame@pose_sensor" in line for line in lines)
    assert lines[-2:] == [f"written: {page}", f"written: {result}"]
    values = json.loads(result.read_text())
    assert values["schema"] == 2
    assert values["verdict"] == "effect"
    (finding,) = values["findings"]
    (member,) = finding["class"]
    assert (member["effect"], member["component"]) == ("backlash", "motor_2")
    assert finding["probability"] > 0.99
    assert finding["buys"]["phi_mdeg"][0] > 5 * finding["buys"]["phi_mdeg"][1] > 0
    assert values["after"]["rms_phi_mdeg"] < 2.0 * values["noise"]["phi_mdeg"]
    assert values["ranking"][0]["candidate"] == "backlash@motor_2"
    assert len(values["change_by_unit_m_rad"]["backlash@motor_2"][0]) == 6
    assert values["provenance"]["recordings"]
    assert "backlash@motor_2" in page.read_text()


def test_a_recording_that_is_not_there_is_one_line(capsys, tmp_path):
    assert main(["diagnose", str(tmp_path / "none.mcap")]) == 2
    assert "none.mcap" in capsys.readouterr().err


def test_a_report_on_many_wrists_is_refused_before_any_work(refused):
    wrong = refused("diagnose", "monday.mcap", "--each", "--report", "x.html")
    assert "argument --report: not allowed with argument --each" in wrong
