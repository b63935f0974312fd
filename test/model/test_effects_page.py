"""The page on effects says what the code does: names, parameters, sizes, and its code runs.

`python test/model/test_effects_page.py` writes the table of usual sizes.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.parameters import has_unit
from wrist_stiffness.model.registry import catalogue
from wrist_stiffness.shipped import shipped_file

PAGE = Path(__file__).parents[2] / "docs" / "effects.md"
TEXT = PAGE.read_text()
ROWS = {
    row[0]: row[3] for row in re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \|$", TEXT, re.M)
}

BEGIN, END = "<!-- usual sizes: begin -->\n", "<!-- usual sizes: end -->\n"
SIGNS = {"um": "µm", "percent": "%", "Nmm": "N mm", "gmm2": "g mm²", "Nm": "(N m)"}


def unit_of(key):
    """Return the unit that a parameter's name ends in, as people write it."""
    if not has_unit(key):
        return ""
    first = -3 if "_per_" in key else -1
    return "/".join(SIGNS.get(w, w) for w in key.split("_")[first:] if w != "per")


def named(keys):
    """Return the names of some parameters, a long row shortened."""
    told = [f"`{key}`" for key in keys]
    return ", ".join(told) if len(told) <= 3 else f"{told[0]} … {told[-1]} ({len(told)})"


def sizes_of(law):
    """Return names of parameters of a law, and the usual size that they share."""
    alike, at = {}, {}
    for place in law.places:
        for each in law.parameters(place):
            middle = f"{each.mean:g} ± " if each.mean else ""
            size = f"{middle}{each.scale:g} {unit_of(each.key)}".rstrip()
            alike.setdefault(size, {}).setdefault(each.key, []).append(place)
            at.setdefault(each.key, set()).add(size)
    rows = []
    for size, keys in alike.items():
        key, places = next(iter(keys.items()))
        rows.append((named(keys) + (f" at {', '.join(places)}" if len(at[key]) > 1 else ""), size))
    return tuple(rows)


def usual_sizes():
    """Return the table of usual sizes; laws with the same ones share their rows."""
    shared = {}
    for law in catalogue().values():
        shared.setdefault(sizes_of(law), []).append(f"`{law.id}`")
    lines = ["| effect | parameters | usual size |", "|---|---|---|"]
    for rows, laws in shared.items():
        for number, (keys, size) in enumerate(rows):
            lines.append(f"| {', '.join(laws) if number == 0 else ''} | {keys} | {size} |")
    return "\n".join(lines) + "\n"


def test_the_usual_sizes_on_the_page_are_the_laws():
    assert TEXT.split(BEGIN)[1].split(END)[0] == usual_sizes()


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
    (tmp_path / "my_laws.py").write_text(blocks("python")[0])
    table = str(shipped_file("precomputed/palmieri2015.npz"))
    text = whole.replace("../precomputed/palmieri2015.npz", table) + formula + python
    (tmp_path / "m.yaml").write_text(text)
    model = load_model(tmp_path / "m.yaml")
    assert [e.law.id for e in model.effects] == [
        "joint_clearance", "thermal_expansion", "soft_hinge", "twist",
    ]  # fmt: skip


def test_python_on_the_page_runs(monkeypatch):
    monkeypatch.chdir(PAGE.parents[1])
    names = {
        "time": np.array([0.0, 0.1]),
        "theta": np.radians([[5.0, 5.0], [6.0, 5.0]]),
        "load": np.array([[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]] * 2),
    }
    exec(blocks("python")[1], names)
    assert np.allclose(names["several"][1].twist, names["recording"].twist, rtol=1e-12)
    assert np.array_equal(names["tried"].twist, names["prediction"].twist)


if __name__ == "__main__":
    before, rest = TEXT.split(BEGIN)
    PAGE.write_text(before + BEGIN + usual_sizes() + END + rest.split(END)[1])
