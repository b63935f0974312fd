"""Many wrists diagnosed at once: one line for each."""

import json
from pathlib import Path

import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.fleet import Answer
from wrist_stiffness.report.fleet_lines import diagnosed_lines


def diagnosed(verdict, *classes, mistake="", keys=("s_um", "phi_mdeg"), ended="", note=""):
    members = [[name.split("@") for name in names] for names in classes]
    return {
        "verdict": verdict,
        "complete": not ended,
        "ended": ended,
        "notes": ["m was never fitted to a wrist", *([note] if note else [])],
        "provenance": {"recordings": {"h": "00"}},
        "findings": [
            {"class": [{"effect": law, "component": place} for law, place in own]}
            for own in members
        ],
        "before": {f"rms_{key}": 12.34 for key in keys},
        "after": {f"rms_{key}": 1.234 for key in keys},
        "noise": dict.fromkeys(keys, 1.1),
        "noise_known": True,
        "set_up_mistake": mistake,
    }


def test_each_wrist_has_a_line_that_says_what_is_missing():
    look = "Look at the set-up first: with the load's sign turned a fit leaves less"
    rows = (
        Answer(Path("a.mcap"), diagnosed("none")),
        Answer(Path("b.mcap"), diagnosed("effect", ["backlash@motor_2"])),
        Answer(
            Path("c.mcap"),
            diagnosed("unknown", ["creep@joint_1", "drift@pose_sensor"], mistake=look),
        ),
        Answer(Path("d.mcap"), diagnosed("unknown", keys=("phi_mdeg",))),
        Answer(Path("e.mcap"), None, "e.mcap: no measured pose"),
        Answer(Path("f.mcap"), diagnosed("undecided")),
        Answer(Path("g.mcap"), diagnosed("unknown", ended="the time was over")),
        Answer(Path("day/h.mcap"), diagnosed("none", note="h: the recording is damaged: cut")),
    )
    lines = diagnosed_lines(rows)
    said = {line.split()[0]: line for line in lines[2:10]}
    assert said["a.mcap"].endswith("  nothing")
    assert said["b.mcap"].endswith("  backlash@motor_2")
    assert said["b.mcap"].split()[1:5] == ["12.3", "->", "1.23", "1.1"]
    assert said["c.mcap"].endswith("  creep@joint_1 (or 1 more), something unknown")
    assert said["d.mcap"].split()[1:7] == ["-", "-", "12.3", "->", "1.23", "1.1"]
    assert said["d.mcap"].endswith("  something unknown")
    assert said["e.mcap"].split(maxsplit=1)[1] == "not diagnosed: no measured pose"
    assert said["f.mcap"].endswith("  not decided")
    assert said["g.mcap"].endswith("  something unknown (the time was over)")
    assert lines[10:] == ["", f"c.mcap: {look}", "day/h.mcap: the recording is damaged: cut"]
    # All lines of the table are aligned.
    assert len({line.index("  nothing") for line in lines if line.endswith("  nothing")}) == 1
    assert lines[1].index("  missing") == said["b.mcap"].index("  backlash")


def test_what_gauges_read_has_columns_of_its_own():
    rows = (Answer(Path("a.mcap"), diagnosed("none", keys=("gauges_um",))),)
    _, header, line = diagnosed_lines(rows)
    assert header.split()[:4] == ["recording", "gauges", "[um]", "noise"]
    assert line.split() == ["a.mcap", "12.3", "->", "1.23", "1.1", "nothing"]


@pytest.mark.slow
def test_a_folder_is_one_table_and_a_bad_recording_a_line_of_it(tmp_path, capsys):
    folder = tmp_path / "wrists"
    folder.mkdir()
    hidden = ["--effect", "backlash@motor_2", "--size", "10", "--seconds", "40", "--rate", "10"]
    assert main(["simulate", *hidden, "-o", str(folder / "wrist_b.mcap")]) == 0
    capsys.readouterr()
    (folder / "wrist_x.mcap").write_bytes(b"no recording")
    out = tmp_path / "fleet.json"
    assert main(["diagnose", str(folder), "--each", "--json", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "backlash@motor_2" in next(line for line in lines if "wrist_b" in line)
    assert "not diagnosed: " in next(line for line in lines if "wrist_x" in line)
    rows = json.loads(out.read_text())["recordings"]
    assert [row["diagnosis"] is None for row in rows] == [False, True]
    assert rows[0]["diagnosis"]["verdict"] == "effect"
    assert "no recording" in rows[1]["error"] or "MCAP" in rows[1]["error"]


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_a_fleet_of_which_nothing_can_be_read_is_bad_input(tmp_path, capsys, command):
    for name in "ab":
        (tmp_path / f"{name}.mcap").write_bytes(b"no recording")
    assert main([command, str(tmp_path), "--each"]) == 2
    assert capsys.readouterr().out.count("not ") >= 2
