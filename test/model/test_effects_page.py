"""The page on effects says what the code does: names, parameters, and its code runs."""

import re
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.python_laws import python_laws
from wrist_stiffness.model.registry import catalogue
from wrist_stiffness.shipped import shipped_file

PAGE = Path(__file__).parents[2] / "docs" / "effects.md"
TEXT = PAGE.read_text()
ROWS = {
    row[0]: row[3] for row in re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \|$", TEXT, re.M)
}


def test_every_effect_has_its_row():
    assert sorted(ROWS) == sorted(catalogue())


@pytest.mark.parametrize("law", catalogue().values(), ids=lambda law: law.id)
def test_parameters_on_the_page_are_the_laws(law):
    """Names before an ellipsis stand for the whole row of axes."""
    known = {p.key for place in law.places for p in law.parameters(place)}
    named = set(re.findall(r"`(\w+)`", ROWS[law.id]))
    assert named <= known
    if "…" not in ROWS[law.id] and "the same" not in ROWS[law.id]:
        assert named == known


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.S)


def test_files_on_the_page_are_models(tmp_path):
    whole, formula, python = blocks("yaml")
    (tmp_path / "my_laws.py").write_text(blocks("python")[1])
    table = str(shipped_file("precomputed/palmieri2015.npz"))
    text = whole.replace("../precomputed/palmieri2015.npz", table) + formula + python
    (tmp_path / "m.yaml").write_text(text)
    with python_laws(True):
        model = load_model(tmp_path / "m.yaml")
    assert [e.law.id for e in model.effects] == [
        "joint_clearance", "thermal_expansion", "soft_hinge", "twist",
    ]  # fmt: skip


def test_typical_magnitudes_are_printed(capsys):
    exec(blocks("python")[0], {})
    printed = capsys.readouterr().out
    assert "backlash width_mdeg 0 +- 20 10%\n" in printed
    assert {line.split()[0] for line in printed.splitlines()} == {*catalogue()}


def test_python_on_the_page_runs(monkeypatch):
    monkeypatch.chdir(PAGE.parents[1])
    names = {
        "time": np.array([0.0, 0.1]),
        "theta": np.radians([[5.0, 5.0], [6.0, 5.0]]),
        "load": np.array([[1.0, 0.5, -2.0, 0.0, 0.0, 0.0]] * 2),
    }
    exec(blocks("python")[2], names)
    assert names["prediction"].warnings == ()
    assert np.allclose(names["several"][1].twist, names["recording"].twist, rtol=1e-12)
    assert np.array_equal(names["tried"].twist, names["prediction"].twist)
