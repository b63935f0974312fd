"""What the technician's page explains is what the code says, word for word."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/troubleshooting.md").read_text()
TABLE = re.compile(r"^\| message \|.*\n\|[-| ]+\n((?:\|.*\n)+)", re.MULTILINE)
"""Rows of a table of messages."""


def explained_on(page):
    """Return the messages of the tables of messages, at least one for each row."""
    found = []
    for row in (row for rows in TABLE.findall(page) for row in rows.splitlines()):
        cell = re.split(r"(?<!\\)\|", row)[1]
        own = [text.replace(r"\|", "|") for text in re.findall(r"`([^`]+)`", cell)]
        assert own, f"no message in {row}"
        found += own
    return found


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


@cache
def code():
    """Return all texts of the package: not while tests are collected, in every process."""
    files = (ROOT / "wrist_stiffness").rglob("*.py")
    return set().union(*(messages_in(path.read_text()) for path in files))


EXPLAINED = explained_on(PAGE)


@pytest.mark.parametrize("message", EXPLAINED)
def test_explained_message_is_in_the_code(message):
    assert any(message in text for text in code())


def test_the_page_is_read_as_it_looks():
    table = "| message | do |\n|---|---|\n| `… samples`, `b` | x |\n| `is \\|D\\|` | `no` |\n"
    assert explained_on(f"text\n{table}\n| symptom |\n|---|\n| `no` |\n") == [
        "… samples",
        "b",
        r"is |D|",
    ]
    assert PAGE.count("\n| message |") == len(TABLE.findall(PAGE))


def test_a_row_without_a_message_is_found():
    with pytest.raises(AssertionError, match="no message in"):
        explained_on("| message |\n|---|\n| plain |\n")


def test_texts_are_read_with_a_mark_for_each_value():
    code = 'raise E(f"load: {n:g} N at O, " f"{a}{b} is not {limit}") if x == "no load" else None'
    assert {"load: … N at O, … is not …", "no load"} <= messages_in(code)
