"""What the technician's page explains is what the code says, word for word."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/troubleshooting.md").read_text()
ROW = re.compile(r"^\| `([^`]+)` \|", re.MULTILINE)
"""A table row that begins with a message."""


def messages_in(text):
    """Return all texts of a module, with … for the values that are filled in."""
    return {
        re.sub("…+", "…", rendered(node))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.JoinedStr | ast.Constant)
    }


def rendered(node):
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    parts = (part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
    return "".join(parts)


CODE = set().union(
    *(messages_in(path.read_text()) for path in (ROOT / "wrist_stiffness").rglob("*.py"))
)
EXPLAINED = [message.replace(r"\|", "|") for message in ROW.findall(PAGE)]


@pytest.mark.parametrize("message", EXPLAINED)
def test_explained_message_is_in_the_code(message):
    assert any(message in text for text in CODE)


def test_the_page_is_read_as_it_looks():
    table = "| `… samples` | fine |\n| `is \\|D\\|` | x |\n|---|\n| plain | `no` |\n"
    assert ROW.findall(table) == ["… samples", r"is \|D\|"]
    assert len(EXPLAINED) > 10


def test_texts_are_read_with_a_mark_for_each_value():
    code = 'raise E(f"load: {n:g} N at O, " f"{a}{b} is not {limit}") if x == "no load" else None'
    assert {"load: … N at O, … is not …", "no load"} <= messages_in(code)
