"""What all parts of the benchmark share: the table, the rate, and which code gave a result."""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import wrist_stiffness
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.shipped import shipped_file

Array = NDArray[np.float64]

RATE_HZ = 10.0

TRUTH = ("wrist_stiffness.simulation.size",)
"""Modules that make a riddle, with all that they import."""

PACKAGE = Path(wrist_stiffness.__file__).parent

READING = "wrist_stiffness.sessions.reading.session"
"""Module that reads a session."""

OWN = (
    "wrist_stiffness.identification.wrist_diagnosis",
    READING,
    # The registry finds the laws by their files, no import names them.
    *(f"wrist_stiffness.model.effects.{p.stem}" for p in (PACKAGE / "model/effects").glob("*.py")),
)
"""Modules of the project's own diagnosis."""


@cache
def wrist() -> Table:
    """Return the shipped table."""
    return load_table(shipped_file("precomputed/palmieri2015.npz"))


@cache
def code_version(modules: tuple[str, ...], files: tuple[str, ...]) -> str:
    """Return a short digest of the table and of what code does, not of what it says of itself.

    By syntax trees: those of another Python may look different.

    Parameters
    ----------
    modules : tuple of str
        Of the package, with all of the package that they import.
    files : tuple of str
        Of this folder.
    """
    digest = hashlib.sha256(Path(shipped_file("precomputed/palmieri2015.npz")).read_bytes())
    here = Path(__file__).parent
    for path in [*_sources(modules), *(here / name for name in files)]:
        digest.update(_without_words(path.read_text(encoding="utf-8")).encode())
    return digest.hexdigest()[:12]


def _without_words(text: str) -> str:
    """Return code as its syntax tree, without comments, docstrings and layout."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [each for each in node.body if not _is_words(each)]
    return ast.dump(tree)


def _is_words(statement: ast.stmt) -> bool:
    """Tell whether a statement is a string alone: what stands above or below it is explained."""
    value = statement.value if isinstance(statement, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def _sources(modules: tuple[str, ...]) -> list[Path]:
    """Return the files of modules and of all that they import from the package, in order."""
    found: set[Path] = set()
    waiting = list(modules)
    while waiting:
        path = _file(waiting.pop())
        if path is None or path in found:
            continue
        found.add(path)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                waiting += [node.module, *(f"{node.module}.{name.name}" for name in node.names)]
    return sorted(found)


def _file(module: str) -> Path | None:
    """Return the file of a module of the package, None for any other."""
    package, *parts = module.split(".")
    if package != "wrist_stiffness":
        return None
    place = PACKAGE.joinpath(*parts)
    for path in (place / "__init__.py", place.with_suffix(".py")):
        if path.is_file():
            return path
    return None
