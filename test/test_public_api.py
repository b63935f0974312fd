"""What docs/python.md calls stable can be imported, says what it does, and is in the reference."""

import importlib
import inspect
import re
from pathlib import Path

import pytest

from wrist_stiffness import inference

DOCS = Path(__file__).parents[1] / "docs"
ROWS = re.findall(
    r"^\| `(wrist_stiffness\.[\w.]+)` \| (.+) \|$", (DOCS / "python.md").read_text(), re.MULTILINE
)
PUBLIC = [f"{module}.{name}" for module, names in ROWS for name in re.findall(r"`(\w+)`", names)]


def public_members(found):
    """Return the name itself and, of a class, its public methods and properties."""
    members = vars(found).items() if inspect.isclass(found) else ()
    callables = [m for n, m in members if not n.startswith("_") and isinstance(m, property | type)]
    functions = [m for n, m in members if not n.startswith("_") and inspect.isfunction(m)]
    return [found, *callables, *functions]


@pytest.mark.parametrize("name", PUBLIC)
def test_a_stable_name_can_be_imported_and_is_explained(name):
    module, _, own = name.rpartition(".")
    found = getattr(importlib.import_module(module), own)
    assert [each for each in public_members(found) if not inspect.getdoc(each)] == []


def test_the_reference_holds_exactly_the_stable_names():
    assert re.findall(r"^::: (\S+)$", (DOCS / "api.md").read_text(), re.MULTILINE) == PUBLIC


def test_what_the_statistics_export_is_stable():
    ours = {name.rpartition(".")[2] for name in PUBLIC if name.startswith(inference.__name__)}
    assert ours == set(inference.__all__)
