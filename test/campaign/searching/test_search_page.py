"""The page on the search names files and constants that are there."""

import re
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "docs" / "search.md").read_text(encoding="utf-8")
FOLDER = ROOT / "wrist_stiffness" / "campaign" / "searching"


def test_files_on_the_page_are_there():
    named = set(re.findall(r"`(\w+\.py)`", TEXT))
    assert named
    assert named <= {path.name for path in FOLDER.glob("*.py")}


def test_constants_on_the_page_are_defined():
    package = "wrist_stiffness.campaign.searching"
    modules = [import_module(f"{package}.{path.stem}") for path in FOLDER.glob("*.py")]
    known = {name for module in modules for name in vars(module)}
    named = set(re.findall(r"`([A-Z][A-Z_]+)`", TEXT))
    assert len(named) > 5
    assert named <= known
