"""The page on effects says what the code does: names, parameters, exactness, and its code runs.

`python test/model/test_effects_page.py` writes the table of exactness.
"""

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


def exactness():
    """Return the table of how exact laws are; a star marks those that columns do not show."""
    shares = {}
    for law in sorted(catalogue().values(), key=lambda law: (law.inexactness, law.id)):
        shares.setdefault(law.inexactness, []).append(f"`{law.id}`" + "*" * (not law.smooth))
    lines = ["| wrong by | effects |", "|---|---|"]
    lines += [f"| {100.0 * share:g} % | {', '.join(laws)} |" for share, laws in shares.items()]
    return "\n".join(lines) + "\n"


TABLES = {"exactness": exactness}


def written(text, name):
    """Return the page before a table that code writes, the table, and the page after it."""
    begin, end = (f"<!-- {name}: {mark} -->\n" for mark in ("begin", "end"))
    before, rest = text.split(begin)
    table, after = rest.split(end)
    return before + begin, table, end + after


@pytest.mark.parametrize("name", TABLES)
def test_a_table_on_the_page_is_what_the_laws_say(name):
    assert written(TEXT, name)[1] == TABLES[name]()


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
    assert "backlash width_mdeg 0 +- 20\n" in printed
    assert {line.split()[0] for line in printed.splitlines()} == {*catalogue()}


def test_python_on_the_page_runs(monkeypatch):
    monkeypatch.chdir(PAGE.parents[1])
    names = {
        "time": np.array([0.0, 0.1]),
        "theta": np.radians([[5.0, 5.0], [6.0, 5.0]]),
        "load": np.array([[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]] * 2),
    }
    exec(blocks("python")[2], names)
    assert np.allclose(names["several"][1].twist, names["recording"].twist, rtol=1e-12)
    assert np.array_equal(names["tried"].twist, names["prediction"].twist)


if __name__ == "__main__":
    for name, table in TABLES.items():
        before, _, after = written(PAGE.read_text(), name)
        PAGE.write_text(before + table() + after)
