"""A hidden effect on a wrist off its drawing: calibrated, extended, judged on another day."""

import json

import pytest

from wrist_stiffness.cli.main import main


@pytest.mark.slow
def test_the_error_of_another_day_falls_to_the_floor(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    secret = ["--effect", "backlash@motor_2", "--size", "5", "--base", "wrong", "--seed", "1007"]
    for day in ("1", "2"):
        wish = ["--seconds", "90", "--rate", "10", "--day", day, "-o", f"day_{day}"]
        assert main(["simulate", *secret, *wish]) == 0
    assert main(["calibrate", "--fit", "day_1", "-o", "mine.yaml"]) == 0
    added = ["--effect", "backlash@motor_2", "--fit", "day_1", "-o", "worn.yaml"]
    assert main(["extend", "mine.yaml", *added, "--json", "worn.json"]) == 0
    judged = ["--model", "mine.yaml", "--model", "worn.yaml", "--json", "judged.json"]
    assert main(["compare", "day_2", *judged]) == 0

    found = json.loads((tmp_path / "judged.json").read_text())
    before, after = (model["after_registration"] for model in found["models"])
    floor = found["instrument_noise"]
    assert before["phi_mdeg"]["rms"] > 4.0 * floor["phi_mdeg"]
    for key in ("s_um", "phi_mdeg"):
        assert after[key]["rms"] < 1.25 * floor[key]
    told = json.loads((tmp_path / "worn.json").read_text())
    (width,) = (p for p in told["parameters"] if p["effect"] == "backlash")
    # A law may be off by 5 % of its own size.
    assert width["value"] > 10.0 * width["sigma"]
